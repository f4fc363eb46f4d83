//! Errors of design files.

/// Why a design file cannot be used; `path` is that of the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// The text is no TOML, an entry is unknown or missing, or a value has the wrong type.
    #[error("{path}: {message}")]
    Malformed {
        /// The file.
        path: String,
        /// The reason, with the line.
        message: String,
    },
    /// A matrix has a wrong number of rows or columns.
    #[error("{path}: {what} is {actual}, expected {expected} ({meaning})")]
    Shape {
        /// The file.
        path: String,
        /// The matrix or the list.
        what: &'static str,
        /// Its shape.
        actual: String,
        /// The shape that it must have.
        expected: String,
        /// The signals of its rows and columns.
        meaning: String,
    },
    /// A number is out of its range.
    #[error("{path}: {what} = {value}, expected {rule}")]
    Value {
        /// The file.
        path: String,
        /// The entry.
        what: String,
        /// The number.
        value: f64,
        /// The range.
        rule: &'static str,
    },
    /// Entries do not fit together.
    #[error("{path}: {what}")]
    Entry {
        /// The file.
        path: String,
        /// The contradiction.
        what: String,
    },
}
