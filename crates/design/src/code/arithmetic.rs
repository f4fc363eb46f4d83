//! Operations per sample and bytes of a controller.

use nalgebra::DMatrix;

use super::Precision;
use super::constants::Constants;
use super::controller::Controller;
use super::detection::{Detection, Method};
use super::recursion::{Operation, Recursion, Statement, Term};
use super::symbols::{Kind, Matrix, Vector};
use super::tables::{locals, operating_vectors, stored, tables};

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
        for statement in recursion.longest() {
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
        if controller.d.is_some() {
            // Deviations of the commands for the next sample.
            all.comparisons += 2 * m;
        }
        all.add_detection(controller);
        if let Some(own) = &controller.reconfiguration {
            // K_s times the commands of stuck actuators, the commands with that sum; the losses.
            all.multiplications += m * own.most_gone();
            all.additions += m * own.most_gone() + 2 * m;
            all.comparisons += own.cases.len();
        }
        // E_hat = -(u scale) f_hat, scale = 1 / (u u + u_e^2); the two ends of the range.
        let losses = controller.losses.len();
        all.comparisons += 2 * losses;
        all.multiplications += 3 * losses;
        all.additions += losses;
        all.divisions += losses;
        all
    }

    /// Adds what a schedule needs: its place in the grid, the operating point there, the limits as deviations from it.
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

    /// Adds the most that the tests of a detection need in a sample: each window ends, and each test gives an alarm.
    fn add_detection(&mut self, controller: &Controller) {
        let Some(own) = &controller.detection else { return };
        let (residuals, tests) = (own.c.nrows(), own.tests.len());
        // Finite or not: the residuals and the next state of their filter.
        self.comparisons += 2 * (residuals + own.a.nrows());
        match own.method {
            // Two sums of three terms; each from 0 on, finite or not, above 0; the larger one; the threshold.
            Method::Cusum => {
                self.additions += 4 * tests;
                self.comparisons += 10 * tests;
            }
            // Sums of two terms, finite or not; their squares; s, finite or not; the threshold.
            Method::Window => {
                self.additions += 2 * residuals;
                self.multiplications += residuals;
                self.divisions += tests;
                self.comparisons += 2 * residuals + 3 * tests;
            }
        }
        // Two times in s.
        self.multiplications += 2;
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
            Term::Injection => {
                self.multiplications += rows;
                self.comparisons += rows;
                self.additions += rows;
                self.divisions += rows;
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
        let mut stored: usize = stored(controller).into_iter().map(count).sum();
        // The commands of the sample before.
        stored += Kind::Actuator.count(controller) + controller.schedule_inputs().len();
        let mut counters = usize::from(controller.has_counter());
        let mut flags = usize::from(controller.filter.is_some());
        if let Some(own) = &controller.detection {
            stored += own.stored();
            counters += own.counters();
            flags += own.flags();
        }
        if let Some(own) = &controller.reconfiguration {
            let cases = own.cases.len();
            stored += cases;
            counters += cases + 2;
            flags += Kind::Actuator.count(controller) + 2 * cases;
        }
        let losses = controller.losses.len();
        let mut stack: usize = losses + locals(recursion).into_iter().map(count).sum::<usize>();
        if controller.schedule.is_some() {
            let operating = operating_vectors(controller);
            stack += operating.into_iter().map(|(vector, _)| count(vector)).sum::<usize>() + 2;
            let limits = if controller.is_limited() { 2 } else { 0 };
            stack += limits * Kind::Actuator.count(controller);
        }
        let integers = controller.detection.as_ref().map_or(0, Detection::integer_bytes);
        let [actuators, faults] = [Kind::Actuator, Kind::Fault].map(|kind| kind.count(controller));
        let of_cases = controller.reconfiguration.as_ref();
        let of_cases = of_cases.map_or(0, |cases| cases.integer_bytes(actuators, faults));
        // Of each loss its fault, its actuator and u_e^2.
        let of_losses = losses * (8 + size);
        let tables: usize = tables(controller, recursion).iter().map(Constants::count).sum();
        Self {
            state: (stored * size + 4 * counters + flags).next_multiple_of(size),
            stack: stack * size,
            constants: tables * size + integers + of_cases + of_losses,
        }
    }
}
