//! Matrices as lists of rows.

use files::{Entry, PlaceError};
use nalgebra::DMatrix;

/// Reads an entry as a matrix.
pub(crate) trait MatrixEntry {
    /// Reads a matrix: a list of rows of the same length.
    fn matrix(&self) -> Result<DMatrix<f64>, PlaceError>;

    /// Reads a matrix and checks its shape; `meaning` names its rows and columns.
    fn shaped(
        &self,
        rows: usize,
        columns: usize,
        meaning: &str,
    ) -> Result<DMatrix<f64>, PlaceError>;
}

impl MatrixEntry for Entry<'_> {
    fn matrix(&self) -> Result<DMatrix<f64>, PlaceError> {
        let rows = self.list()?;
        let mut values = Vec::new();
        let mut columns = None;
        for row in &rows {
            let numbers = row.numbers()?;
            let expected = *columns.get_or_insert(numbers.len());
            if numbers.len() != expected {
                let count = numbers.len();
                let message = format!("expected {expected} entries as in row 1, found {count}");
                return Err(row.error(message));
            }
            values.extend(numbers);
        }
        match columns {
            None | Some(0) => Err(self.error("expected at least one row and one column")),
            Some(columns) => Ok(DMatrix::from_row_slice(rows.len(), columns, &values)),
        }
    }

    fn shaped(
        &self,
        rows: usize,
        columns: usize,
        meaning: &str,
    ) -> Result<DMatrix<f64>, PlaceError> {
        let matrix = self.matrix()?;
        if matrix.shape() == (rows, columns) {
            return Ok(matrix);
        }
        let shape = format!("{}x{}", matrix.nrows(), matrix.ncols());
        Err(self.error(format!("expected {rows}x{columns} ({meaning}), found {shape}")))
    }
}
