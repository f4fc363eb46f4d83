//! An instance of a model: the state machine of FMI in safe Rust, called by the C ABI.

mod derivatives;
mod door;
mod exchange;
mod fmi3;
mod layout;
mod snapshot;
#[cfg(test)]
mod tests;
mod values;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::Experiment;
use crate::callbacks::Callbacks;
use crate::fence::{HookGuard, guarded};
use crate::interface::{Interface, WARNING, new_model};
use crate::log::{Log, Message};
use crate::model::{Failure, Model, Step};
use crate::stepper::Stepper;
use fmu_description::abi::Status;
use fmu_description::call_order::{InterfaceType, State};
use fmu_description::{Guid, ModelDescription};

pub(crate) use door::Function;
pub(crate) use fmi3::{Instantiation, Jacobian, Session};
pub(crate) use snapshot::Snapshot;

/// The content of an FMU state: everything that determines the further simulation.
#[derive(Clone, Serialize, Deserialize)]
#[serde(bound = "")]
#[expect(clippy::struct_excessive_bools, reason = "four facts that are independent")]
pub(crate) struct Core<M: Model> {
    model: M,
    interface_type: InterfaceType,
    state: State,
    /// Whether the last step ended because the model requested the end of the simulation.
    terminated: bool,
    experiment: Experiment,
    time: f64,
    /// Whether a value was set since the model last computed its outputs.
    stale: bool,
    /// Whether the parameters still have to pass [`Model::check`]: at first, and after a parameter was set.
    unchecked: bool,
    /// Whether an input derivative is set for the next step.
    sloped: bool,
    /// The time of the next event in s; `None` if the last event stated none.
    next_event: Option<f64>,
    /// Model exchange: the earliest time in s to which the importer may go back, and the time of the last
    /// completed integrator step.
    earliest: f64,
    completed: f64,
}

/// Lays the variables out for values of the structural parameters.
type LayOut<M> = fn(&mut Instance<M>, Vec<u64>) -> Result<(), Failure>;

/// An instance: the FMU state and the data that is not part of the state.
pub(crate) struct Instance<M: Model> {
    core: Core<M>,
    fresh: M,
    interface: Interface<M>,
    /// Integrates a model that has no step of its own.
    stepper: Stepper,
    callbacks: Callbacks,
    /// Whether messages of the model that are no warnings are sent.
    debug_logging: bool,
    /// Messages of the model that have not been sent to the importer.
    messages: Vec<Message>,
    /// Log categories selected by `fmi2SetDebugLogging`; `None` selects all.
    categories: Option<Vec<String>>,
    /// The strings returned by the last `fmi2GetString`, which must stay valid until the next call.
    strings: Vec<std::ffi::CString>,
    /// Buffer for `fmi2GetDirectionalDerivative`, created by the first call.
    direction: Option<M>,
    /// The additional part of an instance of FMI 3.0; `None` in FMI 2.0.
    session: Option<Box<Session>>,
    /// [`Instance::lay_out`], in FMI 3.0 only. A pointer, so that a program without instances of FMI 3.0 does not
    /// contain the function.
    lay_out: Option<LayOut<M>>,
    hook_guard: HookGuard,
}

impl<M: Model> Core<M> {
    fn new(model: M, interface_type: InterfaceType) -> Self {
        Self {
            model,
            interface_type,
            state: State::Instantiated,
            terminated: false,
            experiment: Experiment::default(),
            time: 0.0,
            stale: true,
            unchecked: true,
            sloped: false,
            next_event: None,
            earliest: 0.0,
            completed: 0.0,
        }
    }

    /// Checks that `time` is not after `stopTime`, if `stopTime` is defined (section 2.1.6).
    fn before_stop(&self, time: f64) -> Result<(), Failure> {
        match self.experiment.stop_time.filter(|stop| time > stop + time_tolerance(*stop)) {
            Some(stop) => Err(Failure::Error(format!("{time} s is past stopTime {stop} s"))),
            None => Ok(()),
        }
    }

