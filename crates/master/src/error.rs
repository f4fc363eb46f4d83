//! Errors of a system and of a simulation.

use fmu_description::number::seconds;
use slave::CallError;

/// Error of building, initialising or advancing a system.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SystemError {
    /// A name does not have the form `slave.variable`.
    #[error("{text:?} names no variable, expected the form {form}")]
    Syntax {
        /// The name found.
        text: String,
        /// The form expected.
        form: &'static str,
    },
    /// Two slaves have the same name.
    #[error("there are two FMUs of the name {name:?}, expected different names")]
    SameName {
        /// The name of both slaves.
        name: String,
    },
    /// No slave has this name.
    #[error("{name}: there is no FMU of the name {slave:?}, expected one of {known}")]
    UnknownSlave {
        /// The whole name.
        name: String,
        /// The part of the name that should be a slave.
        slave: String,
        /// The names of the slaves that exist.
        known: String,
    },
    /// The slave has no variable with this name.
    #[error("{name}: {model} has no variable {variable:?}{nearest}")]
    UnknownVariable {
        /// The whole name.
        name: String,
        /// `modelName` of the FMU.
        model: String,
        /// The part of the name after the slave.
        variable: String,
        /// Variables with a similar name, as part of a sentence.
        nearest: String,
    },
    /// The variable has the wrong causality or type.
    #[error("{name} is {actual}, expected {expected}")]
    Role {
        /// The variable, as `slave.variable`.
        name: String,
        /// The causality or type of the variable.
        actual: String,
        /// The causality or type expected.
        expected: String,
    },
    /// An input has two sources.
    #[error("{input} is connected twice, to {first} and to {second}")]
    Twice {
        /// The input, as `slave.variable`.
        input: String,
        /// The output that is connected to the input.
        first: String,
        /// A second output that should be connected to the input.
        second: String,
    },
    /// The two ends of a connection have different units.
    #[error("{from} in {from_unit} cannot be connected to {to} in {to_unit}")]
    Unit {
        /// The output, as `slave.variable`.
        from: String,
        /// The unit of the output.
        from_unit: String,
        /// The input, as `slave.variable`.
        to: String,
        /// The unit of the input.
        to_unit: String,
    },
    /// Only one end of a connection is a difference, and an offset separates their units.
    #[error(
        "{relative} in {relative_unit} is a difference (relativeQuantity) and {absolute} in \
         {absolute_unit} is not: state factor and offset of the connection"
    )]
    Relative {
        /// The end of the connection that is a difference.
        relative: String,
        /// The unit of the end that is a difference.
        relative_unit: String,
        /// The end of the connection that is no difference.
        absolute: String,
        /// The unit of the end that is no difference.
        absolute_unit: String,
    },
    /// The two ends of a connection have different sizes.
    #[error(
        "{from} is {from_size} and {to} is {to_size}: arrays of different sizes are connected by \
         element, such as {element}"
    )]
    Size {
        /// The source of the connection, as `slave.variable`.
        from: String,
        /// The size of the source.
        from_size: String,
        /// The target of the connection, as `slave.variable`.
        to: String,
        /// The size of the target.
        to_size: String,
        /// The first element of the source if it is an array, otherwise of the target.
        element: Box<str>,
    },
    /// Two terminals do not match.
    #[error("{from} cannot be connected to {to}: {why}")]
    Terminals {
        /// The first terminal, as `slave.terminal`.
        from: String,
        /// The second terminal, as `slave.terminal`.
        to: String,
        /// The difference between the terminals, as part of a sentence.
        why: String,
    },
    /// A structural parameter has removed an element of an array that is connected or set.
    #[error(
        "{name} is connected or set, but does not exist with the new size of its array; set the \
         structural parameter first"
    )]
    Resized {
        /// The removed element, as `slave.variable`.
        name: String,
    },
    /// A text cannot be parsed as a value of the variable's type.
    #[error("{name} = {value:?}: expected {expected}")]
    Value {
        /// The variable, as `slave.variable`.
        name: String,
        /// The text that states the value.
        value: String,
        /// What was expected, as part of a sentence.
        expected: String,
    },
    /// The standard allows nobody to set the variable.
    #[error("{name} = {value:?}: the variable is {what}, so it cannot be set")]
    NotSettable {
        /// The variable, as `slave.variable`.
        name: String,
        /// The text that states the value.
        value: String,
        /// What the variable is, as part of a sentence.
        what: &'static str,
    },
    /// An FMU refused a setting.
    #[error("{name} = {value:?}: {source}")]
    Setting {
        /// The variable, as `slave.variable`.
        name: String,
        /// The text that states the value.
        value: String,
        /// Function, status and messages.
        source: CallError,
    },
    /// An FMU replaced a value that was set.
    #[error(
        "{name}: the value {value} that was set is lost: after the initialization the FMU has \
         {actual}. The FMU ignores or replaces the value; remove the setting"
    )]
    LostSetting {
        /// The variable, as `slave.variable`.
        name: String,
        /// The text that states the value.
        value: String,
        /// The value in the FMU after the initialization.
        actual: String,
    },
    /// An FMU refuses to read a variable of the results and cannot be used any more.
    #[error(
        "{name} at t = {} s: {source}. An FMU must not be used after an error: exclude {name} from the results",
        seconds(*time)
    )]
    Unreadable {
        /// The slave.
        slave: Box<str>,
        /// The variable, as `slave.variable`.
        name: Box<str>,
        /// Time of the master in s.
        time: f64,
        /// Function, status and messages.
        source: CallError,
    },
    /// An FMI call for a variable failed, and the FMU cannot be used any more.
    #[error("{name} at t = {} s: {source}", seconds(*time))]
    Variable {
        /// The slave.
        slave: Box<str>,
        /// The variable, as `slave.variable`.
        name: Box<str>,
        /// Time of the master in s.
        time: f64,
        /// Function, status and messages.
        source: CallError,
    },
    /// An FMI call failed.
    #[error("{slave} at t = {} s: {source}", seconds(*time))]
    Call {
        /// The slave.
        slave: String,
        /// Time of the master in s.
        time: f64,
        /// Function, status and messages.
        source: CallError,
    },
    /// The iteration of the events at a time does not end.
    #[error(
        "the events at t = {} s do not settle within {iterations} iterations: {names} still change",
        seconds(*time)
    )]
    Unsettled {
        /// Time in s.
        time: f64,
        /// Number of iterations.
        iterations: usize,
        /// The variables that still change.
        names: String,
    },
    /// A connected output or input is NaN or infinite.
    #[error("{name} is {value} at t = {} s, expected a finite number", seconds(*time))]
    NotFinite {
        /// The output or input, as `slave.variable`.
        name: String,
        /// The value, NaN or infinite.
        value: f64,
        /// Time of the master in s.
        time: f64,
    },
    /// The algorithm needs a capability that an FMU lacks.
    #[error("{slave} cannot take part in {required_by}: its {lacks} is false")]
    Capability {
        /// Name of the slave.
        slave: String,
        /// The capability flag that is false.
        lacks: &'static str,
        /// The function of the master that needs the capability.
        required_by: String,
    },
    /// The initial values of an algebraic loop cannot be found.
    #[error("the loop through {names} at t = {} s: {why}", seconds(*time))]
    Loop {
        /// The outputs.
        names: String,
        /// Time of the master in s.
        time: f64,
        /// How the iteration ended.
        why: String,
    },
    /// The iteration of a step did not converge.
    #[error(
        "the step from t = {} s over {} s cannot be solved: {why}",
        seconds(*time),
        seconds(*size)
    )]
    Coupling {
        /// Start of the step in s.
        time: f64,
        /// Size of the step in s.
        size: f64,
        /// How the iteration ended.
        why: String,
    },
    /// A checkpoint cannot be resumed because a setting differs.
    #[error("the checkpoint was taken with {name} {saved}; {name} {requested} is not possible")]
    Resume {
        /// Name of the setting.
        name: String,
        /// Value of the setting in the run of the checkpoint.
        saved: String,
        /// Value of the setting in the new run.
        requested: String,
    },
    /// The error of the smallest step exceeds the tolerance.
    #[error(
        "at t = {} s the smallest step, {} s, has an error of {error:.1e} times the \
         tolerance; a larger tolerance or a smaller smallest step helps",
        seconds(*time),
        seconds(*size)
    )]
    Stuck {
        /// Start of the step in s.
        time: f64,
        /// Size of the step in s.
        size: f64,
        /// Error of the step as a multiple of the tolerance.
        error: f64,
    },
    /// The steps are so small that the run cannot reach its stop time.
    #[error(
        "at t = {} s the last {steps} steps cover {length:.1e} s in total, close to the \
         smallest step of {} s each; the stop time needs {left:.0e} more of them. A larger \
         relative tolerance, a larger smallest step or fixed steps help",
        seconds(*time),
        seconds(*smallest)
    )]
    TooManySteps {
        /// Number of steps in the observed interval.
        steps: u32,
        /// Total length in s of the steps of this interval.
        length: f64,
        /// Smallest step in s.
        smallest: f64,
        /// Time reached in s.
        time: f64,
        /// Estimated number of remaining steps.
        left: f64,
    },
    /// The settings of the algorithm contradict each other or the system.
    #[error("{what}")]
    Algorithm {
        /// Description of the contradiction.
        what: String,
    },
    /// A step size or a time of the run is invalid.
    #[error("{what} is {value} s, expected {rule}")]
    Time {
        /// Name of the quantity.
        what: &'static str,
        /// Value of the quantity.
        value: f64,
        /// The condition that the value must satisfy.
        rule: String,
    },
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
