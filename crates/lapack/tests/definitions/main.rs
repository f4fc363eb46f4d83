//! Each symbol against its definition, called as Clarabel calls it.
#![expect(unsafe_code, reason = "the routines are C functions")]
#![expect(clippy::unwrap_used, reason = "tests")]

use aso_lapack as _;

use nalgebra::DMatrix;

mod products;
mod singular;
mod solvers;
mod spectrum;

/// Guard value for memory that no routine may write.
const GUARD: f64 = 12345.0;

/// A length as the routines take it.
fn int(length: usize) -> i32 {
    i32::try_from(length).unwrap()
}

/// Entries in -1 to 1 without a pattern, the same in every run.
fn entries(rows: usize, cols: usize, seed: u32) -> DMatrix<f64> {
    let mut state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    DMatrix::from_fn(rows, cols, |_, _| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    })
}

/// A symmetric matrix of such entries.
fn symmetric(n: usize, seed: u32) -> DMatrix<f64> {
    let half = entries(n, n, seed);
    &half + half.transpose()
}

/// The array of a matrix with `more` guards after each column.
fn array(m: &DMatrix<f64>, more: usize) -> Vec<f64> {
    m.clone().resize_vertically(m.nrows() + more, GUARD).as_slice().to_vec()
}

/// Returns the matrix in an array; the guards must be unchanged.
fn matrix(rows: usize, cols: usize, more: usize, array: &[f64]) -> DMatrix<f64> {
    let whole = DMatrix::from_column_slice(rows + more, cols, array);
    assert_eq!(whole.rows(rows, more), DMatrix::repeat(more, cols, GUARD));
    whole.rows(0, rows).into_owned()
}

/// The upper triangle of one matrix with the lower triangle of the other.
fn upper_and_lower(upper: &DMatrix<f64>, lower: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(upper.nrows(), upper.ncols(), |row, col| {
        if row <= col { upper[(row, col)] } else { lower[(row, col)] }
    })
}

fn assert_orthonormal(m: &DMatrix<f64>) {
    let product = m.transpose() * m;
    let error = (&product - DMatrix::identity(m.ncols(), m.ncols())).amax();
    assert!(error < 1e-14 * 8.0, "{error:e}");
}

/// The largest entry times the order: a bound of the norm without overflow or underflow.
fn size(a: &DMatrix<f64>) -> f64 {
    a.amax() * f64::from(int(a.nrows().max(a.ncols())))
}

/// Returns the size that a routine requests in the first entry of its workspace.
fn asked(work: &[f64]) -> i32 {
    (1..1000).find(|&length| f64::from(length) >= work[0]).unwrap()
}
