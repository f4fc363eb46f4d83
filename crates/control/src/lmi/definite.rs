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

#[cfg(test)]
mod tests {
    use super::*;

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
