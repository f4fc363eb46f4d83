//! Whether a matrix is positive definite, so that rounding cannot pretend it.

use crate::Error;
use crate::balance::power_of_two;
use crate::singular::Singular;
use nalgebra::DMatrix;

/// Rounding errors per row that the smallest eigenvalue must exceed.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Smallest eigenvalue of D S D, D the diagonal of powers of two that brings the diagonal of S to
/// about one; zero or below when S is not shown positive definite.
///
/// D S D is positive definite when S is (Sylvester), and scaling by powers of two rounds nothing.
/// The entries of S count as right to a few roundings of their own. A value is returned as above
/// zero only if it exceeds 16 roundings per row.
pub(crate) fn margin(s: &DMatrix<f64>) -> Result<f64, Error> {
    let scale: Vec<f64> =
        s.diagonal().iter().map(|&entry| 1.0 / power_of_two(entry.sqrt())).collect();
    if !scale.iter().all(|factor| factor.is_normal()) || s.iter().any(|entry| !entry.is_finite()) {
        return Ok(0.0);
    }
    let scaled = DMatrix::from_fn(s.nrows(), s.ncols(), |i, j| {
        0.5 * (s[(i, j)] + s[(j, i)]) * scale[i] * scale[j]
    });
    let size = scaled.amax();
    let Some(smallest) = smallest_eigenvalue(&scaled)? else { return Ok(0.0) };
    let order = f64::from(u32::try_from(s.nrows()).unwrap_or(u32::MAX));
    Ok(if smallest > ROUNDING * order * order * size { smallest } else { 0.0 })
}

/// The smallest eigenvalue of a symmetric matrix if all are above zero.
///
/// Of the two triangles the mean is taken. Cholesky factor, squares of its singular values.
pub(super) fn smallest_eigenvalue(s: &DMatrix<f64>) -> Result<Option<f64>, Error> {
    let Some(factor) = ((s + s.transpose()) * 0.5).cholesky() else { return Ok(None) };
    let values = Singular::of(&factor.l().transpose())?.values;
    Ok(Some(values[values.len() - 1].powi(2)))
}

/// A B as the sum of two matrices: the rounded product and what rounding took away, itself rounded.
///
/// Source: T. Ogita, S. M. Rump, S. Oishi, Accurate sum and dot product, SIAM J. Sci. Comput. 26
/// (2005), algorithm 5.3.
pub(crate) struct Product {
    pub(crate) high: DMatrix<f64>,
    pub(crate) low: DMatrix<f64>,
}

impl Product {
    pub(crate) fn of(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Self {
        let (rows, cols) = (a.nrows(), b.ncols());
        let mut found = Self { high: DMatrix::zeros(rows, cols), low: DMatrix::zeros(rows, cols) };
        for row in 0..rows {
            for col in 0..cols {
                let (mut sum, mut error) = (0.0_f64, 0.0_f64);
                for k in 0..a.ncols() {
                    let (x, y) = (a[(row, k)], b[(k, col)]);
                    let term = x * y;
                    let (next, lost) = exact_sum(sum, term);
                    error += x.mul_add(y, -term) + lost;
                    sum = next;
                }
                let (high, low) = exact_sum(sum, error);
                (found.high[(row, col)], found.low[(row, col)]) = (high, low);
            }
        }
        found
    }
}

/// The rounded sum and the rounding error.
fn exact_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_with_cancellation_keeps_its_digits() {
        let row = DMatrix::from_row_slice(1, 3, &[1e16, 1.0, -1e16]);
        let column = DMatrix::from_row_slice(3, 1, &[1.0, 1.0, 1.0]);
        assert_eq!(Product::of(&row, &column).high[(0, 0)].to_bits(), 1.0_f64.to_bits());
        let tenth = DMatrix::from_element(1, 1, 0.1);
        let square = Product::of(&tenth, &tenth);
        // 0.1 as a number is 0.1 + 5.551115123125783e-18.
        assert!((square.low[(0, 0)] - (0.01 - square.high[(0, 0)] + 1.11e-18)).abs() < 2e-18);
    }

    #[test]
    fn badly_scaled_definite_matrices_are_told_from_indefinite_ones() {
        let d = [1.0, 1e-9, 1e9];
        let matrix = |coupling: f64| {
            DMatrix::from_fn(3, 3, |i, j| d[i] * d[j] * if i == j { 1.0 } else { coupling })
        };
        assert!((margin(&matrix(0.5)).unwrap() - 0.5).abs() < 0.3);
        assert_eq!(margin(&matrix(-0.500_1)).unwrap().to_bits(), 0);
        assert_eq!(margin(&matrix(-0.5)).unwrap().to_bits(), 0);
        assert_eq!(margin(&DMatrix::zeros(2, 2)).unwrap().to_bits(), 0);
    }
}
