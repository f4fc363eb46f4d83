//! Operations per sample and bytes of a controller.

use nalgebra::DMatrix;

use super::Precision;
use super::controller::Controller;
use super::recursion::{Operation, Recursion, Statement, Term, When};
use super::schedule::operating_vectors;
use super::symbols::{Kind, Matrix, Vector};
use super::tables::{Constants, locals, stored, tables};

/// The most operations of one sample: while compensating, with every command at its upper limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Arithmetic {
    pub(super) multiplications: usize,
    /// Additions and subtractions.
    pub(super) additions: usize,
    pub(super) comparisons: usize,
    pub(super) divisions: usize,
}

impl Arithmetic {
    pub(super) fn of(controller: &Controller, recursion: &Recursion) -> Self {
        let mut all = Self::default();
        let statements = recursion.statements();
        for statement in statements.filter(|own| own.when != When::NotCompensating) {
            all.add_statement(controller, statement);
        }
        let [n, q, p, m, t, integrals] = Kind::ALL.map(|kind| kind.count(controller));
        let filtered = if controller.filter.is_some() { p } else { 0 };
        all.add_schedule(controller, [n, p, m, t]);
        // Finite or not: the inputs, the commands and estimates, the state for the next sample.
        all.comparisons += 2 * (p + t + m + n + q + n + q + filtered + integrals);
        if controller.is_limited() {
            all.comparisons += 2 * m;
        }
        // E_hat = -(u scale) f_hat, scale = 1 / (u u + u_e^2).
        let losses = controller.losses.len();
        all.multiplications += 3 * losses;
        all.additions += losses;
        all.divisions += losses;
        all
    }

    /// The place in the grid, the operating point there, the limits as deviations from it.
    fn add_schedule(&mut self, controller: &Controller, [n, p, m, t]: [usize; 4]) {
        let Some(schedule) = &controller.schedule else { return };
        let vectors = n + p + m + t;
        self.multiplications += 2 * vectors;
        // theta + 0, two differences and their quotient, 1 - part.
        self.additions += vectors + 4;
        self.divisions += 1;
        self.comparisons += schedule.points.len() + 2 * controller.schedule_inputs().len();
        if controller.is_limited() {
            self.additions += 2 * m;
        }
    }

    fn add_statement(&mut self, controller: &Controller, statement: &Statement) {
        let rows = statement.target.kind().count(controller);
        self.add_term(controller, statement.start, rows);
        for operation in &statement.operations {
            match *operation {
                Operation::Add(term) | Operation::Subtract(term) => {
                    self.additions += rows;
                    self.add_term(controller, term, rows);
                }
                Operation::Accumulate(matrix, _) => self.add_products(controller, matrix, rows),
                Operation::TimesPeriod => self.multiplications += rows,
            }
        }
    }

    fn add_term(&mut self, controller: &Controller, term: Term, rows: usize) {
        match term {
            Term::Zero | Term::Element(_) => {}
            Term::Product(matrix, _) => self.add_products(controller, matrix, rows),
            Term::FilterStep => {
                self.multiplications += rows;
                self.additions += rows;
            }
        }
    }

    fn add_products(&mut self, controller: &Controller, matrix: Matrix, rows: usize) {
        let count = rows * matrix.of(controller).map_or(0, DMatrix::ncols);
        self.multiplications += count;
        self.additions += count;
        if controller.scheduled(matrix).is_some() {
            self.multiplications += 2 * count;
            self.additions += count;
        }
    }
}

/// Bytes of a controller, program code aside.
pub(super) struct Memory {
    /// One instance.
    pub(super) state: usize,
    /// The vectors on the stack during a sample.
    pub(super) stack: usize,
    /// The constants.
    pub(super) constants: usize,
}

impl Memory {
    pub(super) fn of(controller: &Controller, recursion: &Recursion, precision: Precision) -> Self {
        let size = precision.size();
        let count = |vector: Vector| vector.kind().count(controller);
        let stored: usize = stored(controller).into_iter().map(count).sum();
        // The commands of the sample before.
        let stored = stored + Kind::Actuator.count(controller) + controller.schedule_inputs().len();
        let flags = usize::from(controller.filter.is_some());
        let counter = if controller.first_compensated > 0 { 4 } else { 0 };
        let mut stack: usize = locals(recursion).into_iter().map(count).sum();
        if controller.schedule.is_some() {
            let operating = operating_vectors(controller);
            stack += operating.into_iter().map(|(vector, _)| count(vector)).sum::<usize>() + 2;
            let limits = if controller.is_limited() { 2 } else { 0 };
            stack += limits * Kind::Actuator.count(controller);
        }
        let tables: usize = tables(controller, recursion).iter().map(Constants::count).sum();
        Self {
            state: (stored * size + counter + flags).next_multiple_of(size),
            stack: stack * size,
            constants: tables * size,
        }
    }
}
