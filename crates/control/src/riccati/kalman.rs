//! The Kalman filter in steady state, the dual of the regulator.

use super::{Weights, lqr};
use crate::blocks::symmetric_part;
use crate::{Domain, Error, check};
use nalgebra::{Complex, DMatrix};

/// The gains of a Kalman filter in steady state.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct KalmanFilter {
    /// L, n x p, of `x_hat' = A x_hat + B u + L (y - C x_hat)`; in sampled time of the prediction
    /// `x_hat[k+1] = A x_hat[k] + B u[k] + L (y[k] - C x_hat[k])`.
    pub gain: DMatrix<f64>,
    /// M, n x p, of the current estimate `x_hat[k] + M (y[k] - C x_hat[k])`; L = A M. Sampled time
    /// only.
    pub current_gain: Option<DMatrix<f64>>,
    /// P, n x n: the covariance of the error x - `x_hat`, in sampled time before `y[k]` is used.
    pub covariance: DMatrix<f64>,
    /// Eigenvalues of A - L C.
    pub eigenvalues: Vec<Complex<f64>>,
    /// Residual of the Riccati equation, as in [`super::Regulator::residual`].
    pub residual: f64,
}

/// The Kalman filter for x' = A x + w, y = C x + v, in sampled time for
/// `x[k+1] = A x[k] + w[k]` and the same y.
///
/// `a`: n x n; `c`: p x n; `w`: n x n, symmetric positive semidefinite, the intensity of the process noise (in sampled
/// time its covariance); `v`: p x p, symmetric positive definite, the intensity of the measurement noise (in sampled
/// time its covariance). Solves the equation of [`lqr`] for A', C', W, V:
///
/// ```text
/// A P + P A' - P C' V^-1 C P + W = 0              L = P C' V^-1
/// A P A' - P - A P C' (V + C P C')^-1 C P A' + W = 0
///                     L = A P C' (V + C P C')^-1,  M = P C' (V + C P C')^-1
/// ```
///
/// The filter exists when (A, C) is detectable and every mode of A on the stability limit is
/// excited by W. Method, cost, tolerance and source as in [`lqr`]; R. E. Kalman and R. S. Bucy, J.
/// Basic Eng. 83 (1961).
///
/// # Example
///
/// ```
/// use control::Domain;
/// use control::riccati::kalman;
/// use nalgebra::DMatrix;
/// let one = DMatrix::identity(1, 1);
/// let filter = kalman(&one, &one, &one, &one, Domain::Sampled { period: 1.0 })?;
/// let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
/// assert!((filter.covariance[(0, 0)] - golden).abs() < 1e-14);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::NotSymmetric`] for a bad
/// matrix, [`Error::OutOfRange`] for a bad period; [`Error::NotPositiveDefinite`] for V;
/// [`Error::NotPositiveSemidefinite`] for W; [`Error::NotDetectable`]; [`Error::Unweighted`];
/// [`Error::NotConverged`], [`Error::ResidualTooLarge`], [`Error::NotHurwitz`], [`Error::NotSchur`],
/// [`Error::Overflow`] when rounding prevents a solution.
pub fn kalman(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    w: &DMatrix<f64>,
    v: &DMatrix<f64>,
    domain: Domain,
) -> Result<KalmanFilter, Error> {
    let (n, p) = (check::with_outputs(a, c)?, c.nrows());
    check::shape("W", w, (n, n))?;
    check::shape("V", v, (p, p))?;
    let weights = Weights { q: w.clone(), r: v.clone(), n: None };
    let dual = lqr(&a.transpose(), &c.transpose(), &weights, domain).map_err(named_for_filter)?;
    let current_gain = match domain {
        Domain::Continuous => None,
        Domain::Sampled { .. } => {
            let innovation = symmetric_part(&(v + c * &dual.p * c.transpose()));
            let factor = innovation.cholesky().ok_or(Error::Overflow { what: "V + C P C'" })?;
            Some(factor.solve(&(c * &dual.p)).transpose())
        }
    };
    Ok(KalmanFilter {
        gain: -dual.gain.transpose(),
        current_gain,
        covariance: dual.p,
        eigenvalues: dual.eigenvalues,
        residual: dual.residual,
    })
}

/// Renames the matrices of the dual problem in an error.
fn named_for_filter(error: Error) -> Error {
    match error {
        Error::NotSymmetric { matrix, row, col } => {
            Error::NotSymmetric { matrix: if matrix == "Q" { "W" } else { "V" }, row, col }
        }
        Error::NotPositiveDefinite { .. } => Error::NotPositiveDefinite { matrix: "V" },
        Error::NotPositiveSemidefinite { .. } => Error::NotPositiveSemidefinite { matrix: "W" },
        Error::NotStabilisable { eigenvalue } => Error::NotDetectable { eigenvalue },
        Error::Unweighted { eigenvalue, .. } => Error::Unweighted { weight: "W", eigenvalue },
        Error::NotHurwitz { abscissa, .. } => Error::NotHurwitz { matrix: "A - L C", abscissa },
        Error::NotSchur { radius, .. } => Error::NotSchur { matrix: "A - L C", radius },
        other => other,
    }
}
