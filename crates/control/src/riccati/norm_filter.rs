//! The filter whose error keeps a bound of its H-infinity norm.

use super::kalman;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// Riccati equations that are solved for one bound.
const ITERATIONS: usize = 400;
/// Relative change at which the iteration has converged.
const CONVERGED: f64 = 1e-4;
/// Largest growth of X from the Kalman filter's on, beyond which the bound counts as too small.
const GROWTH: f64 = 1e8;

/// The error dynamics for [`norm_filter`]: x' = (A - L C) x + B w - L v, z = E x.
#[derive(Debug, Clone, Copy)]
pub struct NormFilterProblem<'a> {
    /// A, n x n.
    pub a: &'a DMatrix<f64>,
    /// C, p x n.
    pub c: &'a DMatrix<f64>,
    /// B, n x k.
    pub disturbance: &'a DMatrix<f64>,
    /// V, p x p, positive definite: v = `V^(1/2)` times noise of unit size.
    pub noise: &'a DMatrix<f64>,
    /// E, r x n.
    pub output: &'a DMatrix<f64>,
}

/// Computes the gain L of the filter in continuous time whose H-infinity norm from the disturbance w
/// and the noise to z is below `gamma`; None if no such filter was found.
///
/// ```text
/// A X + X A' - X (C' V^-1 C - E' E / gamma^2) X + B B' = 0,   L = X C' V^-1
/// ```
///
/// Method: X is the limit of the covariances of Kalman filters, each with the process noise B B' +
/// X E' E X / `gamma^2` of the one before. They grow from that of the Kalman filter, and stay below the
/// solution X if there is one, so they converge if and only if gamma is above the least norm of any
/// filter. The number of iterations grows without limit towards that norm; 400 reach to
/// about 2 % above it. The bound holds up to the tolerance 1e-4 of X: evaluate the norm of the result.
///
/// Source: K. M. Nagpal, P. P. Khargonekar, Filtering and smoothing in an H-infinity setting, IEEE
/// Trans. Autom. Control 36 (1991), theorem 3.1.
///
/// # Errors
///
/// Same as [`kalman`] for the first filter; [`Error::OutOfRange`] for `gamma`.
pub fn norm_filter(
    problem: &NormFilterProblem<'_>,
    gamma: f64,
) -> Result<Option<DMatrix<f64>>, Error> {
    check::positive("gamma", gamma)?;
    let NormFilterProblem { a, c, disturbance, noise, output } = *problem;
    check::shape("E", output, (output.nrows(), a.nrows()))?;
    let process = disturbance * disturbance.transpose();
    let mut filter = kalman(a, c, &process, noise, Domain::Continuous)?;
    let first = filter.covariance.norm();
    for _ in 0..ITERATIONS {
        let before = filter.covariance;
        let seen = output * &before / gamma;
        let grown = &process + seen.tr_mul(&seen);
        let symmetric = (&grown + grown.transpose()) * 0.5;
        let Ok(next) = kalman(a, c, &symmetric, noise, Domain::Continuous) else { return Ok(None) };
        let size = next.covariance.norm();
        if (&next.covariance - before).norm() <= CONVERGED * size {
            return Ok(Some(next.gain));
        }
        if size > GROWTH * first {
            return Ok(None);
        }
        filter = next;
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For x' = w, y = x + v, z = x: 0 = -(1 - `1/gamma^2`) X^2 + 1, so a filter exists for gamma above
    /// 1, and L = 1 / sqrt(1 - `1/gamma^2`).
    #[test]
    fn the_filter_of_an_integrator_has_the_gain_of_the_scalar_equation() {
        let (zero, one) = (DMatrix::zeros(1, 1), DMatrix::identity(1, 1));
        let problem =
            NormFilterProblem { a: &zero, c: &one, disturbance: &one, noise: &one, output: &one };
        let gain = norm_filter(&problem, 1.25).unwrap().unwrap();
        assert!((gain[(0, 0)] - 1.0 / 0.6).abs() < 1e-3);
        assert_eq!(norm_filter(&problem, 0.9).unwrap(), None);
        assert!(norm_filter(&problem, 0.0).is_err());
    }
}
