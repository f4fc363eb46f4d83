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
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum Reason {
    /// A slave or a variable does not exist.
    #[error(transparent)]
    Name(#[from] SystemError),
    /// The variable cannot be set during the run.
    #[error("{name} is {actual}, expected an input or a tunable parameter")]
    NotSettable { name: String, actual: String },
    /// The input already has a source.
    #[error(
        "{name} is connected to {source_name} and gets its values from there; a fault on this \
         connection can hold another one: stuck = {{ value = .. }}"
    )]
    Connected { name: String, source_name: String },
    /// Two entries drive the same variable.
    #[error("{name} is driven twice, also by {first}")]
    Twice { name: String, first: String },
    /// A fault is stated for a variable without a connection and without a signal.
    #[error("{name} is {actual}, expected a connected input, or one that a signal drives")]
    NoConnection { name: String, actual: &'static str },
    /// The input has another source than stated.
    #[error("{target} is connected to {actual}, expected {stated}")]
    OtherSource { target: String, actual: String, stated: String },
    /// An entry does not have exactly one kind.
    #[error("found {}, expected exactly one of {expected}", listed(actual))]
    Kinds { actual: Vec<&'static str>, expected: &'static str },
    /// The kind does not fit the type of the variable.
    #[error("{what} does not fit {name}, which is of type {kind}; expected {expected}")]
    Unfit { what: &'static str, name: String, kind: &'static str, expected: &'static str },
    /// A number is out of range.
    #[error("{what} is {actual}, expected {expected}")]
    Number { what: &'static str, actual: f64, expected: &'static str },
    /// Members of a table are missing or exclude each other.
    #[error("{what}: expected {expected}")]
    Members { what: &'static str, expected: &'static str },
    /// A value does not fit the type of the variable.
    #[error("{name} = {actual}: expected {expected}")]
    Value { name: String, actual: String, expected: String },
    /// A text is not a unit.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A unit is stated for a variable without one.
    #[error("{name} has no unit, expected a value without one, found the unit {stated:?}")]
    NoUnit { name: String, stated: String },
    /// The unit cannot be converted to the unit of the variable.
    #[error("{name} is in {unit:?}, to which {stated:?} cannot be converted")]
    Dimension { name: String, stated: String, unit: String },
    /// Points do not define a signal.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// A fault cannot be created.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A file is not a valid table.
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: TableError },
    /// The file does not have the column.
    #[error("{}: there is no column {name:?}, it has {known}", path.display())]
    Column { path: PathBuf, name: String, known: String },
    /// No column of the file has the name of an input or parameter that can be driven.
    #[error("{}: no column is called as {expected}, it has {known}", path.display())]
    NoColumn { path: PathBuf, expected: String, known: String },
}

fn listed(kinds: &[&str]) -> String {
    if kinds.is_empty() { "none".to_owned() } else { kinds.join(" and ") }
}
