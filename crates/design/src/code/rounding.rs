//! A bound of what single precision changes.
//!
//! Every statement of the recursion computes its sum with an error of at most
//!
//! ```text
//! kappa s,   s = the largest deviations of x_hat, f_hat, y and u from the operating point, and 1
//! ```
//!
//! from the rounding of its constants, products and partial sums: r |a| |v| for a product a v, r times the
//! magnitudes added so far for a sum, r = 2^-24 (N. J. Higham, Accuracy and Stability of Numerical
//! Algorithms, 2002, equation (2.4) and section 3.1). The errors w of all statements enter the loop of
//! plant and controller,
//!
//! ```text
//! d[k+1] = A d[k] + B w[k],   [du; df_hat] = C d[k] + D w[k],   d = [dx; dx_hat; df_hat]
//! ```
//!
//! so that G kappa s bounds the differences of the outputs, with the peak-to-peak gains G of that system.
//! The bound holds in the loop of the design, while faults are compensated and no command is at a limit.
//! The residuals r of a detection are further outputs, and x_r is part of d; their size follows from those of y
//! and u. The bound takes the worst case of every rounding; errors of both signs cancel in practice. A scheduled loop is
//! not such a system, and has no bound.

use std::ops::AddAssign as _;

use control::response::peak_gain;
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector, RowDVector};

use super::controller::Controller;
use super::recursion::{Operation, Recursion, Statement, Term};
use super::summary::{Fields, aligned, filled};
use super::symbols::{Kind, Matrix, Vector};

/// The relative rounding error of single precision.
const UNIT: f64 = 5.960_464_477_539_063e-8;
/// For products of rounding errors, for the width of the peak gains, for the printed digits.
const SECOND_ORDER: f64 = 1.001;
/// The relative width of the peak gains.
const WIDTH: f64 = 0.02;
/// The largest order of the loop whose peak gains are computed.
const LARGEST_ORDER: usize = 60;
/// The part of a signal by which its rounding errors may change it before that is a warning.
const COARSE: f64 = 0.01;

/// The bound, or the reason why there is none.
pub(super) struct RoundingBound {
    /// Outputs (commands, faults, residuals) x signals (as [`Kind::ALL`], then 1).
    bound: Result<DMatrix<f64>, String>,
    /// 1 - |lambda| of the slowest eigenvalue of the loop.
    slowest: f64,
}

impl RoundingBound {
    pub(super) fn of(controller: &Controller, recursion: &Recursion) -> Self {
        if controller.schedule.is_some() {
            let reason = "matrices and operating point change with the scheduling variable";
            return Self { bound: Err(reason.to_owned()), slowest: f64::NAN };
        }
        let state_of_filter = match residual_states(controller) {
            Ok(gains) => gains,
            Err(error) => return Self { bound: Err(error.to_string()), slowest: f64::NAN },
        };
        let mut analysis = Analysis::new(controller, state_of_filter);
        for statement in recursion.longest() {
            analysis.follow(statement);
        }
        let order = analysis.order();
        if order > LARGEST_ORDER {
            let reason =
                format!("{order} states of plant and controller are too many to compute it");
            return Self { bound: Err(reason), slowest: f64::NAN };
        }
        let system = analysis.system();
        let domain = Domain::Sampled { period: controller.sample_time };
        let slowest =
            control::stability::instability(&system.a, domain).map_or(f64::NAN, |own| -own);
        let gains = peak_gain(&system, WIDTH).map(|gain| gain.upper * analysis.kappa());
        let bound =
            gains.map(|bound| bound * SECOND_ORDER).map_err(|error: Error| error.to_string());
        Self { bound, slowest }
    }

    /// What makes single precision too coarse for this design.
    pub(super) fn warnings(&self, controller: &Controller) -> Vec<String> {
        let bound = match &self.bound {
            Ok(bound) => bound,
            Err(reason) => {
                return vec![format!("float: no bound of the rounding errors: {reason}")];
            }
        };
        let first = |kind| first_signal(kind, controller);
        let commands = controller.actuators.iter().enumerate();
        let commands = commands.map(|(j, own)| (&own.name, bound[(j, first(Kind::Actuator) + j)]));
        let (m, faults) = (controller.actuators.len(), controller.faults.iter().enumerate());
        let faults = faults.map(|(i, own)| (&own.name, bound[(m + i, first(Kind::Fault) + i)]));
        let coarse = commands.chain(faults).filter(|(_, part)| *part > COARSE);
        coarse
            .map(|(name, part)| {
                format!(
                    "float: rounding may change {name} by {:.2} % of itself: the slowest eigenvalue of \
                     the loop is 1 - {:.1e}, and rounding errors add up over its time; use double, or a \
                     longer sample time",
                    100.0 * part,
                    self.slowest
                )
            })
            .collect()
    }

