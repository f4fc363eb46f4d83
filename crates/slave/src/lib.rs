//! The trait [`Slave`]: all that a co-simulation master knows of an FMU.
//!
//! Implement it for anything that a master shall step beside FMUs: a model in Rust, a proxy for a
//! process, a test double. `fmu-import` implements it for FMUs; `master` couples slaves.
#![forbid(unsafe_code)]

mod transformation;
mod value;

use std::fmt;

use fmu_description::Experiment;
use fmu_description::ModelDescription;
pub use fmu_description::abi::Status;
pub use transformation::Transformation;
pub use value::Value;

/// An instance of a co-simulation FMU, by the functions of FMI 2.0.5, sections 2.1 and 4.2.
///
/// Arrays that belong together have the same length. Every call either did what was asked
/// (`fmi2OK`, `fmi2Warning`) or is an error. What a kind of slave does not have, it leaves to the
/// method given here, which says that the function is missing.
#[expect(clippy::missing_errors_doc, reason = "said at setup_experiment for all")]
pub trait Slave: Send {
    /// The model description that the instance belongs to.
    fn description(&self) -> &ModelDescription;

    /// Whether the outputs follow from the inputs alone: then it is stepped when its inputs are known,
    /// in Jacobi's method after all others.
    fn is_function(&self) -> bool {
        false
    }

    /// `fmi2SetDebugLogging` of all categories.
    ///
    /// # Errors
    ///
    /// As every function here: [`CallError`] with what went wrong and the FMU's own words.
    fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        let _ = on;
        Err(absent("fmi2SetDebugLogging"))
    }

    /// `fmi2SetupExperiment`.
    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError>;

    /// `fmi2EnterInitializationMode`.
    fn enter_initialization_mode(&mut self) -> Result<(), CallError>;

    /// `fmi2ExitInitializationMode`.
    fn exit_initialization_mode(&mut self) -> Result<(), CallError>;

    /// `fmi2Terminate`.
    fn terminate(&mut self) -> Result<(), CallError>;

    /// `fmi2FreeInstance` at once, where it can be told whether that works: of an instance in a
    /// process of its own. No other call may follow. The others are freed when they are dropped.
    fn free(&mut self) -> Result<(), CallError> {
        Ok(())
    }

    /// `fmi2GetReal`.
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError>;

    /// `fmi2SetReal`.
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError>;

    /// `fmi2GetInteger`, also for enumerations.
    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let _ = (references, values);
        Err(absent("fmi2GetInteger"))
    }

    /// `fmi2SetInteger`, also for enumerations.
    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        let _ = (references, values);
        Err(absent("fmi2SetInteger"))
    }

    /// `fmi2GetBoolean`: 0 is false.
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let _ = (references, values);
        Err(absent("fmi2GetBoolean"))
    }

    /// `fmi2SetBoolean`: 0 is false.
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        let _ = (references, values);
        Err(absent("fmi2SetBoolean"))
    }

    /// `fmi2GetString`.
    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        let _ = (references, values);
        Err(absent("fmi2GetString"))
    }

    /// `fmi2SetString`.
    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        let _ = (references, values);
        Err(absent("fmi2SetString"))
    }

    /// `fmi2SetRealInputDerivatives`.
    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        let _ = (references, orders, values);
        Err(absent("fmi2SetRealInputDerivatives"))
    }

    /// `fmi2GetRealOutputDerivatives`.
    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        let _ = (references, orders, values);
        Err(absent("fmi2GetRealOutputDerivatives"))
    }

    /// `fmi2DoStep` from `time` over `size`, both in s. `never_back` is
    /// `noSetFMUStatePriorToCurrentPoint`. An answer of `fmi2Pending` is waited for.
    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError>;

    /// `fmi2GetDirectionalDerivative`: the change of `unknowns` when `knowns` change by `seed`.
    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        let _ = (unknowns, knowns, seed, changes);
        Err(absent("fmi2GetDirectionalDerivative"))
    }

    /// `fmi2GetFMUstate`: keeps the state of now in `slot` (0, 1, 2, ...), in place of the one there.
    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        let _ = slot;
        Err(absent("fmi2GetFMUstate"))
    }

    /// `fmi2SetFMUstate`: back to the state kept in `slot`, which stays there.
    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        let _ = slot;
        Err(absent("fmi2SetFMUstate"))
    }

    /// `fmi2SerializeFMUstate` of the state of now.
    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Err(absent("fmi2SerializeFMUstate"))
    }

    /// `fmi2DeSerializeFMUstate`, and on to that state.
    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let _ = bytes;
        Err(absent("fmi2DeSerializeFMUstate"))
    }

    /// Sets Real inputs and their derivatives, steps, reads Real outputs and their derivatives:
    /// one call, so that a slave in another process is asked once. A step done in part reads too.
    fn advance(&mut self, step: &mut Advance<'_>) -> Result<StepResult, CallError> {
        if !step.inputs.is_empty() {
            self.set_real(step.inputs, step.input_values)?;
        }
        if !step.derived_inputs.is_empty() {
            let orders = step.input_orders;
            self.set_input_derivatives(step.derived_inputs, orders, step.input_derivatives)?;
        }
        let done = self.do_step(step.time, step.size, step.never_back)?;
        if !step.outputs.is_empty() {
            self.get_real(step.outputs, step.output_values)?;
        }
        if !step.derived_outputs.is_empty() {
            let orders = step.output_orders;
            self.get_output_derivatives(step.derived_outputs, orders, step.output_derivatives)?;
        }
        Ok(done)
    }

    /// [`Slave::advance`] without derivatives, in the shape that costs least: the values of the
    /// inputs with these references are set, the span (time and size in s) is stepped over, the
    /// outputs with these references are read.
    fn pass(
        &mut self,
        inputs: (&[u32], &[f64]),
        (time, size): (f64, f64),
        never_back: bool,
        outputs: (&[u32], &mut [f64]),
    ) -> Result<StepResult, CallError> {
        self.advance(&mut Advance::held(inputs, (time, size), never_back, outputs))
    }

    /// Whether a call has returned `fmi2Warning` since this was last asked; false where that is not
    /// known, as of an instance in another process.
    fn take_warning(&mut self) -> bool {
        false
    }

    /// The same slave to begin steps that are finished later; always `None` where stepping blocks the
    /// calling thread.
    fn in_background(&mut self) -> Option<&mut dyn Background> {
        None
    }
}

