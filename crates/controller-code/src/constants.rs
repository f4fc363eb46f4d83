//! A constant of the code.

use nalgebra::DMatrix;

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

    /// Matrices below each other, one for each of the `layers`; one matrix without them.
    pub(super) fn matrices<'a>(
        name: &'static str,
        meaning: &'static str,
        [rows, columns]: [Kind; 2],
        layers: Option<Kind>,
        matrices: impl IntoIterator<Item = &'a DMatrix<f64>>,
    ) -> Self {
        let values = matrices.into_iter().flat_map(DMatrix::row_iter);
        let values = values.map(|row| row.iter().copied().collect()).collect();
        Self { name, meaning, rows, columns: Some(columns), layers, values }
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