    /// Calls [`Model::check`] unless the model has passed it since a parameter was last set.
    #[inline]
    fn check(&mut self) -> Result<(), Failure> {
        if self.unchecked { self.check_model() } else { Ok(()) }
    }

    #[cold]
    fn check_model(&mut self) -> Result<(), Failure> {
        self.model.check()?;
        self.unchecked = false;
        Ok(())
    }
}

impl<M: Model> Instance<M> {
    /// `fmi2Instantiate`: reads the resources and compares the GUID.
    pub(crate) fn new(
        interface_type: InterfaceType,
        resources: &Path,
        guid: &str,
        callbacks: Callbacks,
    ) -> Result<Self, Failure> {
        let (instance, _) = Self::build(
            || new_model::<M>(resources),
            callbacks,
            |interface, description| {
                interface.restrict(description)?;
                if interface_type == InterfaceType::ModelExchange && !interface.offers_exchange() {
                    let message =
                        "fmuType is fmi2ModelExchange, and this FMU offers co-simulation only";
                    return Err(Failure::Error(message.to_owned()));
                }
                check_guid::<M>(interface.guid, "GUID", guid, resources)?;
                Ok(None)
            },
        )?;
        Ok(instance.into_type(interface_type))
    }

    /// Makes the model and its interface inside the panic fence. Returns the instance with its model description.
    /// `session` checks the importer's arguments and makes the part for FMI 3.0. `session` also runs inside the fence,
    /// because a failure of it drops the model, which may panic.
    fn build(
        make: impl FnOnce() -> Result<M, Failure>,
        callbacks: Callbacks,
        session: impl FnOnce(
            &mut Interface<M>,
            &mut ModelDescription,
        ) -> Result<Option<Box<Session>>, Failure>,
    ) -> Result<(Self, ModelDescription), Failure> {
        // Outside of the fence: if a panic of the model dropped the guard, it could not restore the hook.
        let hook_guard = HookGuard::new();
        let (complete, description) = guarded(|| {
            let mut fresh = make()?;
            let messages = fresh.log().map(Log::take).unwrap_or_default();
            let (mut interface, mut description) = Interface::new(&mut fresh)?;
            let session = session(&mut interface, &mut description)?;
            let stepper = Stepper::new(&interface, description.default_experiment);
            let core = Core::new(fresh.clone(), InterfaceType::CoSimulation);
            let complete = move |hook_guard| Self {
                core,
                fresh,
                interface,
                stepper,
                callbacks,
                debug_logging: false,
                messages,
                categories: None,
                strings: Vec::new(),
                direction: None,
                session,
                lay_out: None,
                hook_guard,
            };
            Ok((complete, description))
        })?;
        Ok((complete(hook_guard), description))
    }

    /// An instance for co-simulation of `model` in the same program, with its model description of FMI 2.0.
    pub(crate) fn linked(
        model: M,
        callbacks: Callbacks,
    ) -> Result<(Self, ModelDescription), Failure> {
        Self::build(
            || Ok(model),
            callbacks,
            |interface, description| {
                interface.restrict(description)?;
                Ok(None)
            },
        )
    }

    fn into_type(mut self, interface_type: InterfaceType) -> Self {
        self.core.interface_type = interface_type;
        self
    }

    /// Runs one FMI call: checks the call order, runs `body` inside the panic fence, and converts a
    /// failure to state, log message and status.
    pub(crate) fn call<F: Function>(
        &mut self,
        function: F,
        body: impl FnOnce(&mut Self) -> Result<(), Failure>,
    ) -> Status {
        let state = self.core.state;
        if state == State::Fatal {
            return Status::Fatal;
        }
        // A boxed failure keeps the result of a successful call in one register.
        let result = if function.is_allowed(self.core.interface_type, state) {
            guarded(|| {
                let result = body(self).map_err(Box::new);
                if let Some(log) = self.core.model.log().filter(|log| !log.is_empty()) {
                    self.messages = log.take();
                }
                result
            })
        } else {
            Err(Box::new(Failure::Error(format!("must not be called in state {state:?}"))))
        };
        let warned = !self.messages.is_empty() && self.send_messages();
        match result {
            Ok(()) if warned => Status::Warning,
            Ok(()) => Status::OK,
            Err(failure) => self.fail(function, &failure),
        }
    }

