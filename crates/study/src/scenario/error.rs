//! What can be wrong with a scenario.

use std::ops::Range;
use std::path::PathBuf;

use fmu_description::unit::UnitError;

use crate::table::TableError;
use master::SystemError;
use master::fault::FaultError;
use master::signal::TrackError;

/// An entry that cannot be.
#[derive(Debug, thiserror::Error)]
#[error("{entry}: {reason}")]
pub struct ScenarioError {
    /// What it points at, in bytes of the text that the scenario was read from; `0..0` where it was not
    /// read from a text.
    pub place: Range<usize>,
    /// The entry, such as `scenario.fault[2]`, which counts from 1.
    pub entry: String,
    /// Why.
    pub reason: Box<Reason>,
}

/// Why an entry cannot be.
#[derive(Debug, thiserror::Error)]
pub enum Reason {
    /// A name that there is not.
    #[error(transparent)]
    Name(#[from] SystemError),
    /// A variable that cannot be set on the way.
    #[error("{name} is {found}, expected an input or a tunable parameter")]
    NotSettable {
        /// The variable.
        name: String,
        /// Its causality and variability.
        found: String,
    },
    /// An input that has a source.
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
    /// A variable of two entries.
    #[error("{name} is driven twice, also by {first}")]
    Twice {
        /// The variable.
        name: String,
        /// The other entry.
        first: String,
    },
    /// A fault where there are no values.
    #[error("{name} is {found}, expected a connected input, or one that a signal drives")]
    NoConnection {
        /// The variable.
        name: String,
        /// What it is.
        found: &'static str,
    },
    /// A connection that is another one.
    #[error("{target} is connected to {found}, expected {stated}")]
    OtherSource {
        /// The input.
        target: String,
        /// Its source.
        found: String,
        /// The source stated.
        stated: String,
    },
    /// Not exactly one kind.
    #[error("found {}, expected exactly one of {expected}", listed(found))]
    Kinds {
        /// Those there are.
        found: Vec<&'static str>,
        /// Those there could be.
        expected: &'static str,
    },
    /// A kind that does not fit the type.
    #[error("{what} does not fit {name}, which is of type {kind}; expected {expected}")]
    Unfit {
        /// The kind of the entry.
        what: &'static str,
        /// The variable.
        name: String,
        /// Its type.
        kind: &'static str,
        /// What would fit.
        expected: &'static str,
    },
    /// A number that makes no sense.
    #[error("{what} is {found}, expected {expected}")]
    Number {
        /// Which one.
        what: &'static str,
        /// The number.
        found: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// Members of a table that belong together or exclude each other.
    #[error("{what}: expected {expected}")]
    Members {
        /// The table.
        what: &'static str,
        /// What is right.
        expected: &'static str,
    },
    /// A value that does not fit the type of the variable.
    #[error("{name} = {found}: expected {expected}")]
    Value {
        /// The variable.
        name: String,
        /// The value.
        found: String,
        /// What fits.
        expected: String,
    },
    /// A text that is no unit.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A unit for something that has none.
    #[error("{name} has no unit, expected a value without one, found the unit {stated:?}")]
    NoUnit {
        /// The variable.
        name: String,
        /// The unit stated.
        stated: String,
    },
    /// A unit of another dimension.
    #[error("{name} is in {own:?}, to which {stated:?} cannot be converted")]
    Dimension {
        /// The variable.
        name: String,
        /// The unit stated.
        stated: String,
        /// The unit of the variable.
        own: String,
    },
    /// Points that make no signal.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// A fault that cannot be.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A file that is no table.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: TableError,
    },
    /// A file without that column.
    #[error("{}: there is no column {name:?}, it has {known}", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column.
        name: String,
        /// Some of those there are.
        known: String,
    },
    /// A file without any column that fits.
    #[error("{}: no column is called as {expected}, it has {known}", path.display())]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// What the columns could be called.
        expected: String,
        /// Some of those there are.
        known: String,
    },
}

fn listed(found: &[&str]) -> String {
    if found.is_empty() { "none".to_owned() } else { found.join(" and ") }
}
