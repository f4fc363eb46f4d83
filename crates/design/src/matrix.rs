//! Matrices as lists of rows, the form in the report and the design file.

use aso_controller::Matrix;
use nalgebra::{Complex, DMatrix};

/// Returns the rows of a matrix; negative zeros become zeros.
pub(crate) fn rows(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|row| row.iter().map(|entry| entry + 0.0).collect()).collect()
}

/// Returns the real and the imaginary part of each number.
pub(crate) fn pairs(numbers: &[Complex<f64>]) -> Vec<[f64; 2]> {
    numbers.iter().map(|number| [number.re, number.im]).collect()
}

/// Converts a matrix to the form of the design file; negative zeros become zeros.
pub(crate) fn matrix(dense: &DMatrix<f64>) -> Matrix {
    let values =
        dense.row_iter().flat_map(|row| row.iter().map(|entry| entry + 0.0).collect::<Vec<_>>());
    Matrix { rows: dense.nrows(), columns: dense.ncols(), values: values.collect() }
}
