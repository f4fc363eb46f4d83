//! Errors of a scenario.

use std::ops::Range;
use std::path::PathBuf;

use fmu_description::unit::UnitError;

use crate::table::TableError;
use master::SystemError;
use master::fault::FaultError;
use master::signal::TrackError;

/// An invalid entry of a scenario.
#[derive(Debug, thiserror::Error)]
#[error("{entry}: {reason}")]
pub struct ScenarioError {
    /// Range of the invalid part in bytes of the text; `0..0` if the scenario was not read from a
    /// text.
    pub place: Range<usize>,
    /// Path of the entry, such as `scenario.fault[2]`; entries count from 1.
    pub entry: String,
    /// The reason why the entry is invalid.
    pub reason: Box<Reason>,
}

/// The reason why an entry is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Reason {
    /// A slave or a variable does not exist.
    #[error(transparent)]
    Name(#[from] SystemError),
    /// The variable cannot be set during the run.
    #[error("{name} is {actual}, expected an input or a tunable parameter")]
    NotSettable {
        /// The variable, as `slave.variable`.
        name: String,
        /// Causality and variability of the variable.
        actual: String,
    },
    /// The input already has a source.
    #[error(
        "{name} is connected to {source_name} and gets its values from there; a fault on this \
         connection can hold another one: stuck = {{ value = .. }}"
    )]
    Connected {
        /// The input, as `slave.variable`.
        name: String,
        /// The output to which the input is connected.
        source_name: String,
    },
    /// Two entries drive the same variable.
    #[error("{name} is driven twice, also by {first}")]
    Twice {
        /// The variable, as `slave.variable`.
        name: String,
        /// Path of the first entry that drives the variable.
        first: String,
    },
    /// A fault is stated for a variable without a connection and without a signal.
    #[error("{name} is {actual}, expected a connected input, or one that a signal drives")]
    NoConnection {
        /// The variable, as `slave.variable`.
        name: String,
        /// The kind of the variable.
        actual: &'static str,
    },
    /// The input has another source than stated.
    #[error("{target} is connected to {actual}, expected {stated}")]
    OtherSource {
        /// The input, as `slave.variable`.
        target: String,
        /// The source of the input.
        actual: String,
        /// The source that the entry states.
        stated: String,
    },
    /// An entry does not have exactly one kind.
    #[error("found {}, expected exactly one of {expected}", listed(actual))]
    Kinds {
        /// The kinds that the entry states.
        actual: Vec<&'static str>,
        /// The kinds from which an entry must state exactly one.
        expected: &'static str,
    },
    /// The kind does not fit the type of the variable.
    #[error("{what} does not fit {name}, which is of type {kind}; expected {expected}")]
    Unfit {
        /// The kind of signal or fault that the entry states.
        what: &'static str,
        /// The variable, as `slave.variable`.
        name: String,
        /// The type of the variable.
        kind: &'static str,
        /// The kinds that fit this type.
        expected: &'static str,
    },
    /// A number is out of range.
    #[error("{what} is {actual}, expected {expected}")]
    Number {
        /// Name of the number.
        what: &'static str,
        /// The number that is stated.
        actual: f64,
        /// The condition that the number must satisfy.
        expected: &'static str,
    },
    /// Members of a table are missing or exclude each other.
    #[error("{what}: expected {expected}")]
    Members {
        /// Name of the table.
        what: &'static str,
        /// The members that the table must have.
        expected: &'static str,
    },
    /// A value does not fit the type of the variable.
    #[error("{name} = {actual}: expected {expected}")]
    Value {
        /// The variable, as `slave.variable`.
        name: String,
        /// The value that is stated.
        actual: String,
        /// The values that fit.
        expected: String,
    },
    /// A text is not a unit.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A unit is stated for a variable without one.
    #[error("{name} has no unit, expected a value without one, found the unit {stated:?}")]
    NoUnit {
        /// The variable, as `slave.variable`.
        name: String,
        /// The unit that the entry states.
        stated: String,
    },
    /// The unit cannot be converted to the unit of the variable.
    #[error("{name} is in {unit:?}, to which {stated:?} cannot be converted")]
    Dimension {
        /// The variable, as `slave.variable`.
        name: String,
        /// The unit that the entry states.
        stated: String,
        /// The unit of the variable.
        unit: String,
    },
    /// Points do not define a signal.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// A fault cannot be created.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A file is not a valid table.
    #[error("{}: {error}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The error of the table.
        error: TableError,
    },
    /// The file does not have the column.
    #[error("{}: there is no column {name:?}, it has {known}", path.display())]
    Column {
        /// Path of the file.
        path: PathBuf,
        /// Name of the column.
        name: String,
        /// Some of the columns in the file.
        known: String,
    },
    /// No column of the file has the name of an input or parameter that can be driven.
    #[error("{}: no column is called as {expected}, it has {known}", path.display())]
    NoColumn {
        /// Path of the file.
        path: PathBuf,
        /// The form of the column names expected.
        expected: String,
        /// Some of the columns in the file.
        known: String,
    },
}

fn listed(kinds: &[&str]) -> String {
    if kinds.is_empty() { "none".to_owned() } else { kinds.join(" and ") }
}
