//! Matrices for linear algebra.

use aso_controller::Matrix;
use nalgebra::DMatrix;

/// Converts a matrix of a design to one for linear algebra.
pub(crate) fn dense(matrix: &Matrix) -> DMatrix<f64> {
    DMatrix::from_row_slice(matrix.rows, matrix.columns, &matrix.values)
}
