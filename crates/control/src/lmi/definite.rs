//! Tests for positive definiteness that allow for rounding errors.

use crate::Error;
use crate::balance::power_of_two;
use crate::blocks::symmetric_part;
use crate::check::as_number;
use crate::svd::Svd;
use nalgebra::DMatrix;

/// Bound of the rounding error of an eigenvalue, relative to n^2 times the largest entry of the n x n matrix; includes
/// a safety margin.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The definiteness margin of a symmetric matrix S: the smallest eigenvalue of D S D, D the
/// diagonal of powers of two that brings the diagonal of S to about one. If it is above zero, S is
/// positive definite; zero means that this was not shown.
///
/// D S D is positive definite if and only if S is (Sylvester), and scaling by powers of two does
/// not round. The entries of S may have relative errors of a few units of rounding. The margin is
/// set to zero unless it exceeds 16 n^2 units of rounding of the largest entry.
pub(crate) fn margin(s: &DMatrix<f64>) -> Result<f64, Error> {
    let scale = s.diagonal().map(|entry| 1.0 / power_of_two(entry.sqrt()));
    if !scale.iter().all(|factor| factor.is_normal()) || s.iter().any(|entry| !entry.is_finite()) {
        return Ok(0.0);
    }
    let scaled = DMatrix::from_fn(s.nrows(), s.ncols(), |i, j| {
        0.5 * (s[(i, j)] + s[(j, i)]) * scale[i] * scale[j]
    });
    let size = scaled.amax();
    let Some(smallest) = smallest_eigenvalue(&scaled)? else { return Ok(0.0) };
    let order = as_number(s.nrows());
    Ok(if smallest > ROUNDING * order * order * size { smallest } else { 0.0 })
}

/// The smallest eigenvalue of a positive definite matrix; None if the matrix is not positive definite.
///
/// The symmetric part of `s` is taken. Method: Cholesky factor, squares of its singular values.
pub(super) fn smallest_eigenvalue(s: &DMatrix<f64>) -> Result<Option<f64>, Error> {
    let Some(factor) = symmetric_part(s).cholesky() else { return Ok(None) };
    let values = Svd::new(&factor.l().transpose())?.values;
    Ok(Some(values[values.len() - 1].powi(2)))
}

/// A B in twice the precision: the unevaluated sum `high` + `low` of the rounded product and its
/// rounding error, the latter rounded itself.
///
/// Source: T. Ogita, S. M. Rump, S. Oishi, Accurate sum and dot product, SIAM J. Sci. Comput. 26 (2005), algorithm 5.3.
pub(crate) struct AccurateProduct {
    pub(crate) high: DMatrix<f64>,
    pub(crate) low: DMatrix<f64>,
}

impl AccurateProduct {
    /// `a`: n x k; `b`: k x m.
    pub(crate) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Self {
        let (rows, cols) = (a.nrows(), b.ncols());
        let mut product =
            Self { high: DMatrix::zeros(rows, cols), low: DMatrix::zeros(rows, cols) };
        for row in 0..rows {
            for col in 0..cols {
                let (mut sum, mut error) = (0.0_f64, 0.0_f64);
                for k in 0..a.ncols() {
                    let (x, y) = (a[(row, k)], b[(k, col)]);
                    let term = x * y;
                    let (next, rounding) = two_sum(sum, term);
                    error += x.mul_add(y, -term) + rounding;
                    sum = next;
                }
                (product.high[(row, col)], product.low[(row, col)]) = two_sum(sum, error);
            }
        }
        product
    }

    /// A B + (A B)' + `constant`, rounded after the large terms have cancelled.
    pub(crate) fn plus_transpose(&self, constant: &DMatrix<f64>) -> DMatrix<f64> {
        (&self.high + self.high.transpose() + constant) + (&self.low + self.low.transpose())
    }
}

/// The rounded sum of two numbers and its rounding error, which is exact.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
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
        assert_eq!(AccurateProduct::new(&row, &column).high[(0, 0)].to_bits(), 1.0_f64.to_bits());
        let tenth = DMatrix::from_element(1, 1, 0.1);
        let square = AccurateProduct::new(&tenth, &tenth);
        // The double nearest to 0.1 is 0.1 + 5.551115123125783e-18.
        assert!((square.low[(0, 0)] - (0.01 - square.high[(0, 0)] + 1.11e-18)).abs() < 2e-18);
    }

    #[test]
    fn badly_scaled_definite_and_indefinite_matrices_are_distinguished() {
        let d = [1.0, 1e-9, 1e9];
        let matrix = |coupling: f64| {
            DMatrix::from_fn(3, 3, |i, j| d[i] * d[j] * if i == j { 1.0 } else { coupling })
        };
        // numpy 2.4.6: eigvalsh of the matrix scaled by 1, 2^30 and 2^-30.
        assert!((margin(&matrix(0.5)).unwrap() - 0.458_058_580_564).abs() < 1e-11);
        assert_eq!(margin(&matrix(-0.500_1)).unwrap().to_bits(), 0);
        assert_eq!(margin(&matrix(-0.5)).unwrap().to_bits(), 0);
        assert_eq!(margin(&DMatrix::zeros(2, 2)).unwrap().to_bits(), 0);
    }
}
