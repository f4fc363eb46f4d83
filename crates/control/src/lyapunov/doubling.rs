//! Lyapunov equations by doubling.

use super::LeftSide;
use crate::Domain;
use crate::blocks::symmetric_part;
use nalgebra::DMatrix;

const DOUBLINGS: usize = 60;

/// Solves the equation of the domain by doubling.
///
/// M' P M - P = -Q has P = sum of M'^k Q M^k; each step doubles the number of terms. The result is refined once. The
/// equation A' P + P A = -Q takes this form by the Cayley transform with gamma > 0,
///
/// ```text
/// M = (A + gamma I) F,  Q_M = 2 gamma F' Q F,  F = (A - gamma I)^-1
/// ```
///
/// `remainder`: the left side plus Q. None if a power of M overflows or does not decay (A is not clearly stable), if a
/// matrix has no inverse, or if P overflows.
///
/// Source: R. A. Smith, Matrix equation XA + BX = C, SIAM J. Appl. Math. 16 (1968).
pub(super) fn solve_by_doubling(
    a: &DMatrix<f64>,
    q: &DMatrix<f64>,
    domain: Domain,
    remainder: LeftSide,
) -> Option<DMatrix<f64>> {
    let identity = DMatrix::identity(a.nrows(), a.nrows());
    let (first, cayley) = match domain {
        Domain::Sampled { .. } => (a.clone(), None),
        Domain::Continuous => {
            // With gamma the geometric mean of the slowest and the fastest rate, both decay equally fast in M^k.
            let slowest = 1.0 / a.clone().try_inverse()?.norm();
            let gamma = (slowest * a.norm()).sqrt();
            let inverse = (a - &identity * gamma).try_inverse()?;
            (&identity + &inverse * (2.0 * gamma), Some((gamma, inverse)))
        }
    };
    let powers = powers(first)?;
    let sum = |q: &DMatrix<f64>| {
        let mut p = match &cayley {
            None => q.clone(),
            Some((gamma, inverse)) => inverse.transpose() * (q * inverse) * (2.0 * gamma),
        };
        for power in &powers {
            let later = power.transpose() * (&p * power);
            p += later;
        }
        p
    };
    let mut p = sum(q);
    p += sum(&remainder(a, &p, q));
    let p = symmetric_part(&p);
    p.iter().all(|entry| entry.is_finite()).then_some(p)
}

/// M, M^2, M^4, ... up to the first one whose square is negligible; None if there is none among 60, or one overflows.
fn powers(first: DMatrix<f64>) -> Option<Vec<DMatrix<f64>>> {
    let mut powers = vec![first];
    for _ in 0..DOUBLINGS {
        let last = &powers[powers.len() - 1];
        let size = last.norm();
        if size * size <= f64::EPSILON {
            return Some(powers);
        }
        if !size.is_finite() {
            return None;
        }
        let next = last * last;
        powers.push(next);
    }
    None
}
