//! Claims of the crate, compared with published numbers, other software and the equations
//! themselves.

mod allocation;
mod aso;
mod bandwidth;
mod data;
mod detectability;
mod distance;
mod eigen;
mod estimation;
mod exponential;
#[cfg(feature = "lmi")]
mod family;
mod faults;
mod feedthrough;
mod hold;
mod identification;
mod isolation;
#[cfg(feature = "lmi")]
mod lmi;
#[cfg(feature = "lmi")]
mod losses;
mod lyapunov;
#[path = "../../examples/fault_detection/matrices.rs"]
mod matrices;
mod paper;
mod placement;
mod rank;
mod recorded;
#[expect(clippy::unreadable_literal, reason = "the digits as the other software wrote them")]
mod reference;
mod refusals;
mod response;
mod riccati;
mod robustness;
mod sampled;
mod structured;
mod theorem1;
mod tracking;
mod zeros;

use nalgebra::DMatrix;

/// A matrix from its rows.
fn matrix(rows: usize, cols: usize, entries: &[f64]) -> DMatrix<f64> {
    DMatrix::from_row_slice(rows, cols, entries)
}

/// Largest distance of two matrices, each entry relative to the expected one.
fn entry_error(actual: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    assert_eq!(actual.shape(), expected.shape());
    let relative = |x: f64, y: f64| {
        if (x - y).abs() > 0.0 { (x - y).abs() / y.abs() } else { 0.0 }
    };
    actual.zip_map(expected, relative).amax()
}

/// Entries in -5 to 5 without a pattern, the same in every run.
fn integers(rows: usize, cols: usize, rule: impl Fn(i32, i32) -> i32) -> DMatrix<f64> {
    let mut entries = Vec::with_capacity(rows * cols);
    for i in (0..).take(rows) {
        entries.extend((0..).take(cols).map(|j| f64::from(rule(i, j))));
    }
    matrix(rows, cols, &entries)
}
