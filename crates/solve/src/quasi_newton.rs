//! Interface quasi-Newton iteration.

use serde::{Deserialize, Serialize};

use super::secants::{Evaluation, Filters, Secants};
use super::{Convergence, Progress, Scale, Solver};

/// Relative norms below which orthogonalised differences of this and of earlier solutions are dropped.
const FILTERS: Filters = Filters { present: 1e-10, earlier: 1e-3 };
/// Relaxation factor of a step without stored differences.
const RELAXATION: f64 = 0.1;
/// Largest number of stored differences, if there are more unknowns.
const MAX_DIFFERENCES: usize = 100;

/// Interface quasi-Newton iteration with a least squares model of the inverse (IQN-ILS):
/// `u_next = G(u) + W c`.
///
/// c is the least squares solution of `V c = -r`, r the residual `G(u) - u`; the columns of V and W are
/// differences of residuals and of values of G in this and in earlier solutions. A step for which
/// no differences are stored is relaxed, `u_next = u + 0.1 r`.
///
/// Degroote, Bathe and Vierendeels 2009, "Performance of a new partitioned procedure versus a
/// monolithic procedure in fluid-structure interaction", section 4. Differences of earlier solutions are
/// used from the first evaluation, so that a loop that changes slowly from step to step needs two or
/// three evaluations. Newer differences have priority over older ones.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct QuasiNewton {
    convergence: Convergence,
    secants: Secants,
    /// The number of solutions for which a difference is reused.
    reuse: u32,
    last: Evaluation,
}

impl QuasiNewton {
    /// Creates a solver with at most `limit` evaluations of G that reuses the differences of the last
    /// `reuse` solutions.
    #[must_use]
    pub fn new(scale: Scale, limit: u32, reuse: u32) -> Self {
        let n = scale.len();
        let secants = Secants::new(n, n.clamp(1, MAX_DIFFERENCES));
        let last = Evaluation::new(n);
        Self { convergence: Convergence::new(scale, limit), secants, reuse, last }
    }
}

impl Solver for QuasiNewton {
    fn begin(&mut self) {
        self.convergence.begin();
        self.secants.age_pairs(self.reuse);
    }

    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress {
        if let Some(end) = self.convergence.check(u, g) {
            return end;
        }
        let residual = &self.convergence.residual;
        self.secants.learn(&mut self.last, residual, g, self.convergence.iterations <= 1);
        if self.secants.is_empty() {
            for ((next, u), residual) in u_next.iter_mut().zip(u).zip(residual) {
                *next = u + RELAXATION * residual;
            }
            return Progress::Evaluate;
        }
        self.secants.apply(residual, &self.convergence.weights, FILTERS, g, u_next);
        Progress::Evaluate
    }

    fn scale(&self) -> &Scale {
        &self.convergence.scale
    }

    fn forget(&mut self) {
        self.secants.clear();
    }
}