    /// Sends the messages of the model to the importer, messages that are no warnings only if debug logging is on.
    /// Returns whether one of them is a warning.
    #[cold]
    pub(crate) fn send_messages(&mut self) -> bool {
        let mut warned = false;
        for Message { category, text } in std::mem::take(&mut self.messages) {
            match category {
                Some(category) if self.debug_logging => self.log(Status::OK, category, &text),
                Some(_) => {}
                None => {
                    warned = true;
                    self.log(Status::Warning, WARNING, &text);
                }
            }
        }
        warned
    }

    /// Changes the state after a failure, logs the failure, and returns its status.
    #[cold]
    fn fail<F: Function>(&mut self, function: F, failure: &Failure) -> Status {
        let (status, category) = match failure {
            Failure::Fatal(_) => (Status::Fatal, "logStatusFatal"),
            failure if function.discards(self.core.interface_type, failure) => {
                (Status::Discard, "logStatusDiscard")
            }
            _ => (Status::Error, "logStatusError"),
        };
        match status {
            Status::Discard if function.keeps_partial_step() => self.record_partial_step(failure),
            Status::Error => self.core.state = F::STATE_AFTER_ERROR,
            Status::Fatal => self.core.state = State::Fatal,
            _ => {}
        }
        self.log(status, category, &format!("{}: {failure}", function.name()));
        status
    }

    /// Records a step that ended early, at the time reported by the model if that is finite and not
    /// before the start of the step.
    fn record_partial_step(&mut self, failure: &Failure) {
        self.core.state = State::StepFailed;
        self.core.terminated = matches!(failure, Failure::Terminated { .. });
        if let Failure::Incomplete { time, .. } | Failure::Terminated { time, .. } = failure
            && time.is_finite()
        {
            self.core.time = self.core.time.max(*time);
        }
    }

    /// Frees the instance, and logs a panic of the model. Drops the models one after another, so that a panic in one
    /// destructor does not abort the process in another.
    pub(crate) fn free(self) {
        let Self { core, fresh, direction, callbacks, categories, session, hook_guard, .. } = self;
        let dropped =
            [drop_inside_fence(core), drop_inside_fence(fresh), drop_inside_fence(direction)];
        if let Some(failure) = dropped.into_iter().find_map(Result::err) {
            let version = if session.is_some() { 3 } else { 2 };
            let message = format!("fmi{version}FreeInstance: {failure}");
            log(&callbacks, categories.as_deref(), Status::Fatal, "logStatusFatal", &message);
        }
        drop(hook_guard);
    }

    /// Logs a message if its category is selected or its status must be explained ([`Callbacks::needs`]).
    fn log(&self, status: Status, category: &str, message: &str) {
        log(&self.callbacks, self.categories.as_deref(), status, category, message);
    }

    /// `loggingOn`: turns the messages of the model that are no warnings on or off.
    pub(crate) fn set_logging_on(&mut self, on: bool) {
        self.debug_logging = on;
    }

    /// `fmi2SetDebugLogging`: selects the categories whose messages are sent, all if `categories` is empty. An error
    /// for an unknown category. Messages that explain a status are sent even if debug logging is off (section
    /// 2.1.3).
    pub(crate) fn set_debug_logging(&mut self, categories: Vec<String>) -> Result<(), Failure> {
        self.check_categories(&categories)?;
        self.categories = (!categories.is_empty()).then_some(categories);
        Ok(())
    }

