//! What the author of a model writes: the trait [`Model`] and what it receives and returns.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::variable::Variable;
use fmu_description::{DefaultExperiment, Experiment};

/// A model that can be exported as an FMU.
///
/// The struct holds everything: parameters, inputs, outputs, states. A copy of it is the FMU state
/// (`fmi2GetFMUstate`), its serialised form the serialised FMU state, so whatever decides how the
/// model continues must be a field. [`Model::variables`] says which fields the importer sees. A
/// serialised state is read by builds whose fields have the same names, types and order, and refused
/// by others.
///
/// # Life of an instance
///
/// 1. `fmi2Instantiate` calls [`Model::new`] and [`Model::variables`].
/// 2. The importer sets parameters and inputs; [`Model::check`] and [`Model::initialize`] then
///    compute the start (`fmi2EnterInitializationMode`, and again after each change until
///    `fmi2ExitInitializationMode`).
/// 3. Co-simulation: each `fmi2DoStep` calls [`Model::step`]. Where something was set since,
///    [`Model::update`] comes before the next value is read.
/// 4. Model exchange, for models with [`Model::model_exchange`]: the importer integrates. It sets
///    time, states and inputs; [`Model::update`] comes before it reads a value, a derivative or
///    an event indicator ([`Model::event_indicators`]); `fmi2NewDiscreteStates` calls
///    [`Model::event`].
/// 5. `fmi2GetDirectionalDerivative` calls [`Model::differentiate`], for models that have it.
/// 6. `fmi2Reset` puts back the struct that [`Model::new`] returned.
pub trait Model: Clone + Send + Serialize + DeserializeOwned + 'static {
    /// `modelIdentifier` and `modelName`: a C identifier, the name of the library in the FMU.
    const IDENTIFIER: &'static str;

    /// `providesDirectionalDerivative`: whether [`Model::differentiate`] is written.
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = false;

    /// The general part of the model description.
    fn about(&self) -> About;

    /// The model as instantiated; its field values are the start values of the description.
    ///
    /// `resources` is the FMU's `resources` folder. Where the importer names none, it is a path at which
    /// nothing can be read, and an error of this function becomes one about `fmuResourceLocation`.
    ///
    /// # Errors
    ///
    /// When something in `resources` is missing or wrong.
    fn new(resources: &Path) -> Result<Self, Failure>;

    /// The variables in the order of the description. Value references follow from the position.
    fn variables(&self) -> Vec<Variable<Self>>;

    /// Whether the parameters make sense, one by one and together.
    ///
    /// Called before [`Model::initialize`], and before a step or an event when a parameter was set
    /// since.
    ///
    /// # Errors
    ///
    /// A message that names the parameter, its value and the rule.
    fn check(&self) -> Result<(), Failure> {
        Ok(())
    }

    /// Computes states and outputs at the start time from parameters and inputs.
    ///
    /// In initialization mode the importer may set and read in turn, so this may be called several
    /// times and must not depend on the result of an earlier call. Variables with a start value
    /// ([`Variable::exact`]) are left as they are. As it is, it calls [`Model::update`].
    ///
    /// # Errors
    ///
    /// When the model cannot start from these values.
    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        self.update(experiment.start_time)
    }

    /// Advances from `step.start` to `step.end()` (co-simulation).
    ///
    /// # Errors
    ///
    /// [`Failure::Incomplete`] or [`Failure::Terminated`] where the model stopped before the end,
    /// any other where not even that is known.
    fn step(&mut self, step: &Step) -> Result<(), Failure>;

    /// Recomputes what depends directly on inputs, tunable parameters and, in model exchange, on
    /// states and time, as the fields stand: outputs and derivatives of states. What changes at
    /// events only stays as it is.
    ///
    /// # Errors
    ///
    /// [`Failure::Discard`] where the equations have no value at these states.
    fn update(&mut self, time: f64) -> Result<(), Failure> {
        let _ = time;
        Ok(())
    }

    /// Directional derivatives `dv_unknown = (dh/dv_known) dv_known` of `v_unknown = h(v_known)`
    /// (section 2.1.9), at the values that the fields have now.
    ///
    /// `direction` is a struct in which the field of each Real variable holds its component of the
    /// direction: on entry `dv_known` in the fields of the knowns and zero in all others; on
    /// return `dv_unknown` in the fields of the unknowns. Its other fields have values of an
    /// earlier moment and mean nothing. [`At::Initialization`]: the unknowns are the initial values of outputs, states and
    /// derivatives, the knowns inputs and variables with an exact start value. [`At::Point`]: the
    /// unknowns are the outputs and the derivatives of the states, the knowns inputs and states.
    /// A field that is both (a state that is an output) keeps what it holds.
    ///
    /// # Errors
    ///
    /// [`Failure::Error`] where there is no derivative: the function may not discard.
    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        let _ = (at, direction);
        Err(Failure::Error("providesDirectionalDerivative is false".to_owned()))
    }

    /// What `fmi2ModelExchange` needs beyond the variables; `None` for co-simulation only.
    ///
    /// The continuous states are the variables that another one is the derivative of
    /// ([`Variable::derivative_of`]), in the order of those derivatives.
    fn model_exchange(&self) -> Option<ModelExchange> {
        None
    }

    /// `fmi2GetEventIndicators`: a state event happens where one of them changes from positive to
    /// not positive or back. Of the order of one, and not zero right after an event (section 3.2.2).
    ///
    /// As many as [`Model::model_exchange`] says; [`Model::update`] came before.
    fn event_indicators(&self, time: f64, indicators: &mut [f64]) {
        let _ = (time, indicators);
    }

    /// `fmi2NewDiscreteStates`: recomputes at an event what changes at events only, from the fields
    /// as they stand. Called at least once before the first continuous-time mode.
    ///
    /// # Errors
    ///
    /// When the model cannot go on.
    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        let _ = time;
        Ok(Event::default())
    }
}

