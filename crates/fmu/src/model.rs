//! The trait [`Model`], which the author of a model implements, with its argument and return types.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::log::Log;
use crate::variable::Variable;
use fmu_description::{DefaultExperiment, Experiment};

/// A model that can be exported as an FMU.
///
/// The struct holds parameters, inputs, outputs and states. A copy of it is the FMU state
/// (`fmi2GetFMUstate`), its serialised form the serialised FMU state, so everything that determines
/// the further simulation must be a field. [`Model::variables`] declares the fields that the importer
/// sees. Only a build whose fields have the same names, types and order accepts a serialised state.
///
/// # Life of an instance
///
/// 1. `fmi2Instantiate` calls [`Model::new`] and [`Model::variables`].
/// 2. The importer sets parameters and inputs; [`Model::check`] and [`Model::initialize`] then
///    compute the initial values (`fmi2EnterInitializationMode`, and again after each change until
///    `fmi2ExitInitializationMode`).
/// 3. Co-simulation: each `fmi2DoStep` calls [`Model::step`] or, without an implementation, integrates
///    the equations. If a value was set since, [`Model::update`] runs before the next value is read.
/// 4. Model exchange, if [`Model::model_exchange`] returns `Some`: the importer integrates. It sets
///    time, states and inputs; [`Model::update`] runs before it reads a value, a derivative or
///    an event indicator ([`Model::event_indicators`]); `fmi2NewDiscreteStates` calls
///    [`Model::event`].
/// 5. `fmi2GetDirectionalDerivative` calls [`Model::differentiate`], if the model implements it.
/// 6. `fmi2Reset` restores the struct that [`Model::new`] returned.
pub trait Model: Clone + Send + Serialize + DeserializeOwned + 'static {
    /// `modelIdentifier` and `modelName`: a C identifier, the name of the library in the FMU.
    const IDENTIFIER: &'static str;

    /// `providesDirectionalDerivative`: whether the model implements [`Model::differentiate`].
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = false;

    /// The log categories of the model's own messages, pairs of name and description, in addition to the categories
    /// that every exported FMU has. See [`Log::info`].
    const LOG_CATEGORIES: &'static [(&'static str, &'static str)] = &[];

    /// Returns the general part of the model description.
    fn about(&self) -> About;

    /// Creates the model as instantiated; its field values are the start values of the description.
    ///
    /// `resources` is the FMU's `resources` folder. If the importer names no folder, `resources` is a path at which
    /// nothing can be read, and the message of an error adds that `fmuResourceLocation` is missing.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if a file in `resources` is missing or wrong.
    fn new(resources: &Path) -> Result<Self, Failure>;

    /// Returns the variables in the order of the description. Their positions determine the value
    /// references.
    fn variables(&self) -> Vec<Variable<Self>>;

    /// Checks the parameters, each alone and all together.
    ///
    /// Called before [`Model::initialize`], and before a step or an event if a parameter was set
    /// since.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] with the parameter, its value and the rule that it breaks.
    fn check(&self) -> Result<(), Failure> {
        Ok(())
    }

    /// Gives the arrays the extents that the structural parameters state ([`Variable::structural`]).
    ///
    /// Called when the importer leaves configuration mode or reconfiguration mode (FMI 3.0.2, sections 2.3.6 and
    /// 2.3.7). Afterwards [`Model::variables`] runs again and must return the same arrays and scalars in the same
    /// order, with the new number of elements. The elements have the values that this function assigns, until the
    /// importer sets other values. The default implementation does nothing.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the extents do not fit together.
    fn resize(&mut self) -> Result<(), Failure> {
        Ok(())
    }

    /// Computes states and outputs at the start time from parameters and inputs.
    ///
    /// In initialization mode the importer may set and read values alternately, so this function may be called several
    /// times and must not depend on the result of an earlier call. The function must not change variables with a start
    /// value ([`Variable::exact`]). The default implementation calls [`Model::update`].
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the model cannot start from these values.
    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.update(experiment.start_time)
    }

    /// Advances the model from `step.start` to `step.end()` (co-simulation).
    ///
    /// The default implementation returns [`Failure::Unsolved`]. The exporter then advances the model by its equations,
    /// as an importer does in model exchange: it integrates the continuous states ([`Variable::derivative_of`]) with
    /// the derivatives that [`Model::update`] computes, by the [`Integrator`](crate::solver::Integrator) and with the
    /// importer's tolerance (default: the tolerance of [`About::default_experiment`], or 1e-6). The integration stops
    /// at state events ([`Model::event_indicators`]), located to the resolution of time, and at time events
    /// ([`Event::next_event_time`]). At each event, and at the start of each communication step, the exporter calls
    /// [`Model::event`] until no new discrete states are needed. In between, inputs with derivatives follow their
    /// polynomials. A model without states needs no step either: only its events happen, and `update` runs at the end.
    ///
    /// The longest step is 1e7 times the step size of the default experiment (1 s if it states none), and at most 1e7
    /// times the interval of each periodic clock; the exporter discards a longer one.
    ///
    /// # Errors
    ///
    /// [`Failure::Incomplete`] or [`Failure::Terminated`] if the model stopped before the end at a known
    /// time, another failure if the time reached is unknown.
    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let _ = step;
        Err(Failure::Unsolved)
    }

    /// Advances the model from `step.start` to `step.end()` or to its first event, whose time in s it
    /// returns (co-simulation of FMI 3.0 with event mode and early return, section 4.2.1). An event at the
    /// start of the step is not reported again.
    ///
    /// The importer then handles the event ([`Model::event`]) and asks for the next step from there. The
    /// default implementation calls [`Model::step`], and reports no event.
    ///
    /// # Errors
    ///
    /// Same as [`Model::step`].
    fn step_to_event(&mut self, step: &Step) -> Result<Option<f64>, Failure> {
        self.step(step).map(|()| None)
    }

    /// Recomputes the outputs and the derivatives of the states from the present values of inputs, parameters and, in
    /// model exchange, states and `time` (in s). The function must not change variables that change at events only. The
    /// default implementation does nothing.
    ///
    /// # Errors
    ///
    /// [`Failure::Discard`] if the equations have no solution at these states.
    fn update(&mut self, time: f64) -> Result<(), Failure> {
        let _ = time;
        Ok(())
    }

    /// Computes the directional derivative `dv_unknown = (dh/dv_known) dv_known` of
    /// `v_unknown = h(v_known)` (section 2.1.9) at the present values of the fields.
    ///
    /// `direction` is a struct in which the field of each Real variable holds its component of the direction: on entry
    /// `dv_known` in the fields of the knowns and zero in all other fields; on return `dv_unknown` in the fields of the
    /// unknowns. Other fields of `direction` hold old values; ignore these.
    ///
    /// * [`At::Initialization`]: the unknowns are the initial values of outputs, states and derivatives;
    ///   the knowns are inputs and variables with an exact start value.
    /// * [`At::Point`]: the unknowns are the outputs and the derivatives of the states; the knowns are
    ///   inputs and states.
    ///
    /// A field that is both unknown and known (a state that is an output) keeps its value.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the derivative does not exist. `fmi2Discard` is not allowed here.
    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        let _ = (at, direction);
        Err(Failure::Error("providesDirectionalDerivative is false".to_owned()))
    }

    /// Returns the properties of the model exchange interface; `None` for co-simulation only.
    ///
    /// The continuous states are the variables that have a derivative ([`Variable::derivative_of`]), in
    /// the order of the derivatives.
    fn model_exchange(&self) -> Option<ModelExchange> {
        None
    }

    /// `fmi2GetEventIndicators`: computes the event indicators z. A state event occurs when an indicator
    /// changes between z > 0 and z <= 0 (section 3.2.2). Indicators should have a magnitude of about 1
    /// and must not be zero directly after an event.
    ///
    /// Their number is [`ModelExchange::event_indicators`]. [`Model::update`] was called before.
    fn event_indicators(&self, time: f64, indicators: &mut [f64]) {
        let _ = (time, indicators);
    }

    /// `fmi2NewDiscreteStates`: handles an event at `time` (in s), that is, recomputes the variables that
    /// change at events only. Called at least once before the first continuous-time mode.
    ///
    /// Importers and the default [`Model::step`] may call it when nothing has happened, and several times at one time.
    /// The function must therefore decide from the values of the fields what to change. If there are clocked variables
    /// ([`Variable::clocked_by`]), the exporter also calls the function to read values while a clock ticks, and then
    /// restores the model.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] if the model cannot continue.
    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        let _ = time;
        Ok(Event::default())
    }

    /// Sets the fields of the triggered clocks that tick in the event at `time` (in s), and that are no inputs
    /// ([`Variable::triggered_clock`]). The fields are false before and after the event.
    ///
    /// Called when event mode starts, when the importer has set clocks or variables, and when discrete states are updated
    /// again, each time before [`Model::event`]. The function therefore sets the fields to true or false. The default
    /// implementation does nothing.
    fn tick(&mut self, time: f64) {
        let _ = time;
    }

    /// Completes a state that was read from bytes: copies from `current`, the model of the instance, the fields that
    /// are not serialised because they follow from the files of the FMU. The default implementation does nothing.
    fn complete(&mut self, current: &Self) {
        let _ = current;
    }

    /// Returns the field with the messages of the model; `None` if the model has no messages. The exporter sends the
    /// messages to the importer after each call.
    fn log(&mut self) -> Option<&mut Log> {
        None
    }
}

