//! Structured doubling: an iteration for P with quadratic convergence.

use super::equation::identity;
use crate::Error;
use crate::blocks::{block_2x2, symmetric_part};
use crate::eigen::eigenvalues;
use nalgebra::DMatrix;

const DOUBLINGS: usize = 60;
const METHOD: &str = "structured doubling";

/// Solves A' P (I + G P)^-1 A - P + Q = 0; for G and Q positive semidefinite P is the least solution that is
/// positive semidefinite.
///
/// After k steps `h` is the solution for a horizon of 2^k samples. For an indefinite G the caller checks whether P is
/// the solution that it needs. The error is [`Error::NotConverged`].
pub(super) fn sampled(
    a: &DMatrix<f64>,
    g: &DMatrix<f64>,
    q: &DMatrix<f64>,
) -> Result<DMatrix<f64>, Error> {
    let (mut a, mut g, mut h) = (a.clone(), g.clone(), q.clone());
    let failed = Error::NotConverged { what: METHOD, iterations: DOUBLINGS };
    for _ in 0..DOUBLINGS {
        let inverse = (identity(a.nrows()) + &g * &h).lu();
        let (Some(moved), Some(spread)) = (inverse.solve(&a), inverse.solve(&g)) else {
            return Err(failed);
        };
        let growth = symmetric_part(&(a.tr_mul(&h) * &moved));
        g += symmetric_part(&(&a * spread * a.transpose()));
        h += &growth;
        a = &a * moved;
        if !(growth.amax().is_finite() && g.amax().is_finite() && a.amax().is_finite()) {
            return Err(failed);
        }
        if growth.amax() <= f64::EPSILON * h.amax() {
            return Ok(h);
        }
    }
    Err(failed)
}

/// Solves A' P + P A - P G P + Q = 0, with P as in [`sampled`].
///
/// The Cayley transform with gamma maps an eigenvalue s of the Hamiltonian matrix to (s + gamma) / (s - gamma). gamma
/// is the geometric mean of the smallest modulus above zero and the largest one, so that both eigenvalues converge
/// equally fast. The errors are [`Error::NotConverged`], and [`Error::NotFinite`] if the Hamiltonian matrix is not
/// finite.
pub(super) fn continuous(
    a: &DMatrix<f64>,
    g: &DMatrix<f64>,
    q: &DMatrix<f64>,
) -> Result<DMatrix<f64>, Error> {
    let n = a.nrows();
    let blocks = |a: &DMatrix<f64>| block_2x2([a, &-g], [&-q, &-a.transpose()]);
    let sizes: Vec<f64> = eigenvalues(&blocks(a))?
        .iter()
        .map(|value| value.norm())
        .filter(|&size| size > 0.0)
        .collect();
    let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let gamma = if largest > 0.0 { (least * largest).sqrt() } else { 1.0 };
    // Division by [A - gamma I, -G; -Q, -(A - gamma I)'] gives the pencil its symplectic form.
    let left = blocks(&(a - identity(n) * gamma));
    let right = blocks(&(a + identity(n) * gamma));
    let solved =
        left.lu().solve(&right).ok_or(Error::NotConverged { what: METHOD, iterations: 0 })?;
    let start = solved.view((0, 0), (n, n)).into();
    let g = symmetric_part(&solved.view((0, n), (n, n)).into());
    let h = symmetric_part(&-solved.view((n, 0), (n, n)).into_owned());
    sampled(&start, &g, &h)
}