    /// Checks that the FMU has these log categories.
    fn check_categories(&self, categories: &[String]) -> Result<(), Failure> {
        let known = &self.interface.log_categories;
        match categories.iter().find(|name| !known.contains(name)) {
            None => Ok(()),
            Some(unknown) => Err(Failure::Error(format!(
                "{unknown} is not a log category of this FMU, expected one of {}",
                known.join(", ")
            ))),
        }
    }

    /// `fmi2SetupExperiment`. An error for a start time that is not finite, a stop time before the start time, and a
    /// tolerance that is not finite and above zero.
    pub(crate) fn setup_experiment(&mut self, experiment: Experiment) -> Result<(), Failure> {
        let Experiment { start_time, stop_time, tolerance } = experiment;
        if !start_time.is_finite() {
            return Err(Failure::Error(format!("startTime is {start_time}, expected a time in s")));
        }
        if let Some(stop) = stop_time.filter(|stop| stop.is_nan() || *stop < start_time) {
            return Err(Failure::Error(format!(
                "stopTime is {stop}, expected at least startTime = {start_time}"
            )));
        }
        if let Some(value) = tolerance.filter(|value| !(*value > 0.0 && value.is_finite())) {
            return Err(Failure::Error(format!("tolerance is {value}, expected more than 0")));
        }
        self.core.experiment = experiment;
        let core = &mut self.core;
        (core.time, core.earliest, core.completed) = (start_time, start_time, start_time);
        Ok(())
    }

    /// `fmi2EnterInitializationMode`: computes the initial values.
    pub(crate) fn enter_initialization_mode(&mut self) -> Result<(), Failure> {
        self.core.state = State::InitializationMode;
        self.core.stale = true;
        self.refresh()
    }

    /// `fmi2ExitInitializationMode`.
    pub(crate) fn exit_initialization_mode(&mut self) -> Result<(), Failure> {
        self.refresh()?;
        self.core.state = match self.core.interface_type {
            InterfaceType::ModelExchange => State::EventMode,
            InterfaceType::CoSimulation => State::StepComplete,
        };
        Ok(())
    }

    /// `fmi2Terminate`.
    pub(crate) fn terminate(&mut self) {
        self.core.state = State::Terminated;
    }

    /// `fmi2Reset`: restores the state after `fmi2Instantiate`.
    pub(crate) fn reset(&mut self) -> Result<(), Failure> {
        self.core = Core::new(self.fresh.clone(), self.core.interface_type);
        self.strings.clear();
        self.fit_layout()
    }

    /// Recomputes the outputs if a value was set since the last computation; in initialization mode the initial values.
    #[inline]
    fn refresh(&mut self) -> Result<(), Failure> {
        if self.core.stale { self.recompute() } else { Ok(()) }
    }

    fn recompute(&mut self) -> Result<(), Failure> {
        let core = &mut self.core;
        match core.state {
            State::InitializationMode => {
                core.check()?;
                core.model.initialize(&core.experiment)?;
            }
            State::StepComplete | State::EventMode | State::ContinuousTimeMode => {
                core.model.update(core.time)?;
            }
            _ => {}
        }
        core.stale = false;
        Ok(())
    }

    /// Checks a communication step and the parameters. Returns the step from the present time, and the end time of this
    /// step.
    #[inline]
    fn begin_step(&mut self, start: f64, size: f64) -> Result<(Step, f64), Failure> {
        let core = &mut self.core;
        let step = communication_step(core.time, start, size)?;
        let end = start + size;
        core.before_stop(end)?;
        self.stepper.check_size(step.size)?;
        core.check()?;
        Ok((step, end))
    }

    /// `fmi2DoStep`.
    pub(crate) fn do_step(&mut self, start: f64, size: f64) -> Result<(), Failure> {
        let (step, end) = self.begin_step(start, size)?;
        let core = &mut self.core;
        match core.model.step(&step) {
            Ok(()) => {}
            Err(Failure::Unsolved) => {
                let Self { stepper, interface, .. } = self;
                stepper.run(&mut core.model, interface, &step, core.experiment.tolerance)?;
            }
            Err(failure) => return Err(failure),
        }
        core.time = end;
        core.stale = false;
        if core.sloped {
            core.sloped = false;
            self.interface.clear_input_derivatives(&mut core.model);
        }
        Ok(())
    }

