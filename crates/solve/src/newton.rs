//! Simplified Newton iteration, which reuses its matrix while it converges fast enough.

use serde::{Deserialize, Serialize};

use super::dense::{Factors, norm_1};
use super::{Convergence, Progress, Scale, Solver};

/// Ratio of two consecutive residuals above which the solver requests a new matrix.
const SLOW_DECREASE: f64 = 0.3;
/// The smallest damping factor, after which the solver requests a new matrix.
const SHORTEST: f64 = 1.0 / 64.0;
/// Required decrease of the residual relative to the decrease that a linear model predicts (Armijo
/// condition).
const DESCENT: f64 = 1e-4;
/// Condition number above which a difference quotient has no significant digits left.
const SINGULAR: f64 = 1e10;

/// The result of the last call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    /// No call in this solution.
    First,
    /// The solver has requested the matrix at the present point.
    MatrixRequested,
    /// A step with the matrix computed at its start.
    NewMatrix,
    /// A step with the matrix of an earlier step or solution.
    OldMatrix,
    /// A return to the start of a rejected step, to request the matrix there.
    Returned,
}

/// Newton's method: `u_next = u + s d`, `(I - dG/du) d = G(u) - u`.
///
/// The solver requests the matrix at the first evaluation ([`Progress::Matrix`]) and reuses it, also in
/// later solutions, until the residual decreases too slowly: the simplified Newton iteration of
/// implicit integrators (Hairer and Wanner 1996, section IV.8). The damping factor `s` is 1 and is
/// halved while the residual increases (Armijo 1966). The linear system, with unknowns divided by their
/// nominals, is solved by LU factorisation with row pivoting and one step of iterative refinement.
/// Linear loops need one matrix and two evaluations for any gain.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Newton {
    convergence: Convergence,
    /// `I - dG/du`, column by column, for unknowns divided by their nominals.
    matrix: Vec<f64>,
    factors: Factors,
    /// Whether `factors` are usable: not before the first matrix, after a singular one or [`Solver::forget`].
    known: bool,
    /// The start u of the last step.
    base: Vec<f64>,
    /// The direction d of the last step.
    direction: Vec<f64>,
    /// The damping factor s of the last step.
    part: f64,
    /// The merit ([`Convergence::merit`]) at the start of the last step.
    before: f64,
    stage: Stage,
    /// The residual of the linear system, then the correction of the direction by iterative refinement.
    left: Vec<f64>,
}

impl Newton {
    /// Creates a solver with at most `limit` evaluations of G, not counting evaluations for matrices.
    #[must_use]
    pub fn new(scale: Scale, limit: u32) -> Self {
        let n = scale.len();
        Self {
            convergence: Convergence::new(scale, limit),
            matrix: vec![0.0; n * n],
            factors: Factors::new(n),
            known: false,
            base: vec![0.0; n],
            direction: vec![0.0; n],
            part: 1.0,
            before: 0.0,
            stage: Stage::First,
            left: vec![0.0; n],
        }
    }

    fn request_matrix(&mut self) -> Progress {
        self.stage = Stage::MatrixRequested;
        Progress::Matrix
    }

    /// Factorises the requested matrix; [`Progress::Singular`] if it is numerically singular.
    fn factorise_matrix(&mut self) -> Result<(), Progress> {
        let norm = norm_1(&self.matrix, self.base.len());
        let condition = self.factors.factor(&self.matrix) * (1.0 + norm);
        self.known = condition <= SINGULAR;
        if self.known { Ok(()) } else { Err(Progress::Singular { condition }) }
    }

    /// Computes an undamped step from `u` with the last matrix; `None` if its direction is not finite.
    fn step(&mut self, u: &[f64], u_next: &mut [f64]) -> Option<Progress> {
        let nominals = self.convergence.scale.nominals();
        for ((entry, residual), nominal) in
            self.direction.iter_mut().zip(&self.convergence.residual).zip(nominals)
        {
            *entry = residual / nominal;
        }
        self.factors.solve(&mut self.direction);
        self.refine();
        for (entry, nominal) in self.direction.iter_mut().zip(self.convergence.scale.nominals()) {
            *entry *= nominal;
        }
        if self.direction.iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        self.base.copy_from_slice(u);
        (self.before, self.part) = (self.convergence.merit, 1.0);
        Some(self.write_next(u_next))
    }

    /// Refines the direction by one step of iterative refinement (Golub and Van Loan 2013, section 3.5.3).
    fn refine(&mut self) {
        let n = self.base.len();
        let nominals = self.convergence.scale.nominals();
        for ((left, residual), nominal) in
            self.left.iter_mut().zip(&self.convergence.residual).zip(nominals)
        {
            *left = residual / nominal;
        }
        for (column, factor) in self.matrix.chunks_exact(n).zip(&self.direction) {
            for (left, entry) in self.left.iter_mut().zip(column) {
                *left -= entry * factor;
            }
        }
        self.factors.solve(&mut self.left);
        for (entry, left) in self.direction.iter_mut().zip(&self.left) {
            *entry += left;
        }
    }

    /// Writes the damped step `u + s d` to `u_next`.
    fn write_next(&self, u_next: &mut [f64]) -> Progress {
        for ((next, base), direction) in u_next.iter_mut().zip(&self.base).zip(&self.direction) {
            *next = base + self.part * direction;
        }
        Progress::Evaluate
    }

    /// Handles a last step that did not decrease the residual enough. Returns to the start of a step with an old
    /// matrix; otherwise halves the step. Requests the matrix after the shortest step or a slow decrease. `None` if
    /// the decrease is fast enough.
    fn correct(&mut self, u_next: &mut [f64]) -> Option<Progress> {
        let merit = self.convergence.merit;
        if merit > self.before * (1.0 - DESCENT * self.part) {
            if self.stage == Stage::OldMatrix {
                self.stage = Stage::Returned;
                u_next.copy_from_slice(&self.base);
                return Some(Progress::Evaluate);
            }
            if self.part > SHORTEST {
                self.part /= 2.0;
                return Some(self.write_next(u_next));
            }
            return Some(self.request_matrix());
        }
        (merit > SLOW_DECREASE * self.before).then(|| self.request_matrix())
    }
}

impl Solver for Newton {
    fn begin(&mut self) {
        self.convergence.begin();
        self.stage = Stage::First;
    }

    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress {
        let next = if self.stage == Stage::MatrixRequested {
            if let Err(end) = self.factorise_matrix() {
                return end;
            }
            Stage::NewMatrix
        } else {
            if let Some(end) = self.convergence.check(u, g) {
                return end;
            }
            if !self.known || self.stage == Stage::Returned {
                return self.request_matrix();
            }
            if self.stage != Stage::First
                && let Some(other) = self.correct(u_next)
            {
                return other;
            }
            Stage::OldMatrix
        };
        self.stage = next;
        let iterations = self.convergence.iterations;
        self.step(u, u_next).unwrap_or(Progress::Diverged { iterations })
    }

    fn set_column(&mut self, column: usize, values: &[f64]) {
        let n = self.base.len();
        let nominals = self.convergence.scale.nominals();
        let entries = &mut self.matrix[column * n..(column + 1) * n];
        for (row, (entry, value)) in entries.iter_mut().zip(values).enumerate() {
            let unit = if row == column { 1.0 } else { 0.0 };
            *entry = unit - value * nominals[column] / nominals[row];
        }
    }

    fn scale(&self) -> &Scale {
        &self.convergence.scale
    }

    fn forget(&mut self) {
        self.known = false;
    }
}