    /// The lines of the header.
    pub(super) fn lines(&self, controller: &Controller, fields: &Fields) -> Vec<String> {
        let bound = match &self.bound {
            Ok(bound) => bound,
            Err(reason) => return filled(&format!("No bound of the difference: {reason}.")),
        };
        let mut outputs: Vec<_> =
            fields.actuators.iter().map(|field| format!("Commands.{field}")).collect();
        outputs.extend(fields.faults.iter().map(|field| format!("Estimates.f_hat_{field}")));
        let residuals = bound.nrows() - outputs.len();
        outputs.extend((0..residuals).map(|k| format!("Detection.residual[{k}]")));
        let mut signals = named("x_hat_", &fields.states);
        signals.extend(named("f_hat_", &fields.faults));
        signals.extend(named("", &fields.measurements));
        signals.extend(named("", &fields.actuators));
        signals.extend(named("", &fields.references));
        signals.extend(named("x_i_", &fields.integrals));
        signals.push("1".to_owned());
        let intact = match controller.reconfiguration {
            None => "",
            Some(_) => " and no actuator gone",
        };
        let mut lines = filled(&format!(
            "In the loop with the plant of the design, while compensating and with no command at a limit{intact}, \
             an output differs by at most the sum over the signals of coefficient times largest \
             deviation from the operating point (last row: a constant):"
        ));
        for (output, row) in outputs.into_iter().zip(bound.row_iter()) {
            lines.extend([String::new(), output]);
            let rows = signals.iter().zip(row.iter());
            let rows: Vec<_> =
                rows.map(|(name, own)| [format!("  {name}"), format!("{own:.4e}")]).collect();
            lines.extend(aligned(&rows));
        }
        lines
    }
}

/// A bound of the elements of `x_r` in a run from the operating point, states x signals: the peak-to-peak
/// gains of the filter from the commands and the measurements.
fn residual_states(controller: &Controller) -> Result<DMatrix<f64>, Error> {
    let signals: usize = Kind::ALL.map(|kind| kind.count(controller)).iter().sum();
    let k = Kind::ResidualState.count(controller);
    let mut all = DMatrix::zeros(k, signals + 1);
    let Some(own) = &controller.detection else { return Ok(all) };
    for (kind, b) in [(Kind::Actuator, &own.b_u), (Kind::Measurement, &own.b_y)] {
        let system = StateSpace {
            a: own.a.clone(),
            b: b.clone(),
            c: DMatrix::identity(k, k),
            d: DMatrix::zeros(k, b.ncols()),
            domain: Domain::Sampled { period: controller.sample_time },
        };
        let gain = peak_gain(&system, WIDTH)?.upper;
        all.columns_mut(first_signal(kind, controller), b.ncols()).copy_from(&gain);
    }
    Ok(all)
}

/// The place of the signals of a kind among all signals.
fn first_signal(kind: Kind, controller: &Controller) -> usize {
    let before = Kind::ALL.into_iter().take_while(|other| *other != kind);
    before.map(|other| other.count(controller)).sum()
}

fn named(start: &str, fields: &[String]) -> Vec<String> {
    fields.iter().map(|field| format!("{start}{field}")).collect()
}

/// The elements of a vector: what they are made of, and how exact they are.
#[derive(Clone)]
struct Elements {
    /// Elements x (states of the loop, then errors w): the difference from exact arithmetic.
    form: DMatrix<f64>,
    /// Elements x signals: a bound of the absolute value.
    magnitude: DMatrix<f64>,
    /// Elements x signals: a bound of the errors that are not among w.
    error: DMatrix<f64>,
}

impl Elements {
    fn zero(rows: usize, (forms, signals): (usize, usize)) -> Self {
        let none = DMatrix::zeros(rows, signals);
        Self { form: DMatrix::zeros(rows, forms), magnitude: none.clone(), error: none }
    }