    /// `fmi2GetRealStatus(fmi2LastSuccessfulTime)`.
    pub(crate) fn last_successful_time(&self) -> f64 {
        self.core.time
    }

    /// `fmi2GetBooleanStatus(fmi2Terminated)`.
    pub(crate) fn is_terminated(&self) -> bool {
        self.core.terminated
    }

    /// Returns the GUID of the model description.
    pub(crate) fn guid(&self) -> Guid {
        self.interface.guid
    }
}

/// Checks that the GUID or token that the importer read in the description is the one in the library.
fn check_guid<M: Model>(
    guid_of_library: Guid,
    what: &str,
    guid: &str,
    resources: &Path,
) -> Result<(), Failure> {
    let (name, described) = (M::IDENTIFIER, guid_of_library.to_string());
    if guid == described {
        return Ok(());
    }
    Err(Failure::Error(format!(
        "the {what} is {guid}, but this library of {name} with the resources in {} describes itself \
         with {described}",
        resources.display()
    )))
}

/// Drops `value` inside the panic fence.
fn drop_inside_fence<T>(value: T) -> Result<(), Failure> {
    guarded(|| {
        drop(value);
        Ok(())
    })
}

/// Logs a message if `selected` has its category or is `None`, or if its status must be explained.
fn log(
    callbacks: &Callbacks,
    selected: Option<&[String]>,
    status: Status,
    category: &str,
    message: &str,
) {
    let is_selected = selected.is_none_or(|names| names.iter().any(|name| name == category));
    if is_selected || callbacks.needs(status) {
        callbacks.log(status, category, message);
    }
}

/// Returns the tolerance for comparing times near `time`, in s. Importers accumulate their step size
/// with rounding errors.
fn time_tolerance(time: f64) -> f64 {
    1e-9 * time.abs().max(1.0)
}

/// Returns the step from the instance's `time` to `start + size`; an error for an invalid `start` or `size`.
///
/// If `start` differs from `time` only by rounding, the step has the given size, so that the model
/// sees equal communication steps as equal.
///
/// Section 4.2.2 requires a step size greater than zero and an end at `start + size`. A step so small
/// that `start + size` rounds to `start` is an error: importers continue after `fmi2OK`, some (FMPy)
/// also after `fmi2Discard`, and the time would never advance.
#[inline]
fn communication_step(time: f64, start: f64, size: f64) -> Result<Step, Failure> {
    if !(0.0 < size && size < f64::INFINITY) {
        return Err(Failure::Error(format!(
            "communicationStepSize is {size} s, expected more than 0"
        )));
    }
    let mismatch = start - time;
    if mismatch.is_nan() || mismatch.abs() > time_tolerance(time) {
        return Err(Failure::Error(format!(
            "currentCommunicationPoint is {start} s, but the instance is at {time} s"
        )));
    }
    let rounding = 8.0 * f64::EPSILON * time.abs().max(start.abs());
    let step = if mismatch.abs() <= rounding {
        Step { start, size }
    } else {
        Step { start: time, size: mismatch + size }
    };
    let ends_later = start + size > time && step.size > 0.0;
    // A size above `rounding` is also above the distance from `start` to the next number.
    let is_resolved = size > rounding || size >= start.next_up() - start;
    if !(ends_later && is_resolved) {
        return Err(step_too_small(time, start, size));
    }
    Ok(step)
}

#[cold]
fn step_too_small(time: f64, start: f64, size: f64) -> Failure {
    let smallest = start.max(time).next_up() - start;
    Failure::Error(format!(
        "communicationStepSize is {size:e} s, too small at currentCommunicationPoint = {start} s: \
         the instance is at {time} s, and the smallest step to a later time is {smallest:e} s"
    ))
}