/// The general part of a model description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// Description of the model in one sentence.
    pub description: String,
    /// Author of the model.
    pub author: String,
    /// Version of the model.
    pub version: String,
    /// Licence, an SPDX expression.
    pub license: String,
    /// The experiment that an importer runs by default.
    pub default_experiment: DefaultExperiment,
}

/// Properties of the model exchange interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelExchange {
    /// `numberOfEventIndicators`.
    pub event_indicators: usize,
}

/// The result of an event: `fmi2EventInfo` of `fmi2NewDiscreteStates` (section 3.2.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Event {
    /// `newDiscreteStatesNeeded`: the event iteration needs another call.
    pub new_discrete_states_needed: bool,
    /// `terminateSimulation`, with the reason.
    pub terminate_simulation: Option<String>,
    /// `valuesOfContinuousStatesChanged`.
    pub values_of_continuous_states_changed: bool,
    /// `nextEventTime` in s, where defined.
    pub next_event_time: Option<f64>,
}

/// The point at which [`Model::differentiate`] computes derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// Initialization mode: derivatives of the initial values.
    Initialization,
    /// A communication point, or a point between integration steps.
    Point {
        /// The time in s.
        time: f64,
        /// The component of the direction along time, in s.
        delta_time: f64,
    },
}

/// One communication step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Time at the start, in s.
    pub start: f64,
    /// Size in s: large enough that `start + size > start` in double precision.
    pub size: f64,
}

