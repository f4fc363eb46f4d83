//! Conditions for a stabilising solution.

use super::problem::ScaledProblem;
use crate::blocks::{stacked, to_complex};
use crate::check::as_number;
use crate::eigen::eigenvalues;
use crate::svd::ComplexSvd;
use crate::{Domain, Error};
use nalgebra::{Complex, DMatrix, SymmetricEigen};

/// A relative singular value below this times the number of states counts as zero.
const TOLERANCE_PER_STATE: f64 = 1e-13;
/// Eigenvalues closer than this to the stability limit, relative to the norm of A, do not count as stable.
const NEAR: f64 = 1e-12;
/// Largest distance, relative to the norm of A, by which rounding moves a mode of A + B K off the stability limit if
/// the mode does not appear in Q: about the root of the residual of P.
const MOVED: f64 = 1e-4;

/// Checks that (A, B) is stabilisable and that every mode on the stability limit appears in Q; otherwise
/// [`Error::NotStabilisable`] with the eigenvalue, [`Error::Unweighted`] with the point of the limit, or
/// [`Error::NotConverged`].
pub(super) fn require(problem: &ScaledProblem) -> Result<(), Error> {
    let (a, b, domain) = (&problem.decoupled_a, &problem.equation.b, problem.equation.domain);
    let all = eigenvalues(a)?;
    for &eigenvalue in all.iter().filter(|eigenvalue| eigenvalue.im >= 0.0) {
        if domain.excess(eigenvalue) >= -NEAR * a.norm()
            && is_deficient(&a.transpose(), &b.transpose(), eigenvalue)?
        {
            return Err(Error::NotStabilisable { eigenvalue });
        }
    }
    require_weights(problem, &all)
}

/// Checks that the modes of A + B K near the stability limit appear in Q; otherwise [`Error::Unweighted`] or
/// [`Error::NotConverged`].
///
/// Rounding splits a multiple eigenvalue of A, so that [`require`] may miss a mode on the limit. If this mode does not
/// appear in Q, it is a simple eigenvalue of A + B K, near the limit up to rounding errors.
pub(super) fn require_closed(
    problem: &ScaledProblem,
    closed: &[Complex<f64>],
) -> Result<(), Error> {
    let (limit, domain) = (-MOVED * problem.decoupled_a.norm(), problem.equation.domain);
    let near = closed.iter().copied().filter(|&value| domain.excess(value) >= limit);
    require_weights(problem, &near.collect::<Vec<_>>())
}

/// Checks that every mode on the stability limit appears in Q, at the points of the limit nearest to `eigenvalues`.
fn require_weights(problem: &ScaledProblem, eigenvalues: &[Complex<f64>]) -> Result<(), Error> {
    let (a, domain) = (&problem.decoupled_a, problem.equation.domain);
    let lower_bound = smallest_weight(a, &problem.decoupled_q);
    for eigenvalue in eigenvalues.iter().filter(|eigenvalue| eigenvalue.im >= 0.0) {
        let limit = match domain {
            Domain::Continuous => Complex::new(0.0, eigenvalue.im),
            Domain::Sampled { .. } => Complex::from_polar(1.0, eigenvalue.arg()),
        };
        // Bounds of the singular values of [A - lambda I; Q] that show full rank without a decomposition.
        let upper_bound = 2.0 * a.norm() + limit.norm();
        let appears = lower_bound > tolerance(a) * upper_bound;
        if !appears && is_deficient(a, &problem.decoupled_q, limit)? {
            return Err(Error::Unweighted { weight: "Q", eigenvalue: limit });
        }
    }
    Ok(())
}

/// Whether [A - lambda I; C] has less than full column rank, C scaled to the size of A.
fn is_deficient(a: &DMatrix<f64>, c: &DMatrix<f64>, lambda: Complex<f64>) -> Result<bool, Error> {
    let n = a.nrows();
    let size = if a.norm() > 0.0 { a.norm() } else { 1.0 };
    let unit = if c.norm() > 0.0 { size / c.norm() } else { 1.0 };
    let mut pencil = to_complex(&stacked(a, &(c * unit)));
    for i in 0..n {
        pencil[(i, i)] -= lambda;
    }
    Ok(ComplexSvd::new(&pencil)?.rank(tolerance(a)) < n)
}

/// Relative size of a singular value that counts as zero.
fn tolerance(a: &DMatrix<f64>) -> f64 {
    TOLERANCE_PER_STATE * as_number(a.nrows())
}

/// A lower bound of the singular values of [A - lambda I; Q] for every lambda, with Q scaled to the size of A: the
/// smallest eigenvalue of Q minus its rounding error; NaN for Q = 0.
fn smallest_weight(a: &DMatrix<f64>, q: &DMatrix<f64>) -> f64 {
    let (size, n) = (a.norm() / q.norm(), q.nrows());
    let eigen = SymmetricEigen::try_new(q.clone(), f64::EPSILON, 100 * n);
    eigen.map_or(0.0, |eigen| size * (eigen.eigenvalues.min() - tolerance(a) * q.norm()))
}
