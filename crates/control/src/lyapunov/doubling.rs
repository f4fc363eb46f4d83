//! Lyapunov equations by doubling.

use super::LeftSide;
use crate::Domain;
use crate::blocks::symmetric_part;
use nalgebra::DMatrix;

const DOUBLINGS: usize = 60;

/// M' P M - P = -Q by P = sum of M'^k Q M^k, twice as many terms in each step.
///
/// The equation A' P + P A = -Q takes this form by the Cayley transform with gamma > 0,
///
/// ```text
/// M = (A + gamma I) F,  Q_M = 2 gamma F' Q F,  F = (A - gamma I)^-1
/// ```
///
/// Source: R. A. Smith, Matrix equation XA + BX = C, SIAM J. Appl. Math. 16 (1968).
pub(super) struct Doubling<'a> {
    a: &'a DMatrix<f64>,
    /// M, M^2, M^4, ...
    powers: Vec<DMatrix<f64>>,
    /// gamma and F.
    cayley: Option<(f64, DMatrix<f64>)>,
}

impl<'a> Doubling<'a> {
    /// None if a power overflows or does not decay: A is not clearly stable.
    pub(super) fn new(a: &'a DMatrix<f64>, domain: Domain) -> Option<Self> {
        let identity = DMatrix::identity(a.nrows(), a.nrows());
        let (first, cayley) = match domain {
            Domain::Sampled { .. } => (a.clone(), None),
            Domain::Continuous => {
                // Slow and fast modes decay equally fast for the geometric mean of their rates.
                let slowest = 1.0 / a.clone().try_inverse()?.norm();
                let gamma = (slowest * a.norm()).sqrt();
                let inverse = (a - &identity * gamma).try_inverse()?;
                (&identity + &inverse * (2.0 * gamma), Some((gamma, inverse)))
            }
        };
        let mut powers = vec![first];
        for _ in 0..DOUBLINGS {
            let last = &powers[powers.len() - 1];
            let size = last.norm();
            if size * size <= f64::EPSILON {
                return Some(Self { a, powers, cayley });
            }
            if !size.is_finite() {
                return None;
            }
            let next = last * last;
            powers.push(next);
        }
        None
    }

    /// The solution for Q, refined once; `remainder` is the left side plus Q. None if it overflows.
    pub(super) fn solve(&self, q: &DMatrix<f64>, remainder: LeftSide) -> Option<DMatrix<f64>> {
        let mut p = self.sum(q);
        p += self.sum(&remainder(self.a, &p, q));
        let p = symmetric_part(&p);
        p.iter().all(|entry| entry.is_finite()).then_some(p)
    }

    fn sum(&self, q: &DMatrix<f64>) -> DMatrix<f64> {
        let mut p = match &self.cayley {
            None => q.clone(),
            Some((gamma, inverse)) => inverse.transpose() * (q * inverse) * (2.0 * gamma),
        };
        for power in &self.powers {
            let later = power.transpose() * (&p * power);
            p += later;
        }
        p
    }
}
