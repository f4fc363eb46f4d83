//! The trait [`Slave`]: the interface through which a co-simulation master calls an FMU, or a model that runs
//! together with FMUs: a model in Rust, a proxy for a process, a test double.
//!
//! `fmu-import` implements it for FMUs; `master` couples slaves.
#![forbid(unsafe_code)]

mod events;
mod model_exchange;
mod time;
mod transformation;
mod value;

pub use events::Events;
pub use fmu_description::abi::Status;
use fmu_description::{Experiment, ModelDescription};
pub use fmu_description::{from_hex, to_hex};
pub use model_exchange::{CompletedStep, EventInfo, ModelExchange};
pub use time::time_rounding;
pub use transformation::Transformation;
pub use value::{Value, ValueType, mapped_integer, to_real};

/// An instance of a co-simulation FMU of FMI 1.0, 2.0 or 3.0.
///
/// The functions are named after FMI 2.0.5, sections 2.1 and 4.2. A slave of another version maps them
/// to its own:
///
/// * `get_real` and `set_real` access `Float64` and `Float32`; a `Float32` gets the value in single precision.
/// * `get_integer` and `set_integer` access all integer types and enumerations as `i64`. A value that
///   the type of the variable cannot represent is an error.
/// * `get_boolean` and `set_boolean` also access clocks: see [`Slave::get_boolean`].
/// * Each element of an array is a variable of [`Slave::description`] with a value reference of its own,
///   called `name[1,2]` with indices that start at 1. So there are always as many values as references.
/// * Events are handled inside of the slave: [`Slave::do_step`] continues after an event until the end
///   of the communication step. [`Slave::hand_over_events`] changes this.
/// * Clocked variables may be read and set at any time: outside of the ticks of their clock, reading
///   returns the value at the last tick, and a value set reaches the FMU at the next one.
///
/// Arrays that belong together have the same length. A call succeeds (`fmi2OK`, `fmi2Warning`) or returns a
/// [`CallError`]; `fmi2Discard` of a step is [`StepResult::Part`]. By default the functions that access values,
/// derivatives and states return [`Failure::Missing`]; those that set up, change modes, terminate and free succeed.
#[expect(clippy::missing_errors_doc, reason = "the trait documents the error of every function")]
#[expect(unused_variables, reason = "arguments of functions that an implementation may leave out")]
pub trait Slave: Send {
    /// Returns the model description of the FMU, in which each element of an array is a scalar variable.
    ///
    /// Only [`Slave::configure`] changes it.
    fn description(&self) -> &ModelDescription;

    /// Whether the slave has no states: its outputs depend on the present inputs only. The Jacobi method steps such a
    /// slave after all others, when the inputs are known.
    fn is_function(&self) -> bool {
        false
    }

