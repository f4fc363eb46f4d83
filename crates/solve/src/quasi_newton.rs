//! Interface quasi-Newton.

use serde::{Deserialize, Serialize};

use super::secants::Secants;
use super::{Progress, Scale, Solver, Watch};

/// Parts below which differences of this solution and of earlier ones are dropped.
const FILTERS: (f64, f64) = (1e-10, 1e-3);
/// The part of the residual taken where nothing is known yet.
const RELAXATION: f64 = 0.1;
/// Most differences that are kept.
const MOST: usize = 100;

/// Interface quasi-Newton with the inverse of the matrix from a least squares model:
/// `u_next = G(u) + W c`, c the least squares solution of `V c = -r`, with the residual
/// `r = G(u) - u`, the columns of V and W differences of residuals and values of this solution and the
/// last ones. The very first step is relaxed, `u_next = u + 0.1 r`.
///
/// Degroote, Bathe and Vierendeels 2009, "Performance of a new partitioned procedure versus a
/// monolithic procedure in fluid-structure interaction", section 4 (IQN-ILS). What earlier solutions have
/// taught is used from the first evaluation on, so that a loop that changes slowly from step to step
/// soon needs two or three; newer differences go before older ones.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct QuasiNewton {
    watch: Watch,
    secants: Secants,
    reuse: u32,
    last: (Vec<f64>, Vec<f64>),
}

impl QuasiNewton {
    /// At most `limit` evaluations of G; differences of the last `reuse` solutions are used again.
    #[must_use]
    pub fn new(scale: Scale, limit: u32, reuse: u32) -> Self {
        let n = scale.len();
        let secants = Secants::new(n, n.clamp(1, MOST));
        Self { watch: Watch::new(scale, limit), secants, reuse, last: (vec![0.0; n], vec![0.0; n]) }
    }
}

impl Solver for QuasiNewton {
    fn begin(&mut self) {
        self.watch.begin();
        self.secants.grow_older(self.reuse);
    }

    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress {
        if let Some(end) = self.watch.look(u, g) {
            return end;
        }
        let residual = &self.watch.residual;
        self.secants.learn(&mut self.last, (residual, g), self.watch.iterations <= 1);
        if self.secants.is_empty() {
            for ((next, u), residual) in u_next.iter_mut().zip(u).zip(residual) {
                *next = u + RELAXATION * residual;
            }
            return Progress::Evaluate;
        }
        self.secants.apply(residual, &self.watch.weights, FILTERS, (g, u_next));
        Progress::Evaluate
    }

    fn scale(&self) -> &Scale {
        &self.watch.scale
    }

    fn forget(&mut self) {
        self.secants.clear();
    }
}
