//! The constants of the code.

use nalgebra::DMatrix;

use super::symbols::Kind;

/// A table of constants: a vector, or stacked matrices.
pub(super) struct Constants {
    /// The name, in C unchanged and in Rust in capitals.
    pub(super) name: &'static str,
    /// The comment before the table in C; empty for a table that needs none.
    pub(super) meaning: &'static str,
    /// The signals of the rows of a matrix, or of the elements of a vector.
    pub(super) rows: Kind,
    /// The signals of the columns of a matrix; none of a vector.
    pub(super) columns: Option<Kind>,
    /// The kind of parts that have one matrix each: points of a schedule, or sets of gains; `None` for one matrix.
    pub(super) layers: Option<Kind>,
    /// The rows of all matrices; one row for a vector.
    pub(super) values: Vec<Vec<f64>>,
}

impl Constants {
    /// The number of elements.
    pub(super) fn count(&self) -> usize {
        self.values.iter().map(Vec::len).sum()
    }

    /// A table of stacked matrices, one for each of the `layers`; a single matrix without layers.
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
