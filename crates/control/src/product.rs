//! Products with the same bits on every processor.

use nalgebra::DMatrix;

/// The matrix product A B, summed in a fixed order: for each column of B the columns of A times its
/// entries.
///
/// `a`: n x k; `b`: k x m. The result has the same bits on every processor. nalgebra's `*` does
/// not: it multiplies matrices larger than 5 x 5 by kernels that depend on the features of the
/// processor. Exported models use this function.
///
/// # Panics
///
/// If the number of columns of A differs from the number of rows of B, as `*` does.
#[must_use]
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut result = DMatrix::zeros(a.nrows(), b.ncols());
    for (mut column, factors) in result.column_iter_mut().zip(b.column_iter()) {
        column.gemv(1.0, a, &factors, 0.0);
    }
    result
}