/// A slave that steps while its caller goes on, for example to begin the steps of others.
pub trait Background {
    /// The first half of [`Slave::advance`]: sets the inputs and begins the step. What comes next is
    /// [`Background::finish_advance`]; any other call waits for the end of the step, whose outcome
    /// is then lost.
    ///
    /// # Errors
    ///
    /// Where the step cannot be begun: there is nothing to finish then.
    fn begin_advance(&mut self, step: &Advance<'_>) -> Result<(), CallError>;

    /// The second half of [`Slave::advance`]: waits for the step that was begun and reads the outputs.
    ///
    /// # Errors
    ///
    /// As [`Slave::advance`], and where no step was begun.
    fn finish_advance(&mut self, step: &mut Advance<'_>) -> Result<StepResult, CallError>;
}

/// [`Background::finish_advance`] of a slave in the background, [`Slave::advance`] of another.
///
/// # Errors
///
/// As [`Slave::advance`].
pub fn finish(slave: &mut dyn Slave, step: &mut Advance<'_>) -> Result<StepResult, CallError> {
    match slave.in_background() {
        Some(slave) => slave.finish_advance(step),
        None => slave.advance(step),
    }
}

/// What [`Slave::advance`] sets, steps over and reads.
#[derive(Debug)]
pub struct Advance<'a> {
    /// Value references of the inputs to set, and their values.
    pub inputs: &'a [u32],
    /// One for each of `inputs`.
    pub input_values: &'a [f64],
    /// Value references of the inputs whose derivatives are set, with orders and values.
    pub derived_inputs: &'a [u32],
    /// One for each of `derived_inputs`.
    pub input_orders: &'a [i32],
    /// One for each of `derived_inputs`.
    pub input_derivatives: &'a [f64],
    /// Begin of the step in s.
    pub time: f64,
    /// Its size in s.
    pub size: f64,
    /// `noSetFMUStatePriorToCurrentPoint`.
    pub never_back: bool,
    /// Value references of the outputs to read.
    pub outputs: &'a [u32],
    /// One for each of `outputs`.
    pub output_values: &'a mut [f64],
    /// Value references of the outputs whose derivatives are read, with orders and values.
    pub derived_outputs: &'a [u32],
    /// One for each of `derived_outputs`.
    pub output_orders: &'a [i32],
    /// One for each of `derived_outputs`.
    pub output_derivatives: &'a mut [f64],
}

impl<'a> Advance<'a> {
    /// A step from `time` over `size` without derivatives: references and values of the inputs, and
    /// of the outputs.
    #[must_use]
    pub fn held(
        (inputs, input_values): (&'a [u32], &'a [f64]),
        (time, size): (f64, f64),
        never_back: bool,
        (outputs, output_values): (&'a [u32], &'a mut [f64]),
    ) -> Self {
        Self {
            inputs,
            input_values,
            derived_inputs: &[],
            input_orders: &[],
            input_derivatives: &[],
            time,
            size,
            never_back,
            outputs,
            output_values,
            derived_outputs: &[],
            output_orders: &[],
            output_derivatives: &mut [],
        }
    }
}

/// How far a step came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepResult {
    /// To its end.
    Whole,
    /// `fmi2Discard`: only to `fmi2LastSuccessfulTime`.
    Part {
        /// That time in s.
        reached: f64,
        /// `fmi2Terminated`: the FMU wants the simulation to end there.
        terminated: bool,
    },
}

