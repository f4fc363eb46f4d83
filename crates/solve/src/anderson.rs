//! Anderson's mixing.

use serde::{Deserialize, Serialize};

use super::secants::Secants;
use super::{Progress, Scale, Solver, Watch};

/// A difference of which less than this part is new is dropped.
const FILTER: f64 = 1e-10;

/// Anderson's mixing of the last iterates, without damping:
/// `u_next = G(u) - dG c`, c the least squares solution of `dR c = r`, with the residual
/// `r = G(u) - u` and the differences dR, dG of the last `depth` residuals and values.
///
/// D. G. Anderson 1965, "Iterative procedures for nonlinear integral equations"; in the form of
/// Walker and Ni 2011, "Anderson acceleration for fixed-point iterations", equation 2.2. For linear
/// G of n unknowns and `depth >= n` it ends after at most n + 2 evaluations, whatever the gain; each
/// solution starts afresh. `O(n depth^2)` operations each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Anderson {
    watch: Watch,
    secants: Secants,
    /// Residual and values of the last evaluation.
    last: (Vec<f64>, Vec<f64>),
}

impl Anderson {
    /// At most `limit` evaluations of G, differences of the last `depth` of them (at least 1, and no
    /// more than there are unknowns).
    #[must_use]
    pub fn new(scale: Scale, limit: u32, depth: usize) -> Self {
        let n = scale.len();
        let secants = Secants::new(n, depth.clamp(1, n.max(1)));
        Self { watch: Watch::new(scale, limit), secants, last: (vec![0.0; n], vec![0.0; n]) }
    }
}

impl Solver for Anderson {
    fn begin(&mut self) {
        self.watch.begin();
        self.secants.clear();
    }

    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress {
        if let Some(end) = self.watch.look(u, g) {
            return end;
        }
        let residual = &self.watch.residual;
        self.secants.learn(&mut self.last, (residual, g), self.watch.iterations <= 1);
        self.secants.apply(residual, &self.watch.weights, (FILTER, FILTER), (g, u_next));
        Progress::Evaluate
    }

    fn scale(&self) -> &Scale {
        &self.watch.scale
    }

    fn forget(&mut self) {
        self.secants.clear();
    }
}
