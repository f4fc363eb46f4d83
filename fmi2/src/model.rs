//! What the author of a model writes: the trait [`Model`] and what it receives and returns.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::description::DefaultExperiment;
use crate::variable::Variable;

/// A model that can be exported as an FMU.
///
/// The struct holds everything: parameters, inputs, outputs, states. A copy of it is the FMU state
/// (`fmi2GetFMUstate`), its serialised form the serialised FMU state, so whatever decides how the
/// model continues must be a field. [`Model::variables`] says which fields the importer sees.
///
/// # Life of an instance
///
/// 1. `fmi2Instantiate` calls [`Model::new`] and [`Model::variables`].
/// 2. The importer sets parameters and inputs; [`Model::initialize`] then computes the start.
/// 3. Each `fmi2DoStep` calls [`Model::step`].
/// 4. Where something was set since, [`Model::update`] comes before the next value is read.
/// 5. `fmi2Reset` puts back the struct that [`Model::new`] returned.
pub trait Model: Clone + Send + Serialize + DeserializeOwned + 'static {
    /// `modelIdentifier` and `modelName`: a C identifier, the name of the library in the FMU.
    const IDENTIFIER: &'static str;

    /// The general part of the model description.
    fn about(&self) -> About;

    /// The model as instantiated; its field values are the start values of the description.
    ///
    /// `resources` is the FMU's `resources` folder.
    ///
    /// # Errors
    ///
    /// When something in `resources` is missing or wrong.
    fn new(resources: &Path) -> Result<Self, Failure>;

    /// The variables in the order of the description. Value references follow from the position.
    fn variables(&self) -> Vec<Variable<Self>>;

    /// Whether the parameters make sense, one by one and together.
    ///
    /// Called before [`Model::initialize`], and before a step when a parameter was set since.
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
    /// times and must not depend on the result of an earlier call.
    ///
    /// # Errors
    ///
    /// When the model cannot start from these values.
    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure>;

    /// Advances from `step.start` to `step.end()`.
    ///
    /// # Errors
    ///
    /// [`Failure::Incomplete`] where the model stopped before the end, any other where not even
    /// that is known.
    fn step(&mut self, step: &Step) -> Result<(), Failure>;

    /// Recomputes what depends directly on inputs and tunable parameters, at an unchanged time.
    fn update(&mut self) {}
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

/// What `fmi2SetupExperiment` said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, serde::Deserialize)]
pub struct Experiment {
    /// `startTime` in s.
    pub start_time: f64,
    /// `stopTime` in s, where defined: no step goes past it.
    pub stop_time: Option<f64>,
    /// `tolerance`, relative, where defined.
    pub tolerance: Option<f64>,
}

/// One communication step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Time at the begin, in s.
    pub start: f64,
    /// Length in s, greater than zero.
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
    /// `fmi2Discard`: refused, the instance is as before.
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
    /// `fmi2Error`: the instance can be read, reset, restored and freed, nothing else.
    #[error("{0}")]
    Error(String),
    /// `fmi2Fatal`: the instance is lost.
    #[error("{0}")]
    Fatal(String),
}