    /// Adds `sign` times other elements; a sum with zero has no error.
    fn add(&mut self, other: &Self, sign: f64) {
        self.form += &other.form * sign;
        self.error += &other.error;
        for (mut row, other) in self.magnitude.row_iter_mut().zip(other.magnitude.row_iter()) {
            row += other;
        }
        for i in 0..self.error.nrows() {
            if other.magnitude.row(i).iter().any(|part| *part > 0.0) {
                let rounding = self.magnitude.row(i) * UNIT;
                self.error.row_mut(i).add_assign(&rounding);
            }
        }
    }

    /// Multiplies by a constant.
    fn scale(&mut self, factor: f64) {
        self.form *= factor;
        self.error = &self.error * factor + &self.magnitude * product_error(factor);
        self.magnitude *= factor;
    }

    /// Adds row i of `matrix` times `vector` to element i, one product after the other.
    fn accumulate(&mut self, matrix: &DMatrix<f64>, vector: &Self) {
        self.form += matrix * &vector.form;
        for (i, row) in matrix.row_iter().enumerate() {
            for (j, &entry) in row.iter().enumerate().filter(|(_, entry)| **entry != 0.0) {
                let factor = vector.magnitude.row(j);
                let is_first = self.magnitude.row(i).amax() == 0.0;
                self.magnitude.row_mut(i).add_assign(&(factor * entry.abs()));
                let sum = if is_first { 0.0 } else { UNIT };
                let rounding = factor * product_error(entry) + self.magnitude.row(i) * sum;
                self.error.row_mut(i).add_assign(&rounding);
            }
        }
    }
}

/// The error of a product with `entry`, relative to the other factor: of the constant and of the
/// product.
fn product_error(entry: f64) -> f64 {
    let is_power_of_two = entry.to_bits().trailing_zeros() >= 52;
    let product = if is_power_of_two { 0.0 } else { entry.abs() * UNIT };
    product + constant_error(entry)
}

/// The error of a constant in single precision.
#[expect(clippy::cast_possible_truncation, reason = "the error is what is computed")]
fn constant_error(value: f64) -> f64 {
    (value - f64::from(value as f32)).abs()
}

/// Follows the statements of a sample.
struct Analysis<'a> {
    controller: &'a Controller,
    /// A bound of the elements of `x_r`, states x signals; see [`residual_states`].
    state_of_filter: DMatrix<f64>,
    known: Vec<(Vector, Elements)>,
    /// kappa: a row over the signals for each error.
    errors: Vec<RowDVector<f64>>,
}

impl<'a> Analysis<'a> {
    fn new(controller: &'a Controller, state_of_filter: DMatrix<f64>) -> Self {
        let (known, errors) = (Vec::new(), Vec::new());
        let mut own = Self { controller, state_of_filter, known, errors };
        let [n, p] = [Kind::State, Kind::Measurement].map(|kind| own.count(kind));
        own.start(Vector::StoredXHat, |form| form.columns_mut(n, n).fill_with_identity());
        let q = own.count(Kind::Fault);
        own.start(Vector::StoredFHat, |form| form.columns_mut(2 * n, q).fill_with_identity());
        match &controller.filter {
            None => own.start(Vector::Measured, |form| {
                form.columns_mut(0, n).copy_from(&controller.c);
            }),
            Some(filter) => {
                // The last states of the design are the filtered measurements, which the controller
                // computes: y_f[k+1] = y_f + w (C x - y_f).
                let first = n - p;
                own.start(Vector::StoredYF, |form| {
                    form.columns_mut(first, p).fill_with_identity();
                });
                own.start(Vector::Measured, |form| {
                    for (k, w) in filter.iter().enumerate() {
                        let row = controller.a.view((first + k, 0), (1, first)) / *w;
                        form.view_mut((k, 0), (1, first)).copy_from(&row);
                    }
                });
            }
        }
        let integrals = own.count(Kind::Integral);
        own.start(Vector::StoredXI, |form| {
            form.columns_mut(2 * n + q, integrals).fill_with_identity();
        });
        let k = own.count(Kind::ResidualState);
        own.start(Vector::StoredXR, |form| {
            form.columns_mut(2 * n + q + integrals, k).fill_with_identity();
        });
        own.start(Vector::Referred, |_| {});
        for vector in [Vector::Measured, Vector::Referred] {
            let mut rounded = own.get(vector);
            rounded.error = &rounded.magnitude * UNIT;
            own.learn(vector, rounded);
        }
        own
    }

