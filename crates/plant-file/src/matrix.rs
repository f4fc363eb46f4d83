//! Matrices as lists of rows.

use crate::read::Result;
use files::Entry;
use nalgebra::DMatrix;

/// Reads a matrix: a list of rows of the same length, with at least one row and one column.
pub(crate) fn matrix(entry: &Entry<'_>) -> Result<DMatrix<f64>> {
    let rows = entry.list()?;
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
        None | Some(0) => Err(entry.error("expected at least one row and one column")),
        Some(columns) => Ok(DMatrix::from_row_slice(rows.len(), columns, &values)),
    }
}

/// Reads a matrix and checks its shape; `meaning` names its rows and columns.
pub(crate) fn shaped(
    entry: &Entry<'_>,
    [rows, columns]: [usize; 2],
    meaning: &str,
) -> Result<DMatrix<f64>> {
    let matrix = matrix(entry)?;
    if matrix.shape() == (rows, columns) {
        return Ok(matrix);
    }
    let shape = format!("{}x{}", matrix.nrows(), matrix.ncols());
    Err(entry.error(format!("expected {rows}x{columns} ({meaning}), found {shape}")))
}