/// The general part of a model description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// What the model is, in one sentence.
    pub description: String,
    /// Who wrote it.
    pub author: String,
    /// Version of the model.
    pub version: String,
    /// Licence, an SPDX expression.
    pub license: String,
    /// The experiment that an importer runs when it is told nothing else.
    pub default_experiment: DefaultExperiment,
}

/// What model exchange needs beyond the variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelExchange {
    /// `numberOfEventIndicators`.
    pub event_indicators: usize,
}

/// What happened at an event: `fmi2EventInfo` of `fmi2NewDiscreteStates` (section 3.2.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Event {
    /// `newDiscreteStatesNeeded`: the event is not finished, one more call is needed.
    pub new_discrete_states_needed: bool,
    /// `terminateSimulation`, with the reason.
    pub terminate_simulation: Option<String>,
    /// `valuesOfContinuousStatesChanged`.
    pub values_of_continuous_states_changed: bool,
    /// `nextEventTime` in s, where defined.
    pub next_event_time: Option<f64>,
}

/// Where derivatives are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// In initialization mode: of the initial values.
    Initialization,
    /// At a communication point, or between integration steps.
    Point {
        /// The time in s.
        time: f64,
        /// The component of the direction that belongs to time.
        delta_time: f64,
    },
}

/// One communication step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Time at the begin, in s.
    pub start: f64,
    /// Length in s: at least the distance from `start` to the next number of 64 bits.
    pub size: f64,
}

impl Step {
    /// Time at the end, in s.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.start + self.size
    }
}

/// Why a call did not do what it was asked; the message reaches the importer's logger.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// `fmi2Discard`: refused, the instance is as before. From functions that may not discard
    /// (section 2.1.3: initialization, events, directional derivatives) `fmi2Error`.
    #[error("{0}")]
    Discard(String),
    /// `fmi2Discard` of `fmi2DoStep`: the model reached `time` (in s) and no further.
    #[error("stopped at t = {time} s: {message}")]
    Incomplete {
        /// Last time reached, in s.
        time: f64,
        /// The reason.
        message: String,
    },
    /// `fmi2Discard` of `fmi2DoStep` with `fmi2Terminated`: the model reached `time` (in s) and wants
    /// the simulation to end there.
    #[error("the simulation ends at t = {time} s: {message}")]
    Terminated {
        /// Last time reached, in s.
        time: f64,
        /// The reason.
        message: String,
    },
    /// `fmi2Error`: the instance can be read, reset, restored and freed, nothing else.
    #[error("{0}")]
    Error(String),
    /// `fmi2Fatal`: the instance is lost.
    #[error("{0}")]
    Fatal(String),
}
