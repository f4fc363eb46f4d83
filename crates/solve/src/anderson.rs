//! Anderson mixing.

use serde::{Deserialize, Serialize};

use super::secants::{Evaluation, Filters, Secants};
use super::{Convergence, Progress, Scale, Solver};

/// Relative norm, after orthogonalisation, below which a difference is dropped as linearly dependent.
const FILTERS: Filters = Filters { present: 1e-10, earlier: 1e-10 };

/// Anderson mixing without damping: `u_next = G(u) - dG c`.
///
/// c is the least squares solution of `dR c = r`, r the residual `G(u) - u`; the columns of dR and dG
/// are the differences of the last `depth` residuals and values of G.
///
/// D. G. Anderson 1965, "Iterative procedures for nonlinear integral equations"; in the form of
/// Walker and Ni 2011, "Anderson acceleration for fixed-point iterations", equation 2.2. For linear
/// G of n unknowns and `depth >= n` it converges after at most n + 2 evaluations for any gain. Each
/// solution starts without history. `O(n depth^2)` operations per evaluation.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Anderson {
    convergence: Convergence,
    secants: Secants,
    last: Evaluation,
}

impl Anderson {
    /// Creates a solver: at most `limit` evaluations of G, `depth` differences (1 to the number of unknowns).
    #[must_use]
    pub fn new(scale: Scale, limit: u32, depth: usize) -> Self {
        let n = scale.len();
        let secants = Secants::new(n, depth.clamp(1, n.max(1)));
        Self { convergence: Convergence::new(scale, limit), secants, last: Evaluation::new(n) }
    }
}

impl Solver for Anderson {
    fn begin(&mut self) {
        self.convergence.begin();
        self.secants.clear();
    }

    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress {
        if let Some(end) = self.convergence.check(u, g) {
            return end;
        }
        let residual = &self.convergence.residual;
        self.secants.learn(&mut self.last, residual, g, self.convergence.iterations <= 1);
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
