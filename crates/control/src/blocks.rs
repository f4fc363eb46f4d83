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
    grid(&[&[above], &[below]])
}

/// The matrix [left, right] of two matrices with the same number of rows.
///
/// # Panics
///
/// If the numbers of rows differ.
#[must_use]
pub fn beside<T: ComplexField>(left: &DMatrix<T>, right: &DMatrix<T>) -> DMatrix<T> {
    grid(&[&[left, right]])
}

/// [a, b; c, d], whose blocks may have any fitting shapes.
pub(crate) fn block_2x2<T: ComplexField>(
    [a, b]: [&DMatrix<T>; 2],
    [c, d]: [&DMatrix<T>; 2],
) -> DMatrix<T> {
    grid(&[&[a, b], &[c, d]])
}

/// The matrix of the given blocks, row by row. Panics if the blocks of a row differ in height or the rows in length.
pub(crate) fn grid<T: ComplexField>(rows: &[&[&DMatrix<T>]]) -> DMatrix<T> {
    let height = rows.iter().map(|row| row[0].nrows()).sum();
    let width = rows[0].iter().map(|block| block.ncols()).sum();
    let mut whole = DMatrix::zeros(height, width);
    let mut top = 0;
    for row in rows {
        let (mut left, row_height) = (0, row[0].nrows());
        for block in *row {
            whole.view_mut((top, left), (row_height, block.ncols())).copy_from(block);
            left += block.ncols();
        }
        assert_eq!(left, width, "the rows of blocks differ in length");
        top += row_height;
    }
    whole
}

/// The block diagonal matrix of the given blocks, of any shapes.
pub(crate) fn block_diagonal<'a>(
    blocks: impl IntoIterator<Item = &'a DMatrix<f64>>,
) -> DMatrix<f64> {
    blocks.into_iter().fold(DMatrix::zeros(0, 0), |whole, block| {
        let ((top, left), size) = (whole.shape(), block.shape());
        let mut whole = whole.resize(top + size.0, left + size.1, 0.0);
        whole.view_mut((top, left), size).copy_from(block);
        whole
    })
}

/// The symmetric part (M + M') / 2.
pub(crate) fn symmetric_part(m: &DMatrix<f64>) -> DMatrix<f64> {
    (m + m.transpose()) * 0.5
}

pub(crate) fn to_complex(m: &DMatrix<f64>) -> ComplexMatrix {
    m.map(|entry| Complex::new(entry, 0.0))
}
