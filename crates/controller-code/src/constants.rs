//! A constant of the code.

use super::symbols::Kind;

/// A constant: its name in the design file and its rows; one row for a vector.
pub(super) struct Constants {
    pub(super) name: &'static str,
    pub(super) meaning: &'static str,
    /// The signals of the rows and, of a matrix, of the columns.
    pub(super) rows: Kind,
    pub(super) columns: Option<Kind>,
    /// What the rows of a matrix are repeated for: each point of a schedule, each set of gains.
    pub(super) layers: Option<Kind>,
    pub(super) values: Vec<Vec<f64>>,
}

impl Constants {
    pub(super) fn count(&self) -> usize {
        self.values.iter().map(Vec::len).sum()
    }

    pub(super) fn vector(
        name: &'static str,
        meaning: &'static str,
        rows: Kind,
        values: Vec<f64>,
    ) -> Self {
        Self { name, meaning, rows, columns: None, layers: None, values: vec![values] }
    }
}