/// A call that an FMU refused or failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{function} {failure}{}", quoted(.messages))]
pub struct CallError {
    /// The function of the standard.
    pub function: &'static str,
    /// How it failed.
    pub failure: Failure,
    /// What the FMU said to the logger during the call.
    pub messages: Vec<String>,
}

impl CallError {
    /// Whether the instance may be used on: the call was refused, without `fmi2Fatal` and without the
    /// end of a process.
    #[must_use]
    pub fn leaves_the_instance_usable(&self) -> bool {
        match &self.failure {
            Failure::Status(status) => *status != Status::Fatal,
            Failure::Missing => true,
            _ => false,
        }
    }
}

/// How a call failed.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// It returned this status.
    Status(Status),
    /// It returned a value that the standard does not know.
    UnknownStatus(i32),
    /// The library, or this way in, does not have the function.
    Missing,
    /// It panicked inside the crate through which it was called.
    Panicked(String),
    /// The process of the FMU was ended by this signal: number and name.
    Killed(i32, &'static str),
    /// The FMU ended its process with this exit status.
    Exited(i32),
    /// It did not return within this time in s; its process was ended.
    TimedOut(f64),
    /// Its process crashed after it had not been given memory beyond this limit in bytes.
    OutOfMemory(u64),
    /// It answered something impossible: what.
    InvalidAnswer(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Status(status) => write!(formatter, "returned {}", status.name()),
            Failure::UnknownStatus(status) => {
                write!(formatter, "returned {status}, expected a status of the standard (0 to 5)")
            }
            Failure::Missing => formatter.write_str("is missing"),
            Failure::Panicked(text) => write!(formatter, "panicked: {text}"),
            Failure::Killed(number, name) => {
                write!(formatter, "crashed: its process was ended by signal {number} ({name})")
            }
            Failure::Exited(status) => {
                write!(formatter, "ended its process with exit status {status}")
            }
            Failure::TimedOut(seconds) => write!(formatter, "did not return within {seconds} s"),
            Failure::OutOfMemory(limit) => write!(
                formatter,
                "crashed: it needs more memory than the limit of {limit} bytes for its process"
            ),
            Failure::InvalidAnswer(what) => formatter.write_str(what),
        }
    }
}

/// The error that a function is missing.
#[cold]
#[must_use]
pub fn absent(function: &'static str) -> CallError {
    CallError { function, failure: Failure::Missing, messages: Vec::new() }
}

fn quoted(messages: &[String]) -> String {
    if messages.is_empty() { String::new() } else { format!(": {}", messages.join("; ")) }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
