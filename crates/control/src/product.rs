//! Products with the same bits on every processor.

use nalgebra::DMatrix;

/// A B, column by column: for each column of B the columns of A times its entries, added in their
/// order.
///
/// `a`: n x k; `b`: k x m. The same bits on every processor, other than nalgebra's `*`, which leaves
/// matrices of more than 5 x 5 to kernels that are chosen by what the processor can do. An exported
/// model uses this one.
///
/// # Panics
///
/// Where A has another number of columns than B has rows, as `*` does.
#[must_use]
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut result = DMatrix::zeros(a.nrows(), b.ncols());
    for (mut column, factors) in result.column_iter_mut().zip(b.column_iter()) {
        column.gemv(1.0, a, &factors, 0.0);
    }
    result
}
