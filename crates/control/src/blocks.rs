//! Matrices made of blocks, and parts of matrices.

use nalgebra::{Complex, ComplexField, DMatrix};

pub(crate) type ComplexMatrix = DMatrix<Complex<f64>>;

/// The matrix [above; below] of two matrices with the same number of columns.
///
/// # Panics
///
/// If the numbers of columns differ.
#[must_use]
pub fn stacked<T: ComplexField>(above: &DMatrix<T>, below: &DMatrix<T>) -> DMatrix<T> {
    let mut both = above.clone().resize_vertically(above.nrows() + below.nrows(), T::zero());
    both.rows_mut(above.nrows(), below.nrows()).copy_from(below);
    both
}

/// The matrix [left, right] of two matrices with the same number of rows.
///
/// # Panics
///
/// If the numbers of rows differ.
#[must_use]
pub fn beside<T: ComplexField>(left: &DMatrix<T>, right: &DMatrix<T>) -> DMatrix<T> {
    let mut both = left.clone().resize_horizontally(left.ncols() + right.ncols(), T::zero());
    both.columns_mut(left.ncols(), right.ncols()).copy_from(right);
    both
}

/// [a, b; c, d], whose blocks may have any fitting shapes.
pub(crate) fn block_2x2<T: ComplexField>(
    [a, b]: [&DMatrix<T>; 2],
    [c, d]: [&DMatrix<T>; 2],
) -> DMatrix<T> {
    let ((rows, cols), (below, right)) = (a.shape(), d.shape());
    let mut whole = DMatrix::zeros(rows + below, cols + right);
    whole.view_mut((0, 0), (rows, cols)).copy_from(a);
    whole.view_mut((0, cols), (rows, right)).copy_from(b);
    whole.view_mut((rows, 0), (below, cols)).copy_from(c);
    whole.view_mut((rows, cols), (below, right)).copy_from(d);
    whole
}

/// The symmetric part (M + M') / 2.
pub(crate) fn symmetric_part(m: &DMatrix<f64>) -> DMatrix<f64> {
    (m + m.transpose()) * 0.5
}

pub(crate) fn to_complex(m: &DMatrix<f64>) -> ComplexMatrix {
    m.map(|entry| Complex::new(entry, 0.0))
}
