//! Errors of a system and of a simulation.

use fmu_description::number::seconds;
use slave::CallError;

/// Error of building, initialising or advancing a system.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SystemError {
    /// A name does not have the form `slave.variable`.
    #[error("{text:?} names no variable, expected the form {form}")]
    Syntax { text: String, form: &'static str },
    /// Two slaves have the same name.
    #[error("there are two FMUs of the name {name:?}, expected different names")]
    SameName { name: String },
    /// No slave has this name.
    #[error("{name}: there is no FMU of the name {slave:?}, expected one of {known}")]
    UnknownSlave { name: String, slave: String, known: String },
    /// The slave has no variable with this name.
    #[error("{name}: {model} has no variable {variable:?}{nearest}")]
    UnknownVariable {
        name: String,
        model: String,
        variable: String,
        /// Variables with a similar name, as part of a sentence.
        nearest: String,
    },
    /// The variable has the wrong causality or type.
    #[error("{name} is {actual}, expected {expected}")]
    Role { name: String, actual: String, expected: String },
    /// An input has two sources.
    #[error("{input} is connected twice, to {first} and to {second}")]
    Twice { input: String, first: String, second: String },
    /// The two ends of a connection have different units.
    #[error("{from} in {from_unit} cannot be connected to {to} in {to_unit}")]
    Unit { from: String, from_unit: String, to: String, to_unit: String },
    /// Only one end of a connection is a difference, and an offset separates their units.
    #[error(
        "{relative} in {relative_unit} is a difference (relativeQuantity) and {absolute} in \
         {absolute_unit} is not: state factor and offset of the connection"
    )]
    Relative { relative: String, relative_unit: String, absolute: String, absolute_unit: String },
    /// The two ends of a connection have different sizes.
    #[error(
        "{from} is {from_size} and {to} is {to_size}: arrays of different sizes are connected by \
         element, such as {element}"
    )]
    Size {
        from: String,
        from_size: String,
        to: String,
        to_size: String,
        /// The first element of the source if it is an array, otherwise of the target.
        element: Box<str>,
    },
    /// Two terminals do not match.
    #[error("{from} cannot be connected to {to}: {why}")]
    Terminals { from: String, to: String, why: String },
    /// A structural parameter has removed an element of an array that is connected or set.
    #[error(
        "{name} is connected or set, but does not exist with the new size of its array; set the \
         structural parameter first"
    )]
    Resized { name: String },
    /// A text cannot be parsed as a value of the variable's type.
    #[error("{name} = {value:?}: expected {expected}")]
    Value { name: String, value: String, expected: String },
    /// The standard allows nobody to set the variable.
    #[error("{name} = {value:?}: the variable is {what}, so it cannot be set")]
    NotSettable { name: String, value: String, what: &'static str },
    /// An FMU refused a setting.
    #[error("{name} = {value:?}: {source}")]
    Setting { name: String, value: String, source: CallError },
    /// An FMU replaced a value that was set.
    #[error(
        "{name}: the value {value} that was set is lost: after the initialization the FMU has \
         {actual}. The FMU ignores or replaces the value; remove the setting"
    )]
    LostSetting { name: String, value: String, actual: String },
    /// An FMU refuses to read a variable of the results and cannot be used any more.
    #[error(
        "{name} at t = {} s: {source}. An FMU must not be used after an error: exclude {name} from the results",
        seconds(*time)
    )]
    Unreadable { slave: Box<str>, name: Box<str>, time: f64, source: CallError },
    /// An FMI call for a variable failed, and the FMU cannot be used any more.
    #[error("{name} at t = {} s: {source}", seconds(*time))]
    Variable { slave: Box<str>, name: Box<str>, time: f64, source: CallError },
    /// An FMI call failed.
    #[error("{slave} at t = {} s: {source}", seconds(*time))]
    Call { slave: String, time: f64, source: CallError },
    /// The iteration of the events at a time does not end.
    #[error(
        "the events at t = {} s do not settle within {iterations} iterations: {names} still change",
        seconds(*time)
    )]
    Unsettled { time: f64, iterations: usize, names: String },
    /// A connected output or input is NaN or infinite.
    #[error("{name} is {value} at t = {} s, expected a finite number", seconds(*time))]
    NotFinite { name: String, value: f64, time: f64 },
    /// The algorithm needs a capability that an FMU lacks.
    #[error("{slave} cannot take part in {required_by}: its {lacks} is false")]
    Capability { slave: String, lacks: &'static str, required_by: String },
    /// The initial values of an algebraic loop cannot be found.
    #[error("the loop through {names} at t = {} s: {why}", seconds(*time))]
    Loop { names: String, time: f64, why: String },
    /// The iteration of a step did not converge.
    #[error(
        "the step from t = {} s over {} s cannot be solved: {why}",
        seconds(*time),
        seconds(*size)
    )]
    Coupling { time: f64, size: f64, why: String },
    /// A checkpoint cannot be resumed because a setting differs.
    #[error("the checkpoint was taken with {name} {saved}; {name} {requested} is not possible")]
    Resume { name: String, saved: String, requested: String },
    /// The error of the smallest step exceeds the tolerance.
    #[error(
        "at t = {} s the smallest step, {} s, has an error of {error:.1e} times the \
         tolerance; a larger tolerance or a smaller smallest step helps",
        seconds(*time),
        seconds(*size)
    )]
    Stuck { time: f64, size: f64, error: f64 },
    /// The steps are so small that the run cannot reach its stop time.
    #[error(
        "at t = {} s the last {steps} steps cover {length:.1e} s in total, close to the \
         smallest step of {} s each; the stop time needs {left:.0e} more of them. A larger \
         relative tolerance, a larger smallest step or fixed steps help",
        seconds(*time),
        seconds(*smallest)
    )]
    TooManySteps { steps: u32, length: f64, smallest: f64, time: f64, left: f64 },
    /// The settings of the algorithm contradict each other or the system.
    #[error("{what}")]
    Algorithm { what: String },
    /// A step size or a time of the run is invalid.
    #[error("{what} is {value} s, expected {rule}")]
    Time { what: &'static str, value: f64, rule: String },
}

/// Wraps the error of an FMI call of `slave` at `time`.
#[cold]
pub(crate) fn call(slave: &str, time: f64, source: CallError) -> SystemError {
    SystemError::Call { slave: slave.to_owned(), time, source }
}

/// Returns the error for settings that contradict each other or the system.
pub(crate) fn contradiction(what: impl Into<String>) -> SystemError {
    SystemError::Algorithm { what: what.into() }
}