    /// `fmi2SetDebugLogging` for all categories.
    fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        Err(absent("fmi2SetDebugLogging"))
    }

    /// Sets structural parameters (FMI 3.0) in configuration mode, before [`Slave::enter_initialization_mode`]: value
    /// references and values; a Boolean is 0 or 1. Arrays change their sizes, so [`Slave::description`] has other
    /// variables afterwards, and states that were saved before are discarded.
    fn configure(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        Err(absent("fmi3EnterConfigurationMode"))
    }

    /// `fmi2SetupExperiment`.
    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        Ok(())
    }

    /// `fmi2EnterInitializationMode`.
    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        Ok(())
    }

    /// `fmi2ExitInitializationMode`.
    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        Ok(())
    }

    /// `fmi2Terminate`.
    fn terminate(&mut self) -> Result<(), CallError> {
        Ok(())
    }

    /// Calls `fmi2FreeInstance` now and reports its outcome, if the instance runs in its own process. No other call may
    /// follow. Any other instance is freed when it is dropped.
    fn free(&mut self) -> Result<(), CallError> {
        Ok(())
    }

    /// `fmi2GetReal`.
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError>;

    /// `fmi2SetReal`.
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError>;

    /// `fmi2GetInteger`, also for enumerations and for the integer types of FMI 3.0.
    fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Result<(), CallError> {
        Err(absent("fmi2GetInteger"))
    }

    /// `fmi2SetInteger`, also for enumerations and for the integer types of FMI 3.0.
    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        Err(absent("fmi2SetInteger"))
    }

    /// `fmi2GetBoolean`: 0 is false. In event mode a clock is true while it ticks. Otherwise a clock is true if it has
    /// ticked in the last step or at the end of that step.
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        Err(absent("fmi2GetBoolean"))
    }

    /// `fmi2SetBoolean`: 0 is false. True makes a triggered input clock tick: in event mode now, otherwise at the
    /// start of the next step.
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        Err(absent("fmi2SetBoolean"))
    }

    /// `fmi2GetString`.
    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        Err(absent("fmi2GetString"))
    }

    /// `fmi2SetString`.
    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        Err(absent("fmi2SetString"))
    }

    /// `fmi3GetBinary`.
    fn get_binary(&mut self, references: &[u32], values: &mut [Vec<u8>]) -> Result<(), CallError> {
        Err(absent("fmi3GetBinary"))
    }

    /// `fmi3SetBinary`.
    fn set_binary(&mut self, references: &[u32], values: &[Vec<u8>]) -> Result<(), CallError> {
        Err(absent("fmi3SetBinary"))
    }

    /// `fmi2SetRealInputDerivatives`.
    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        Err(absent("fmi2SetRealInputDerivatives"))
    }

    /// `fmi2GetRealOutputDerivatives`.
    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        Err(absent("fmi2GetRealOutputDerivatives"))
    }

    /// `fmi2DoStep` from `time` to `time + size`, both in s. `never_back` is `noSetFMUStatePriorToCurrentPoint`. After
    /// `fmi2Pending` the call waits for the end of the step; `fmi2Discard` returns [`StepResult::Part`].
    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError>;

    /// `fmi2GetDirectionalDerivative` (section 2.1.9): `changes = (dh/dv) seed` for the `unknowns` h and
    /// the `knowns` v.
    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        Err(absent("fmi2GetDirectionalDerivative"))
    }

    /// `fmi2GetFMUstate`: saves the present state in `slot` (0, 1, 2, ...) and overwrites an earlier one.
    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        Err(absent("fmi2GetFMUstate"))
    }

    /// `fmi2SetFMUstate`: restores the state saved in `slot`. The slot keeps the state.
    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        Err(absent("fmi2SetFMUstate"))
    }

    /// `fmi2SerializeFMUstate`: returns the present state as bytes.
    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Err(absent("fmi2SerializeFMUstate"))
    }

    /// `fmi2DeSerializeFMUstate` and `fmi2SetFMUstate`: restores a serialised state.
    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        Err(absent("fmi2DeSerializeFMUstate"))
    }

    /// Sets Real inputs and their derivatives, makes the step, and reads Real outputs and their derivatives, also after
    /// a partial step. All in one function, so that a slave in another process receives one request.
    fn advance(&mut self, request: &mut StepRequest<'_>) -> Result<StepResult, CallError> {
        if !request.inputs.is_empty() {
            self.set_real(request.inputs, request.input_values)?;
        }
        if !request.derived_inputs.is_empty() {
            self.set_input_derivatives(
                request.derived_inputs,
                request.input_orders,
                request.input_derivatives,
            )?;
        }
        let CommunicationStep { time, size, never_back } = request.step;
        let done = self.do_step(time, size, never_back)?;
        if !request.outputs.is_empty() {
            self.get_real(request.outputs, request.output_values)?;
        }
        if !request.derived_outputs.is_empty() {
            self.get_output_derivatives(
                request.derived_outputs,
                request.output_orders,
                request.output_derivatives,
            )?;
        }
        Ok(done)
    }

    /// [`Slave::advance`] without derivatives, which is faster: sets the inputs (references and
    /// values), makes the step, reads the outputs (references and values).
    fn pass(
        &mut self,
        inputs: &[u32],
        values: &[f64],
        step: CommunicationStep,
        outputs: &[u32],
        results: &mut [f64],
    ) -> Result<StepResult, CallError> {
        self.advance(&mut StepRequest::held(inputs, values, step, outputs, results))
    }

    /// Hands the events of this slave over to the master; call it before [`Slave::setup_experiment`], and again to
    /// change `stop`. Returns whether the slave has events that [`Slave::events`] can handle. If so, the slave
    ///
    /// * is in event mode after [`Slave::exit_initialization_mode`],
    /// * ends a step with [`StepResult::Event`] if an event happens at the end of the step, or, with `stop`, at the
    ///   first event. Without `stop` the slave handles earlier events itself.
    fn hand_over_events(&mut self, stop: bool) -> Result<bool, CallError> {
        Ok(false)
    }

    /// Returns the interface for events that have been handed over; `None` if the slave has no events.
    fn events(&mut self) -> Option<&mut dyn Events> {
        None
    }

    /// Logs the C calls of this slave: passes to `sink` the text of each call before the call, and status, results
    /// and the end of the line after the call. Returns false if the slave cannot log C calls; the caller then logs
    /// the functions of this trait.
    fn log_calls(&mut self, sink: CallSink) -> bool {
        false
    }

    /// From now on passes copies of arrays to the FMU, with canaries around them: a call fails if the FMU writes past
    /// an array or into a `const` array. Does nothing if the slave calls no C functions in this process.
    fn guard_arrays(&mut self) {}

    /// Returns the settings of its process that the FMU has changed, one phrase each: environment, working directory,
    /// rounding mode, locale, process group. Empty unless the FMU is alone in a process.
    fn process_changes(&mut self) -> Result<Vec<String>, CallError> {
        Ok(Vec::new())
    }

    /// Whether a call has returned `fmi2Warning` since the last call of this function. False if unknown, as for an
    /// instance in another process.
    fn take_warning(&mut self) -> bool {
        false
    }

    /// Returns the interface for steps that run in the background; `None` if stepping blocks the calling thread.
    fn in_background(&mut self) -> Option<&mut dyn Background> {
        None
    }
}