    fn count(&self, kind: Kind) -> usize {
        kind.count(self.controller)
    }

    /// States of the loop: plant, stored `x_hat`, stored `f_hat`, `x_i`, `x_r`.
    fn order(&self) -> usize {
        let [n, q, t, k] = [Kind::State, Kind::Fault, Kind::Integral, Kind::ResidualState]
            .map(|kind| self.count(kind));
        2 * n + q + t + k
    }

    /// The columns of forms, with room for the errors of 6 vectors of each kind, and the signals.
    fn widths(&self) -> (usize, usize) {
        let signals: usize = Kind::ALL.map(|kind| self.count(kind)).iter().sum();
        let detection = self.count(Kind::ResidualState) + self.count(Kind::Residual);
        (self.order() + 6 * signals + detection, signals + 1)
    }

    /// Sets the exact elements of a vector at the start of a sample.
    fn start(&mut self, vector: Vector, fill: impl FnOnce(&mut DMatrix<f64>)) {
        let mut elements = Elements::zero(self.count(vector.kind()), self.widths());
        fill(&mut elements.form);
        elements.magnitude = self.magnitude(vector);
        self.known.push((vector, elements));
    }

    /// A vector as it is now; zero if no statement has computed it.
    fn get(&self, vector: Vector) -> Elements {
        let operating = match vector {
            Vector::XOp => Some(&self.controller.states),
            Vector::UOp => Some(&self.controller.actuators),
            Vector::YOp => Some(&self.controller.measurements),
            Vector::ROp => Some(&self.controller.references),
            _ => None,
        };
        let zero = || Elements::zero(self.count(vector.kind()), self.widths());
        if let Some(signals) = operating {
            let mut constant = zero();
            let last = constant.error.ncols() - 1;
            for (i, signal) in signals.iter().enumerate() {
                constant.magnitude[(i, last)] = signal.operating.abs();
                constant.error[(i, last)] = constant_error(signal.operating);
            }
            return constant;
        }
        let found = self.known.iter().rev().find(|(other, _)| *other == vector);
        found.map_or_else(zero, |(_, elements)| elements.clone())
    }

    /// A bound of the elements of a vector, from the largest deviations of the signals.
    fn magnitude(&self, vector: Vector) -> DMatrix<f64> {
        let (rows, signals) = (self.count(vector.kind()), self.widths().1);
        match vector {
            Vector::StoredXR | Vector::NextXR => return self.state_of_filter.clone(),
            Vector::Residual => return self.residual_magnitude(),
            _ => {}
        }
        let mut own = DMatrix::zeros(rows, signals);
        own.columns_mut(first_signal(vector.kind(), self.controller), rows).fill_with_identity();
        let operating = match vector {
            Vector::StoredXHat | Vector::XValue | Vector::NextXHat => &self.controller.states,
            Vector::StoredYF | Vector::Measured | Vector::NextYF => &self.controller.measurements,
            Vector::Command => &self.controller.actuators,
            Vector::Referred => &self.controller.references,
            Vector::E => {
                let c = self.controller.c.abs();
                own.columns_mut(0, c.ncols()).copy_from(&c);
                return own;
            }
            _ => return own,
        };
        for (i, signal) in operating.iter().enumerate() {
            own[(i, signals - 1)] = signal.operating.abs();
        }
        own
    }

    /// |r| <= |C| |x_r| + |D_u| |u| + |D_y| |y|, residuals x signals.
    fn residual_magnitude(&self) -> DMatrix<f64> {
        let Some(own) = &self.controller.detection else {
            return DMatrix::zeros(0, self.widths().1);
        };
        let mut all = own.c.abs() * &self.state_of_filter;
        for (kind, matrix) in [(Kind::Actuator, &own.d_u), (Kind::Measurement, &own.d_y)] {
            let first = first_signal(kind, self.controller);
            all.columns_mut(first, matrix.ncols()).add_assign(&matrix.abs());
        }
        all
    }

