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
    /// The reason.
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
        /// The variable.
        name: String,
        /// Its causality and variability.
        actual: String,
    },
    /// The input already has a source.
    #[error(
        "{name} is connected to {source_name} and gets its values from there; a fault on this \
         connection can hold another one: stuck = {{ value = .. }}"
    )]
    Connected {
        /// The input.
        name: String,
        /// Its source.
        source_name: String,
    },
    /// Two entries drive the same variable.
    #[error("{name} is driven twice, also by {first}")]
    Twice {
        /// The variable.
        name: String,
        /// Path of the other entry.
        first: String,
    },
    /// A fault is stated for a variable without a connection and without a signal.
    #[error("{name} is {actual}, expected a connected input, or one that a signal drives")]
    NoConnection {
        /// The variable.
        name: String,
        /// The kind of the variable.
        actual: &'static str,
    },
    /// The input has another source than stated.
    #[error("{target} is connected to {actual}, expected {stated}")]
    OtherSource {
        /// The input.
        target: String,
        /// Its source.
        actual: String,
        /// The source stated.
        stated: String,
    },
    /// An entry does not have exactly one kind.
    #[error("found {}, expected exactly one of {expected}", listed(actual))]
    Kinds {
        /// The kinds stated.
        actual: Vec<&'static str>,
        /// The kinds possible.
        expected: &'static str,
    },
    /// The kind does not fit the type of the variable.
    #[error("{what} does not fit {name}, which is of type {kind}; expected {expected}")]
    Unfit {
        /// The kind of the entry.
        what: &'static str,
        /// The variable.
        name: String,
        /// Its type.
        kind: &'static str,
        /// The kinds that fit.
        expected: &'static str,
    },
    /// A number is out of range.
    #[error("{what} is {actual}, expected {expected}")]
    Number {
        /// Name of the number.
        what: &'static str,
        /// The number.
        actual: f64,
        /// The condition it must satisfy.
        expected: &'static str,
    },
    /// Members of a table are missing or exclude each other.
    #[error("{what}: expected {expected}")]
    Members {
        /// The table.
        what: &'static str,
        /// The members expected.
        expected: &'static str,
    },
    /// A value does not fit the type of the variable.
    #[error("{name} = {actual}: expected {expected}")]
    Value {
        /// The variable.
        name: String,
        /// The value.
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
        /// The variable.
        name: String,
        /// The unit stated.
        stated: String,
    },
    /// The unit cannot be converted to the unit of the variable.
    #[error("{name} is in {unit:?}, to which {stated:?} cannot be converted")]
    Dimension {
        /// The variable.
        name: String,
        /// The unit stated.
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
        /// The file.
        path: PathBuf,
        /// The error of the table.
        error: TableError,
    },
    /// The file does not have the column.
    #[error("{}: there is no column {name:?}, it has {known}", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column.
        name: String,
        /// Some of the columns in the file.
        known: String,
    },
    /// No column of the file has the name of an input or parameter that can be driven.
    #[error("{}: no column is called as {expected}, it has {known}", path.display())]
    NoColumn {
        /// The file.
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