/// Receives the text of calls, for [`Slave::log_calls`].
pub type CallSink = Box<dyn FnMut(&str) + Send>;

/// A slave that steps in the background, so that its caller can start the steps of other slaves.
pub trait Background {
    /// The first half of [`Slave::advance`]: sets the inputs and starts the step. Call [`Background::finish_advance`]
    /// next: any other call waits for the end of the step and discards its result.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the step cannot be started. Do not call [`Background::finish_advance`] then.
    fn begin_advance(&mut self, request: &StepRequest<'_>) -> Result<(), CallError>;

    /// The second half of [`Slave::advance`]: waits for the end of the step and reads the outputs.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the step or the reading of the outputs fails, or if no step was started.
    fn finish_advance(&mut self, request: &mut StepRequest<'_>) -> Result<StepResult, CallError>;
}

/// Finishes a step: calls [`Background::finish_advance`] if the slave steps in the background, otherwise
/// [`Slave::advance`], which makes the whole step.
///
/// # Errors
///
/// The [`CallError`] of the function called.
pub fn finish(
    slave: &mut dyn Slave,
    request: &mut StepRequest<'_>,
) -> Result<StepResult, CallError> {
    match slave.in_background() {
        Some(slave) => slave.finish_advance(request),
        None => slave.advance(request),
    }
}

/// A communication step: the arguments of `fmi2DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommunicationStep {
    /// Start of the step in s.
    pub time: f64,
    /// Size of the step in s.
    pub size: f64,
    /// `noSetFMUStatePriorToCurrentPoint`.
    pub never_back: bool,
}

/// The arguments of [`Slave::advance`]: inputs, communication step and outputs.
#[derive(Debug)]
pub struct StepRequest<'a> {
    /// Value references of the inputs to set.
    pub inputs: &'a [u32],
    /// Values of `inputs`.
    pub input_values: &'a [f64],
    /// Value references of the inputs whose derivatives are in `input_derivatives`.
    pub derived_inputs: &'a [u32],
    /// Orders of the derivatives of `derived_inputs`.
    pub input_orders: &'a [i32],
    /// Values of the derivatives of `derived_inputs`.
    pub input_derivatives: &'a [f64],
    /// The communication step.
    pub step: CommunicationStep,
    /// Value references of the outputs to read.
    pub outputs: &'a [u32],
    /// Receives the values of `outputs`.
    pub output_values: &'a mut [f64],
    /// Value references of the outputs whose derivatives are read into `output_derivatives`.
    pub derived_outputs: &'a [u32],
    /// Orders of the derivatives of `derived_outputs`.
    pub output_orders: &'a [i32],
    /// Receives the derivatives of `derived_outputs`.
    pub output_derivatives: &'a mut [f64],
}

impl<'a> StepRequest<'a> {
    /// A step with constant inputs: references and values of the inputs and of the outputs, no derivatives.
    #[must_use]
    pub fn held(
        inputs: &'a [u32],
        input_values: &'a [f64],
        step: CommunicationStep,
        outputs: &'a [u32],
        output_values: &'a mut [f64],
    ) -> Self {
        Self {
            inputs,
            input_values,
            derived_inputs: &[],
            input_orders: &[],
            input_derivatives: &[],
            step,
            outputs,
            output_values,
            derived_outputs: &[],
            output_orders: &[],
            output_derivatives: &mut [],
        }
    }
}

