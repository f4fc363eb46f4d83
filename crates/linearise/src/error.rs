//! Why an FMU cannot be linearised as asked.

use fmu_import::FmuError;
use slave::CallError;

/// Why an FMU cannot be linearised as asked.
#[derive(Debug, thiserror::Error)]
pub enum LineariseError {
    /// The FMU cannot be instantiated.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// There is no variable of that name.
    #[error("{model} has no variable {name:?}{nearest}")]
    UnknownVariable {
        /// `modelName` of the FMU.
        model: String,
        /// The name.
        name: String,
        /// Variables of a similar name, as part of a sentence.
        nearest: String,
    },
    /// The variable cannot have this part.
    #[error("{name} is {found}, expected {expected}")]
    Role {
        /// The variable.
        name: String,
        /// What it is.
        found: String,
        /// What the part needs.
        expected: &'static str,
    },
    /// A variable is named twice in one list.
    #[error("{name} is named twice among the {list}")]
    Twice {
        /// The variable.
        name: String,
        /// The list.
        list: &'static str,
    },
    /// A list that must name something is empty: there is nothing to give a pulse to.
    #[error("no {list} are named, steps from an FMU state need at least one")]
    Empty {
        /// The list.
        list: &'static str,
    },
    /// A number of the request makes no sense.
    #[error("{what} is {value}, expected {expected}")]
    Number {
        /// Which one.
        what: String,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// A text is no value of the variable.
    #[error("{name} = {text:?}: expected {expected}")]
    Value {
        /// The variable.
        name: String,
        /// The text.
        text: String,
        /// What can be read.
        expected: String,
    },
    /// The FMU refuses a value.
    #[error("{name} = {value}: {source}")]
    Refused {
        /// The variable.
        name: String,
        /// The value.
        value: String,
        /// Function, status and messages.
        source: CallError,
    },
    /// An event takes a state away from the value asked for.
    #[error("{name} cannot be held at {wanted}: an event of the FMU makes it {found}")]
    Moved {
        /// The state.
        name: String,
        /// The value asked for.
        wanted: f64,
        /// The value after the event.
        found: f64,
    },
    /// A function of the FMU failed.
    #[error(transparent)]
    Call(#[from] CallError),
    /// The FMU ends the simulation at the operating point.
    #[error("the FMU ends the simulation at the operating point (terminateSimulation)")]
    Ended,
    /// The events at the operating point do not end.
    #[error(
        "the events at the operating point do not end: {iterations} times fmi2NewDiscreteStates"
    )]
    EndlessEvents {
        /// Calls made.
        iterations: usize,
    },
    /// A value of the FMU is not a number.
    #[error("{name} is {value}, expected a finite number")]
    NotFinite {
        /// The quantity.
        name: String,
        /// Its value.
        value: f64,
    },
    /// The model description contradicts itself.
    #[error("ModelStructure: {text}")]
    Structure {
        /// What is wrong.
        text: String,
    },
    /// There is no continuous state.
    #[error("{model} has no continuous states: there is nothing to control")]
    NoStates {
        /// `modelName` of the FMU.
        model: String,
    },
    /// A state that is left out acts on what is kept.
    #[error("the state {left_out} may not be left out: {kept} depends on it")]
    Coupled {
        /// The state.
        left_out: String,
        /// What depends on it.
        kept: String,
    },
    /// The FMU offers none of the three ways.
    #[error(
        "{model} can be linearised in none of the three ways: it offers no directional derivatives \
         (providesDirectionalDerivative), no model exchange, and no FMU states to return to \
         (canGetAndSetFMUstate)"
    )]
    NoWay {
        /// `modelName` of the FMU.
        model: String,
    },
    /// The states must be named and are not.
    #[error(
        "{model} is linearised by steps from an FMU state, its description does not say what its \
         states are: name the variables that are its states{candidates}"
    )]
    StatesNotNamed {
        /// `modelName` of the FMU.
        model: String,
        /// Outputs and local variables that can be read, as part of a sentence.
        candidates: String,
    },
    /// No size of a communication step is known.
    #[error("{model} states no stepSize in its DefaultExperiment: give a communication step in s")]
    NoStep {
        /// `modelName` of the FMU.
        model: String,
    },
    /// Pulses of the inputs do not move all states.
    #[error(
        "pulses of the inputs reach {rank} of {expected} directions of states and inputs; at a \
         standstill or not to be told from the others: {}",
        names.join(", ")
    )]
    Unreachable {
        /// Directions reached.
        rank: usize,
        /// States and inputs.
        expected: usize,
        /// Variables without a direction of their own.
        names: Vec<String>,
    },
    /// The variables named as states do not determine what comes next.
    #[error(
        "the variables named as states do not say how the FMU goes on: a course of the inputs that \
         was not used for the fit is missed by {missed:e} of the response, allowed is {allowed:e}; \
         name all states, take a shorter step, or a point nearer to an equilibrium"
    )]
    NotStates {
        /// Largest relative difference.
        missed: f64,
        /// The largest one allowed.
        allowed: f64,
    },
    /// The steps tell too little.
    #[error(
        "steps from an FMU state give the matrices to {relative:e} only, allowed is {allowed}; \
         take a point nearer to an equilibrium, another step, or an FMU for model exchange"
    )]
    Inaccurate {
        /// The largest relative error.
        relative: f64,
        /// The largest one allowed.
        allowed: f64,
    },
    /// The step map has no real logarithm.
    #[error(
        "no continuous system has the steps of {step} s that the FMU makes: their matrix has no \
         real logarithm; take a shorter step, or the FMU is a sampled system"
    )]
    NoLogarithm {
        /// The communication step in s.
        step: f64,
    },
}
