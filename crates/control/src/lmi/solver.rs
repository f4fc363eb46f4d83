//! The interface to the solver Clarabel.

use super::affine::Affine;
use super::limit::{self, Ending};
use aso_lapack as _;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT as Cone,
};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::SQRT_2;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// The state in which the solver ended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// The tolerances of the solver were met, or almost.
    Solved,
    /// The solver stopped before the tolerances were met.
    Stalled,
}

/// Minimises `objective`' x subject to every matrix being positive semidefinite. None if the problem is infeasible or
/// unbounded, the solver failed, or the condition of [`limit::ending`] is true. The result is not verified.
///
/// The solver receives the upper triangle of each matrix column by column, off-diagonal entries times sqrt(2).
pub(super) fn minimise(
    objective: &DVector<f64>,
    matrices: &[Affine],
) -> Option<(DVector<f64>, End)> {
    if limit::is_over() {
        return None;
    }
    let unknowns = objective.len();
    let mut cones = Vec::with_capacity(matrices.len());
    let mut right = Vec::new();
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for matrix in matrices {
        let order = matrix.shape().0;
        cones.push(if order == 1 {
            Cone::NonnegativeConeT(1)
        } else {
            Cone::PSDTriangleConeT(order)
        });
        for (unknown, m) in &matrix.terms {
            for (row, value) in triangle(m).into_iter().enumerate() {
                if value != 0.0 {
                    rows.push(right.len() + row);
                    columns.push(*unknown);
                    values.push(-value);
                }
            }
        }
        right.extend(triangle(&matrix.constant));
    }
    let program = Program {
        left: CscMatrix::new_from_triplets(right.len(), unknowns, rows, columns, values),
        right,
        costs: objective.as_slice().to_vec(),
        cones,
    };
    match limit::ending() {
        None => program.solve(None),
        Some(ending) => program.solve_until(&ending),
    }
}

/// A program in the form of Clarabel: minimise `costs`' x subject to `right` - `left` x in the product of `cones`.
struct Program {
    left: CscMatrix<f64>,
    right: Vec<f64>,
    costs: Vec<f64>,
    cones: Vec<Cone<f64>>,
}

/// Interval at which a waiting caller checks its condition.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

impl Program {
    /// Solves in a separate thread and stops waiting when `ending` is true: one iteration of a large program takes
    /// minutes. The thread ends after its current iteration. None if `ending` was true first, or without a solution.
    fn solve_until(self, ending: &Ending) -> Option<(DVector<f64>, End)> {
        let (sender, receiver) = channel();
        let solver_ending = Ending::clone(ending);
        let solve = move || drop(sender.send(self.solve(Some(solver_ending))));
        // None if no thread can be created.
        thread::Builder::new().name("inequalities".to_owned()).spawn(solve).ok()?;
        loop {
            match receiver.recv_timeout(POLL_INTERVAL) {
                Ok(solution) => return solution,
                Err(RecvTimeoutError::Timeout) if !ending() => {}
                Err(_) => return None,
            }
        }
    }

    /// Solves in this thread, until `ending` is true after an iteration.
    fn solve(&self, ending: Option<Ending>) -> Option<(DVector<f64>, End)> {
        let Self { left, right, costs, cones } = self;
        let quadratic = CscMatrix::zeros((costs.len(), costs.len()));
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            direct_solve_method: "qdldl".to_owned(),
            chordal_decomposition_enable: false,
            ..DefaultSettings::default()
        };
        let solver = DefaultSolver::new(&quadratic, costs, left, right, cones, settings);
        let mut solver = solver.ok()?;
        if let Some(ending) = ending {
            solver.set_termination_callback(move |_: &_| ending());
        }
        solver.solve();
        let solution = &solver.solution;
        let end = match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => End::Solved,
            SolverStatus::InsufficientProgress | SolverStatus::MaxIterations => End::Stalled,
            _ => return None,
        };
        let finite = solution.x.iter().all(|value| value.is_finite());
        finite.then(|| (DVector::from_column_slice(&solution.x), end))
    }
}

/// The upper triangle of the symmetric part, column by column, off-diagonal entries times sqrt(2).
fn triangle(m: &DMatrix<f64>) -> Vec<f64> {
    let mut entries = Vec::with_capacity(m.nrows() * (m.nrows() + 1) / 2);
    for col in 0..m.ncols() {
        entries.extend((0..col).map(|row| (m[(row, col)] + m[(col, row)]) / SQRT_2));
        entries.push(m[(col, col)]);
    }
    entries
}
