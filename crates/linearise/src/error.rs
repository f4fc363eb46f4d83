//! The errors of a linearisation.

use fmu_import::FmuError;
use slave::CallError;

/// Why an FMU cannot be linearised; `model` is its `modelName`.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the message says what its fields are")]
#[non_exhaustive]
pub enum LineariseError {
    /// The FMU cannot be read or instantiated.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The FMU has no variable of this name.
    #[error("{model} has no variable {name:?}{nearest}")]
    UnknownVariable {
        model: String,
        name: String,
        /// Variables of a similar name, as part of a sentence.
        nearest: String,
    },
    /// The variable does not fit its role: a state, an input, an output or a setting of the operating point.
    #[error("{name} is {actual}, expected {expected}")]
    Role { name: String, actual: String, expected: &'static str },
    /// A list names a variable twice.
    #[error("{name} is named twice among the {list}")]
    Twice { name: String, list: &'static str },
    /// A list that needs at least one variable is empty.
    #[error(
        "the request names no {list}; linearisation by steps from an FMU state needs at least one"
    )]
    Empty { list: &'static str },
    /// A number of the request is invalid.
    #[error("{what} is {value}, expected {expected}")]
    Number { what: String, value: f64, expected: &'static str },
    /// The text is not a value of the variable's type.
    #[error("{name} = {text:?}: expected {expected}")]
    Value { name: String, text: String, expected: String },
    /// The FMU refuses a value.
    #[error("{name} = {value}: {source}")]
    Refused { name: String, value: String, source: CallError },
    /// An event changes a state that the operating point prescribes.
    #[error("{name} cannot be held at {required}: an event of the FMU makes it {actual}")]
    Moved { name: String, required: f64, actual: f64 },
    /// A function of the FMU failed.
    #[error(transparent)]
    Call(#[from] CallError),
    /// The FMU ends the simulation at the operating point.
    #[error("the FMU ends the simulation at the operating point (terminateSimulation)")]
    Ended,
    /// Events do not end.
    #[error("the events do not end: {iterations} times fmi2NewDiscreteStates")]
    EndlessEvents { iterations: usize },
    /// A value of the FMU is NaN or infinite.
    #[error("{name} is {value}, expected a finite number")]
    NotFinite { name: String, value: f64 },
    /// The model description contradicts itself.
    #[error("ModelStructure: {text}")]
    Structure {
        /// The contradiction, in a sentence.
        text: String,
    },
    /// The FMU cannot serve as the plant in an estimator.
    #[error("no estimator can carry {model}: it lacks {what}")]
    Unsuited { model: String, what: &'static str },
    /// The FMU has no continuous state.
    #[error("{model} has no continuous states: there is nothing to control")]
    NoStates { model: String },
    /// A state that is left out influences a remaining state or output.
    #[error("the state {left_out} may not be left out: {dependent} depends on it")]
    Coupled { left_out: String, dependent: String },
    /// The FMU offers none of the three methods.
    #[error(
        "{model} can be linearised in none of the three ways: it offers neither directional \
         derivatives (providesDirectionalDerivative), nor model exchange, nor saved FMU states \
         (canGetAndSetFMUstate)"
    )]
    NoWay { model: String },
    /// The third method needs the names of the states, and the request has none.
    #[error(
        "{model} is linearised by steps from an FMU state, but its description does not list its \
         states: name the variables that are its states{candidates}"
    )]
    StatesNotNamed {
        model: String,
        /// Candidates: outputs and local variables that can be read, as part of a sentence.
        candidates: String,
    },
    /// The FMU states no communication step, and no step that was tried gives a result.
    #[error(
        "{model} states no stepSize in its DefaultExperiment, and communication steps of {} s give no \
         result: give a communication step in s; with the first: {reason}",
        tried.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
    )]
    NoStep { model: String, tried: Vec<f64>, reason: Box<LineariseError> },
    /// Pulses of the inputs do not excite all states.
    #[error(
        "pulses of the inputs excite {rank} of {expected} directions of states and inputs; constant \
         or linearly dependent: {}",
        names.join(", ")
    )]
    Unreachable { rank: usize, expected: usize, names: Vec<String> },
    /// The variables named as states do not determine the future of the FMU.
    #[error(
        "the variables named as states do not determine how the FMU continues: the relative prediction \
         error for a new input signal is {missed:e}, allowed is {allowed:e}; name all states, take a \
         shorter step, or a point nearer to an equilibrium"
    )]
    NotStates { missed: f64, allowed: f64 },
    /// The communication steps do not determine the matrices accurately enough.
    #[error(
        "the matrices from steps of an FMU state have a relative error of {relative:e}, allowed is \
         {allowed}; take a point nearer to an equilibrium, another step, or an FMU for model exchange"
    )]
    Inaccurate { relative: f64, allowed: f64 },
    /// The step map has no real logarithm.
    #[error(
        "no continuous system corresponds to the FMU's steps of {step} s: the step map has no real \
         logarithm; take a shorter step; a sampled FMU cannot be linearised this way"
    )]
    NoLogarithm { step: f64 },
}
