//! Matrices for linear algebra.

use aso_controller::Matrix;
use nalgebra::DMatrix;

/// The matrix for linear algebra.
pub(crate) fn dense(matrix: &Matrix) -> DMatrix<f64> {
    DMatrix::from_row_slice(matrix.rows, matrix.columns, &matrix.values)
}
