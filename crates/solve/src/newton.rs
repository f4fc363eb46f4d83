//! Newton's method with a matrix that is kept as long as it serves.

use serde::{Deserialize, Serialize};

use super::dense::{Factors, largest_column};
use super::{Progress, Scale, Solver, Watch};

/// A residual that falls to more than this part asks for a new matrix.
const SLOW: f64 = 0.3;
/// The smallest part of a step that is tried.
const SHORTEST: f64 = 1.0 / 64.0;
/// The residual must fall by at least this part of what a whole step would take away
/// (Armijo's condition).
const DESCENT: f64 = 1e-4;
/// Above this condition number nothing is left of the digits of a difference quotient.
const SINGULAR: f64 = 1e10;

/// What the last call led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    /// There was none in this solution.
    First,
    /// The matrix was asked for, and belongs to the same point.
    Asked,
    /// A step with the matrix made where the step begins.
    NewMatrix,
    /// A step with one made elsewhere.
    OldMatrix,
    /// Back to the begin of a bad step, to ask for the matrix there.
    Back,
}

/// Newton's method: `u_next = u + s d`, `(I - dG/du) d = G(u) - u`.
///
/// The matrix is asked for at the first evaluation ([`Progress::Matrix`]) and kept, also for later
/// solutions, until the residual falls too slowly: the simplified Newton iteration of implicit
/// integrators (Hairer and Wanner 1996, section IV.8). `s` is 1; where that makes the residual larger it is halved
/// (Armijo 1966). Solved by LU factorisation with row pivoting, the unknowns measured by their
/// nominals, and refined once. Linear loops need one matrix and two evaluations, whatever their gain.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Newton {
    watch: Watch,
    /// `I - dG/du`, column by column, in nominals.
    matrix: Vec<f64>,
    factors: Factors,
    known: bool,
    /// Where the last step began, its direction, the part of it taken, the residual at its begin.
    base: Vec<f64>,
    direction: Vec<f64>,
    part: f64,
    before: f64,
    stage: Stage,
    left: Vec<f64>,
}

impl Newton {
    /// At most `limit` evaluations of G, those for matrices not counted.
    #[must_use]
    pub fn new(scale: Scale, limit: u32) -> Self {
        let n = scale.len();
        Self {
            watch: Watch::new(scale, limit),
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

    fn ask(&mut self) -> Progress {
        self.stage = Stage::Asked;
        Progress::Matrix
    }

    /// Whether the matrix that was asked for can be solved with.
    fn take_matrix(&mut self) -> Result<(), Progress> {
        let norm = largest_column(&self.matrix, self.base.len());
        let condition = self.factors.factor(&self.matrix) * (1.0 + norm);
        self.known = condition <= SINGULAR;
        if self.known { Ok(()) } else { Err(Progress::Singular { condition }) }
    }

    /// A step in the direction of the last matrix; none where that cannot be solved for.
    fn step(&mut self, u: &[f64], u_next: &mut [f64]) -> Option<Progress> {
        let nominals = self.watch.scale.nominals();
        for ((entry, residual), nominal) in
            self.direction.iter_mut().zip(&self.watch.residual).zip(nominals)
        {
            *entry = residual / nominal;
        }
        self.factors.solve(&mut self.direction);
        self.refine();
        for (entry, nominal) in self.direction.iter_mut().zip(self.watch.scale.nominals()) {
            *entry *= nominal;
        }
        if self.direction.iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        self.base.copy_from_slice(u);
        (self.before, self.part) = (self.watch.merit, 1.0);
        Some(self.place(u_next))
    }

    /// One step of iterative refinement (Golub and Van Loan 2013, section 3.5.3).
    fn refine(&mut self) {
        let n = self.base.len();
        let nominals = self.watch.scale.nominals();
        for ((left, residual), nominal) in
            self.left.iter_mut().zip(&self.watch.residual).zip(nominals)
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

    fn place(&self, u_next: &mut [f64]) -> Progress {
        for ((next, base), direction) in u_next.iter_mut().zip(&self.base).zip(&self.direction) {
            *next = base + self.part * direction;
        }
        Progress::Evaluate
    }

    /// What to do instead of a step from here, if the last one was not good.
    fn correct(&mut self, u_next: &mut [f64]) -> Option<Progress> {
        let merit = self.watch.merit;
        if merit > self.before * (1.0 - DESCENT * self.part) {
            if self.stage == Stage::OldMatrix {
                self.stage = Stage::Back;
                u_next.copy_from_slice(&self.base);
                return Some(Progress::Evaluate);
            }
            if self.part > SHORTEST {
                self.part /= 2.0;
                return Some(self.place(u_next));
            }
            return Some(self.ask());
        }
        (merit > SLOW * self.before).then(|| self.ask())
    }
}

impl Solver for Newton {
    fn begin(&mut self) {
        self.watch.begin();
        self.stage = Stage::First;
    }

    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress {
        let next = if self.stage == Stage::Asked {
            if let Err(end) = self.take_matrix() {
                return end;
            }
            Stage::NewMatrix
        } else {
            if let Some(end) = self.watch.look(u, g) {
                return end;
            }
            if !self.known || self.stage == Stage::Back {
                return self.ask();
            }
            if self.stage != Stage::First
                && let Some(other) = self.correct(u_next)
            {
                return other;
            }
            Stage::OldMatrix
        };
        self.stage = next;
        let iterations = self.watch.iterations;
        self.step(u, u_next).unwrap_or(Progress::Diverged { iterations })
    }

    fn set_column(&mut self, column: usize, values: &[f64]) {
        let n = self.base.len();
        let nominals = self.watch.scale.nominals();
        let entries = &mut self.matrix[column * n..(column + 1) * n];
        for (row, (entry, value)) in entries.iter_mut().zip(values).enumerate() {
            let unit = if row == column { 1.0 } else { 0.0 };
            *entry = unit - value * nominals[column] / nominals[row];
        }
    }

    fn scale(&self) -> &Scale {
        &self.watch.scale
    }

    fn forget(&mut self) {
        self.known = false;
    }
}