    /// Takes the elements that a statement computes; their errors become elements of w.
    fn learn(&mut self, vector: Vector, mut elements: Elements) {
        elements.magnitude = self.magnitude(vector);
        for (i, error) in elements.error.row_iter().enumerate() {
            if error.amax() > 0.0 {
                elements.form[(i, self.order() + self.errors.len())] = 1.0;
                self.errors.push(error.into_owned());
            }
        }
        elements.error.fill(0.0);
        self.known.push((vector, elements));
    }

    fn follow(&mut self, statement: &Statement) {
        match statement.target {
            // No output of the loop and no later statement has these.
            Vector::XValue | Vector::XIValue | Vector::V => return,
            // Without limits it is exactly zero.
            Vector::Excess => {
                let zero = Elements::zero(self.count(Kind::Actuator), self.widths());
                self.known.push((Vector::Excess, zero));
                return;
            }
            _ => {}
        }
        let rows = self.count(statement.target.kind());
        let mut sum = self.term(statement.start, rows);
        for operation in &statement.operations {
            match *operation {
                Operation::Add(term) => sum.add(&self.term(term, rows), 1.0),
                Operation::Subtract(term) => sum.add(&self.term(term, rows), -1.0),
                Operation::Accumulate(matrix, vector) => self.accumulate(&mut sum, matrix, vector),
                Operation::TimesPeriod => sum.scale(self.controller.sample_time),
            }
        }
        self.learn(statement.target, sum);
    }

    fn accumulate(&self, sum: &mut Elements, matrix: Matrix, vector: Vector) {
        if let Some(matrix) = matrix.of(self.controller) {
            sum.accumulate(matrix, &self.get(vector));
        }
    }

    fn term(&self, term: Term, rows: usize) -> Elements {
        let mut own = Elements::zero(rows, self.widths());
        match term {
            Term::Zero => {}
            Term::Element(vector) => own = self.get(vector),
            Term::Product(matrix, vector) => {
                self.accumulate(&mut own, matrix, vector);
            }
            Term::FilterStep => {
                let mut difference = self.get(Vector::Y);
                difference.add(&self.get(Vector::YF), -1.0);
                let filter = self.controller.filter.as_deref().unwrap_or_default();
                let diagonal = DMatrix::from_diagonal(&DVector::from_column_slice(filter));
                own.accumulate(&diagonal, &difference);
                own.error += diagonal * difference.error;
            }
        }
        own
    }

    /// The loop from the errors w to [u; `f_hat`; r].
    fn system(&self) -> StateSpace {
        let ([n, q, p, m, _, integrals], order) =
            (Kind::ALL.map(|kind| self.count(kind)), self.order());
        let inputs = self.errors.len();
        let command = self.get(Vector::Command).form;
        let mut next = DMatrix::zeros(order, self.widths().0);
        next.view_mut((0, 0), (n, n)).copy_from(&self.controller.a);
        next.rows_mut(0, n).add_assign(&(&self.controller.b * &command));
        if self.controller.filter.is_some() {
            next.rows_mut(n - p, p).copy_from(&self.get(Vector::NextYF).form);
        }
        next.rows_mut(n, n).copy_from(&self.get(Vector::NextXHat).form);
        next.rows_mut(2 * n, q).copy_from(&self.get(Vector::NextFHat).form);
        next.rows_mut(2 * n + q, integrals).copy_from(&self.get(Vector::NextXI).form);
        let [k, residuals] = [Kind::ResidualState, Kind::Residual].map(|kind| self.count(kind));
        next.rows_mut(order - k, k).copy_from(&self.get(Vector::NextXR).form);
        let mut outputs = DMatrix::zeros(m + q + residuals, self.widths().0);
        outputs.rows_mut(0, m).copy_from(&command);
        outputs.rows_mut(m, q).copy_from(&self.get(Vector::FValue).form);
        outputs.rows_mut(m + q, residuals).copy_from(&self.get(Vector::Residual).form);
        StateSpace {
            a: next.columns(0, order).into_owned(),
            b: next.columns(order, inputs).into_owned(),
            c: outputs.columns(0, order).into_owned(),
            d: outputs.columns(order, inputs).into_owned(),
            domain: Domain::Sampled { period: self.controller.sample_time },
        }
    }

    /// kappa, errors x signals.
    fn kappa(&self) -> DMatrix<f64> {
        DMatrix::from_rows(&self.errors)
    }
}