/// The result of a communication step: complete or partial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepResult {
    /// The step reached its end.
    Whole,
    /// The step ended at an event, which the master handles by [`Slave::events`].
    Event {
        /// The time reached, in s.
        reached: f64,
    },
    /// `fmi2Discard`: the step ended early.
    Part {
        /// `fmi2LastSuccessfulTime`: the time reached, in s.
        reached: f64,
        /// `fmi2Terminated`: the FMU requests the end of the simulation at that time.
        terminated: bool,
    },
}

/// The error of a call of an FMU.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{function} {}{}", self.failure_text(), joined(.messages))]
pub struct CallError {
    /// Name of the FMI function, or of the failed operation in its place, such as an integration.
    pub function: &'static str,
    /// Kind of the failure.
    pub failure: Failure,
    /// Messages that the FMU logged during the call.
    pub messages: Vec<String>,
}

impl CallError {
    /// Returns the text of [`CallError::failure`], with the status in the spelling of the FMI version of
    /// the function: `fmi3Error` for `fmi3DoStep`, `fmiError` for `fmiDoStep`.
    #[must_use]
    pub fn failure_text(&self) -> String {
        let text = self.failure.to_string();
        let prefix = match &self.failure {
            Failure::Status(_) | Failure::InvalidAnswer(_) => {
                ["fmi2", "fmi3", "fmi"].into_iter().find(|prefix| self.function.starts_with(prefix))
            }
            _ => None,
        };
        match prefix {
            None | Some("fmi2") => text,
            Some(prefix) => text.replace("fmi2", prefix),
        }
    }

    /// Whether the instance can still be used: the call returned a status other than `fmi2Fatal`, or the
    /// function is missing.
    #[must_use]
    pub fn leaves_the_instance_usable(&self) -> bool {
        match &self.failure {
            Failure::Status(status) => *status != Status::Fatal,
            Failure::Missing => true,
            _ => false,
        }
    }

    /// Whether the simulation of the instance must end: the instance is unusable, or the call returned `fmi2Error`,
    /// after which an instance can only be restored, reset or freed (FMI 2.0.5, section 2.1.3; FMI 3.0.2, section
    /// 2.2.3). For a function that the FMU may lack, use [`CallError::leaves_the_instance_usable`]: some FMUs
    /// return `fmi2Error` instead of leaving the function out.
    #[must_use]
    pub fn ends_the_instance(&self) -> bool {
        !self.leaves_the_instance_usable() || self.failure == Failure::Status(Status::Error)
    }
}

/// Kind of the failure of a call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The function returned this status.
    #[error("returned {}", .0.name())]
    Status(Status),
    /// The function returned a value that is no `fmi2Status`.
    #[error("returned {0}, expected a status of the standard (0 to 5)")]
    UnknownStatus(i32),
    /// The FMU does not have the function, or this kind of slave does not offer it.
    #[error("is missing")]
    Missing,
    /// The importer panicked during the call; the text is the panic's message.
    #[error("panicked: {0}")]
    Panicked(String),
    /// A signal ended the process of the FMU: number and name.
    #[error("crashed: its process was ended by signal {0} ({1})")]
    Killed(i32, &'static str),
    /// The FMU ended its process with this exit status.
    #[error("ended its process with exit status {0}")]
    Exited(i32),
    /// The function did not return within this time in s; the importer ended the FMU's process.
    #[error("did not return within {0} s")]
    TimedOut(f64),
    /// The process of the FMU crashed when it needed more memory than this limit in bytes.
    #[error("crashed: it needs more memory than the limit of {0} bytes for its process")]
    OutOfMemory(u64),
    /// The function returned an impossible result; the text describes it.
    #[error("{0}")]
    InvalidAnswer(String),
    /// The function returned a value that the importer cannot represent; the text describes it.
    #[error("{0}")]
    Unrepresentable(String),
}

/// Returns the error [`Failure::Missing`] for `function`.
#[cold]
#[must_use]
pub fn absent(function: &'static str) -> CallError {
    CallError { function, failure: Failure::Missing, messages: Vec::new() }
}

/// Returns the messages as the end of a sentence; empty without any.
fn joined(messages: &[String]) -> String {
    if messages.is_empty() { String::new() } else { format!(": {}", messages.join("; ")) }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
