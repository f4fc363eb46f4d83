//! Riccati equations: linear-quadratic regulators and Kalman filters.
//!
//! ```text
//! A' P + P A - (P B + N) R^-1 (B' P + N') + Q = 0                        continuous
//! A' P A - P - (A' P B + N) (R + B' P B)^-1 (B' P A + N') + Q = 0        sampled
//! ```
//!
//! Their stabilising solution P gives the feedback u = K x that minimises the integral, or the sum, of x' Q x + 2 x' N
//! u + u' R u. The Kalman filter is the same problem for A' and C'.

mod doubling;
mod equation;
mod existence;
mod kalman;
mod norm_filter;
mod problem;
mod semidefinite;

pub use kalman::{KalmanFilter, kalman};
pub use norm_filter::{NormFilter, NormFilterProblem};

use crate::{Domain, Error, stability};
use nalgebra::{Complex, DMatrix};
use problem::ScaledProblem;

/// Largest residual of a solution that is returned, see [`Regulator::residual`].
const ALLOWED_RESIDUAL: f64 = 1e-9;

/// The weights of the cost x' Q x + 2 x' N u + u' R u.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// Q, n x n, symmetric, with [Q, N; N', R] positive semidefinite.
    pub q: DMatrix<f64>,
    /// R, m x m, symmetric positive definite.
    pub r: DMatrix<f64>,
    /// N, n x m; None for zero.
    pub n: Option<DMatrix<f64>>,
}

/// The stabilising solution of a Riccati equation and its feedback u = K x.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Regulator {
    /// P, n x n, symmetric, positive semidefinite: x' P x is the cost from the initial state x.
    pub p: DMatrix<f64>,
    /// K, m x n: -R^-1 (B' P + N'), sampled -(R + B' P B)^-1 (B' P A + N').
    pub gain: DMatrix<f64>,
    /// Eigenvalues of A + B K.
    pub eigenvalues: Vec<Complex<f64>>,
    /// Largest entry of the left side of the equation relative to the same entry of the sum of its
    /// absolute terms, products included, in balanced coordinates. Here `|P|[i,j]` is at least the root of
    /// `P[i,i] P[j,j]`, and every sum at least 1e-6 of the largest one.
    pub residual: f64,
}

/// The linear-quadratic regulator u = K x for x' = A x + B u, or for `x[k+1] = A x[k] + B u[k]`.
///
/// `a`: n x n; `b`: n x m; `weights`: see [`Weights`], for a sampled system the cost of one sample. Solves the Riccati
/// equation of the domain, see [`crate::riccati`]. The stabilising solution exists and is unique when (A, B) is
/// stabilisable and every mode of A - B R^-1 N' on the stability limit appears in the weight Q - N R^-1 N'. With these
/// two matrices written as A and Q, [A - lambda I, B] and [A - lambda I; Q] in balanced coordinates must then have full
/// rank: their singular values below 1e-13 n of the largest count as zero, and lambda are the eigenvalues of A, and the
/// eigenvalues of A + B K near the limit. Method: balancing of the Hamiltonian, structured doubling (after a Cayley
/// transform for continuous time), then Newton's method, each step a Lyapunov equation for the remainder. About (20 +
/// 15 s) n^3 multiplications for s doublings and 300 n^3 for a step of Newton; usually 5 to 15 doublings and 2 steps.
/// The solution is returned only if A + B K is stable and every entry of the residual is below 1e-9 of the sum of its
/// absolute terms.
///
/// Source: E. K.-W. Chu, H.-Y. Fan and W.-W. Lin, A structure-preserving doubling algorithm for
/// continuous-time algebraic Riccati equations, Linear Algebra Appl. 396 (2005); sampled: with
/// C.-S. Wang, Int. J. Control 77 (2004). Newton: D. L. Kleinman, IEEE Trans. Autom. Control 13
/// (1968); G. A. Hewer, 16 (1971). Balancing: P. Benner, Symplectic balancing of Hamiltonian
/// matrices, SIAM J. Sci. Comput. 22 (2001).
///
/// # Example
///
/// ```
/// use control::Domain;
/// use control::riccati::{Weights, lqr};
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
/// let weights = Weights { q: DMatrix::identity(2, 2), r: DMatrix::identity(1, 1), n: None };
/// let regulator = lqr(&a, &b, &weights, Domain::Continuous)?;
/// let expected = DMatrix::from_row_slice(1, 2, &[-1.0, -3.0_f64.sqrt()]);
/// assert!((regulator.gain - expected).amax() < 1e-14);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::NotSymmetric`] for a bad
/// matrix, [`Error::OutOfRange`] for a bad period; [`Error::NotPositiveDefinite`] for R;
/// [`Error::NotPositiveSemidefinite`] for Q - N R^-1 N'; [`Error::NotStabilisable`];
/// [`Error::Unweighted`]; [`Error::NotConverged`], [`Error::ResidualTooLarge`],
/// [`Error::NotHurwitz`], [`Error::NotSchur`], [`Error::Overflow`] when rounding prevents a
/// solution.
pub fn lqr(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    weights: &Weights,
    domain: Domain,
) -> Result<Regulator, Error> {
    domain.check()?;
    let problem = ScaledProblem::new(a, b, weights, domain)?;
    existence::require(&problem)?;
    let p = problem.refine(&problem.start()?)?;
    let (p, gain) = (problem.restore(&p)?, problem.restore_gain(&p)?);
    let eigenvalues = stability::require_stable("A + B K", &(a + b * &gain), domain)?;
    existence::require_closed(&problem, &eigenvalues)?;
    let residual = problem.residual(&p);
    if residual > ALLOWED_RESIDUAL {
        let (equation, allowed) = ("the Riccati equation", ALLOWED_RESIDUAL);
        return Err(Error::ResidualTooLarge { equation, residual, allowed });
    }
    Ok(Regulator { p, gain, eigenvalues, residual })
}