impl Step {
    /// Returns the time at the end, in s.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.start + self.size
    }
}

/// The failure of a call, with a message for the importer's logger.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum Failure {
    /// `fmi2Discard`: the call was rejected; the instance is unchanged. Becomes `fmi2Error` in functions
    /// that must not return `fmi2Discard` (section 2.1.3: initialization, events, directional
    /// derivatives).
    #[error("{0}")]
    Discard(String),
    /// `fmi2Discard` from `fmi2DoStep`: the step ended early at `time` (in s).
    #[error("stopped at t = {time} s: {message}")]
    Incomplete { time: f64, message: String },
    /// `fmi2Discard` from `fmi2DoStep` with `fmi2Terminated`: the model reached `time` (in s) and
    /// requests the end of the simulation.
    #[error("the simulation ends at t = {time} s: {message}")]
    Terminated { time: f64, message: String },
    /// The model implements no step of its own, at all or for this step, and has not changed: the exporter integrates
    /// its equations. Only [`Model::step`] and [`Model::step_to_event`] return this failure.
    #[error("the model has no step of its own; fmu::Simulation integrates its equations")]
    Unsolved,
    /// `fmi2Error`: the instance can only be read, reset, restored to a saved state, or freed.
    #[error("{0}")]
    Error(String),
    /// `fmi2Fatal`: the instance cannot be used any more.
    #[error("{0}")]
    Fatal(String),
}
