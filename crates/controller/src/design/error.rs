//! Errors of design files.

use super::Refusal;

/// A design file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct DesignError {
    /// The path of the file.
    pub path: String,
    /// The reason why the file cannot be used.
    pub reason: Reason,
}

/// Why a design file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Reason {
    /// The text is no TOML, an entry is unknown or missing, or a value has the wrong type; with the line.
    #[error("{0}")]
    Malformed(String),
    /// A matrix has a wrong number of rows or columns.
    #[error("{what} is {actual}, expected {expected} ({meaning})")]
    Shape {
        /// The matrix or the list.
        what: &'static str,
        /// The actual shape.
        actual: String,
        /// The required shape.
        expected: String,
        /// The signals of the rows and columns.
        meaning: String,
    },
    /// A number is out of its range.
    #[error("{0}")]
    Value(Refusal),
    /// Entries do not fit together.
    #[error("{0}")]
    Entry(String),
}
