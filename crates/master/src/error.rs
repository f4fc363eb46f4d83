//! What can be wrong with a system or a run.

use slave::CallError;

/// Why a system cannot be put together or advanced.
#[derive(Debug, thiserror::Error)]
pub enum SystemError {
    /// A text of the form `slave.variable` was expected.
    #[error("{text:?} names no variable, expected the form {form}")]
    Syntax {
        /// What was found.
        text: String,
        /// What was expected.
        form: &'static str,
    },
    /// Two slaves have one name.
    #[error("there are two FMUs of the name {name:?}, expected different names")]
    SameName {
        /// The name.
        name: String,
    },
    /// There is no slave of that name.
    #[error("{name}: there is no FMU of the name {slave:?}, expected one of {known}")]
    UnknownSlave {
        /// The whole name.
        name: String,
        /// Its first part.
        slave: String,
        /// The slaves that there are.
        known: String,
    },
    /// The slave has no variable of that name.
    #[error("{name}: {model} has no variable {variable:?}{nearest}")]
    UnknownVariable {
        /// The whole name.
        name: String,
        /// `modelName` of the FMU.
        model: String,
        /// The variable.
        variable: String,
        /// Variables of a similar name, as part of a sentence.
        nearest: String,
    },
    /// The variable cannot have this role.
    #[error("{name} is {found}, expected {expected}")]
    Role {
        /// The variable.
        name: String,
        /// Its causality or type.
        found: String,
        /// What the role needs.
        expected: String,
    },
    /// An input has two sources.
    #[error("{input} is connected twice, to {first} and to {second}")]
    Twice {
        /// The input.
        input: String,
        /// One source.
        first: String,
        /// The other source.
        second: String,
    },
    /// The two ends of a connection have different units.
    #[error("{from} in {from_unit} cannot be connected to {to} in {to_unit}")]
    Unit {
        /// The output.
        from: String,
        /// Its unit.
        from_unit: String,
        /// The input.
        to: String,
        /// Its unit.
        to_unit: String,
    },
    /// A value cannot be read as the variable's type.
    #[error("{name} = {value:?}: expected {expected}")]
    Value {
        /// The variable.
        name: String,
        /// The text.
        value: String,
        /// The type.
        expected: String,
    },
    /// An FMU refused a setting.
    #[error("{name} = {value:?}: {source}")]
    Setting {
        /// The variable.
        name: String,
        /// The text.
        value: String,
        /// Function, status and messages.
        source: CallError,
    },
    /// An FMU does not keep a setting.
    #[error(
        "{name}: the value {value} that was set is lost: after the initialization the FMU has \
         {found}; it ignores or replaces what is set, so leave the setting out"
    )]
    LostSetting {
        /// The variable.
        name: String,
        /// The text.
        value: String,
        /// What the FMU has.
        found: String,
    },
    /// A function of an FMU failed.
    #[error("{slave} at t = {time} s: {source}")]
    Call {
        /// The slave.
        slave: String,
        /// Time of the master in s.
        time: f64,
        /// Function, status and messages.
        source: CallError,
    },
    /// An output, or what a connection makes of one, is not a number.
    #[error("{name} is {value} at t = {time} s, expected a finite number")]
    NotFinite {
        /// The output.
        name: String,
        /// Its value.
        value: f64,
        /// Time of the master in s.
        time: f64,
    },
    /// The algorithm asks for what an FMU cannot do.
    #[error("{slave} cannot take part in {wanted}: its {lacks} is false")]
    Capability {
        /// The slave.
        slave: String,
        /// The flag of its model description.
        lacks: &'static str,
        /// What needs it.
        wanted: String,
    },
    /// The values of a loop cannot be found.
    #[error("the loop through {names} at t = {time} s: {why}")]
    Loop {
        /// The outputs.
        names: String,
        /// Time of the master in s.
        time: f64,
        /// How the iteration ended.
        why: String,
    },
    /// The iteration of a step finds no values that agree.
    #[error("the step from t = {time} s over {size} s cannot be solved: {why}")]
    Coupling {
        /// Begin of the step in s.
        time: f64,
        /// Its size in s.
        size: f64,
        /// How the iteration ended.
        why: String,
    },
    /// A run cannot go on from a checkpoint with another setting.
    #[error("the checkpoint was taken with {name} {taken}; {name} {given} is not possible")]
    Resume {
        /// Name of the setting.
        name: &'static str,
        /// Its value in the run of the checkpoint.
        taken: String,
        /// Its value now.
        given: String,
    },
    /// The smallest step is not small enough.
    #[error(
        "the smallest step, {size} s at t = {time} s, still has an error of {error:.1e} times the \
         tolerance"
    )]
    Stuck {
        /// Begin of the step in s.
        time: f64,
        /// Its size in s.
        size: f64,
        /// Its error in tolerances.
        error: f64,
    },
    /// The steps have become too small to get on.
    #[error(
        "at t = {time} s the last {steps} steps were {length:.1e} s long together, near the smallest \
         step of {smallest} s: {left:.0e} more would be needed to the stop time; a larger relative \
         tolerance, a larger smallest step or fixed steps help"
    )]
    Crawl {
        /// Steps that were looked at.
        steps: u32,
        /// Their length together in s.
        length: f64,
        /// Smallest step in s.
        smallest: f64,
        /// Time reached in s.
        time: f64,
        /// Steps that are left at this pace.
        left: f64,
    },
    /// The algorithm makes no sense for this system.
    #[error("{what}")]
    Algorithm {
        /// What is wrong.
        what: String,
    },
    /// The step size or the span of the run makes no sense.
    #[error("{what} is {value} s, expected {rule}")]
    Time {
        /// Which one.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: String,
    },
}
