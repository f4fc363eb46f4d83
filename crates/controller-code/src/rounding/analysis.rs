//! The effect of the rounding errors of a sample on the loop of plant and controller.

use std::ops::AddAssign as _;

use aso_controller::sample::{Design, Number};
use control::{Domain, StateSpace};
use nalgebra::{DMatrix, DVector, RowDVector};

use super::first_signal;
use super::rounded::{Elements, Rounded, UNIT, Widths, constant_error};
use crate::controller::Controller;
use crate::numbers::{Memory, Numbers, Vectors};
use crate::symbols::{Kind, Matrix, Vector};
use aso_controller::design::{Estimator, SlidingMode};

/// Follows the equations of a sample, and collects the rounding errors.
pub(super) struct Analysis<'a> {
    controller: &'a Controller,
    /// A bound of the elements of `x_r`, states x signals; see [`super::residual_states`].
    state_of_filter: DMatrix<f64>,
    /// The vectors in the order in which they are computed; the last entry of a vector is the present one.
    history: Vec<(Vector, Elements)>,
    /// kappa: for each error a row with the coefficients of the signals.
    errors: Vec<RowDVector<f64>>,
    /// The inputs v of a sliding-mode law.
    chords: Vec<Chord>,
}

/// An input v of a sliding-mode law.
struct Chord {
    /// The position of the row of v in `errors`; the row is zero.
    position: usize,
    /// Half of the largest slope of a chord of the law, rho / (2 delta).
    half_slope: f64,
}

impl<'a> Analysis<'a> {
    /// The analysis of the longest sample: faults are compensated, and no command is at a limit.
    pub(super) fn of(controller: &'a Controller, state_of_filter: DMatrix<f64>) -> Self {
        let mut analysis = Self::new(controller, state_of_filter);
        analysis.follow();
        analysis
    }

    fn new(controller: &'a Controller, state_of_filter: DMatrix<f64>) -> Self {
        let (history, errors, chords) = (Vec::new(), Vec::new(), Vec::new());
        let mut analysis = Self { controller, state_of_filter, history, errors, chords };
        let [n, p] = [Kind::State, Kind::Measurement].map(|kind| analysis.count(kind));
        analysis.start(Vector::StoredXHat, |form| form.columns_mut(n, n).fill_with_identity());
        let q = analysis.count(Kind::Fault);
        analysis.start(Vector::StoredFHat, |form| form.columns_mut(2 * n, q).fill_with_identity());
        let [a, c] = [Matrix::A, Matrix::C].map(|matrix| analysis.matrix(matrix));
        match &controller.filter {
            None => analysis.start(Vector::Measured, |form| {
                form.columns_mut(0, n).copy_from(&c);
            }),
            Some(filter) => {
                // The last states of the design are the filtered measurements, which the controller
                // computes: y_f[k+1] = y_f + w (C x - y_f).
                let first = n - p;
                analysis.start(Vector::StoredYF, |form| {
                    form.columns_mut(first, p).fill_with_identity();
                });
                analysis.start(Vector::Measured, |form| {
                    for (k, w) in filter.iter().enumerate() {
                        let row = a.view((first + k, 0), (1, first)) / *w;
                        form.view_mut((k, 0), (1, first)).copy_from(&row);
                    }
                });
            }
        }
        let integrals = analysis.count(Kind::Integral);
        analysis.start(Vector::StoredXI, |form| {
            form.columns_mut(2 * n + q, integrals).fill_with_identity();
        });
        let k = analysis.count(Kind::ResidualState);
        analysis.start(Vector::StoredXR, |form| {
            form.columns_mut(2 * n + q + integrals, k).fill_with_identity();
        });
        analysis.start(Vector::Referred, |_| {});
        // The measurements contain D times the commands of the sample before, which the controller subtracts again: D
        // times the rounding of these commands as values remains.
        analysis.start(Vector::StoredU, |_| {});
        analysis.start(Vector::StoredUT, |_| {});
        if controller.has(Matrix::D) {
            let deviations = analysis.get(Vector::StoredU).numbers();
            let sums = deviations.into_iter().zip(analysis.get(Vector::UOp).numbers());
            let rounded: Vec<_> = sums.map(|(deviation, point)| deviation + point).collect();
            analysis.record(Vector::StoredU, Elements::of(&rounded, analysis.widths()));
        }
        for vector in [Vector::Measured, Vector::Referred] {
            let mut rounded = analysis.get(vector);
            rounded.error = &rounded.magnitude * UNIT;
            analysis.record(vector, rounded);
        }
        analysis
    }

    fn count(&self, kind: Kind) -> usize {
        kind.count(self.controller)
    }

    /// A matrix of the controller. One that the design does not have is zero; `A_f` is the identity, as faults are
    /// constant then.
    fn matrix(&self, matrix: Matrix) -> DMatrix<f64> {
        let [rows, columns] = matrix.kinds().map(|kind| self.count(kind));
        let default = || match matrix {
            Matrix::AF => DMatrix::identity(rows, columns),
            _ => DMatrix::zeros(rows, columns),
        };
        matrix.of(self.controller).cloned().unwrap_or_else(default)
    }

    /// Number of states of the loop: plant, stored `x_hat`, stored `f_hat`, `x_i`, `x_r`.
    pub(super) fn order(&self) -> usize {
        let [n, q, t, k] = [Kind::State, Kind::Fault, Kind::Integral, Kind::ResidualState]
            .map(|kind| self.count(kind));
        2 * n + q + t + k
    }

    /// The numbers of columns: of linear forms, with room for the errors of 6 vectors of each kind and for v; of
    /// magnitudes, for the signals and 1.
    fn widths(&self) -> Widths {
        let signals: usize = Kind::ALL.map(|kind| self.count(kind)).iter().sum();
        let detection = self.count(Kind::ResidualState) + self.count(Kind::Residual);
        let forms = self.order() + 6 * signals + detection + self.count(Kind::Fault);
        Widths { forms, signals: signals + 1 }
    }

    /// Sets the exact elements of a vector at the start of a sample.
    fn start(&mut self, vector: Vector, fill: impl FnOnce(&mut DMatrix<f64>)) {
        let mut elements = Elements::zero(self.count(vector.kind()), self.widths());
        fill(&mut elements.form);
        elements.magnitude = self.magnitude(vector);
        self.history.push((vector, elements));
    }

    /// The present elements of a vector, or constants of the operating point; zero for a vector that is not computed
    /// yet.
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
        let entry = self.history.iter().rev().find(|(other, _)| *other == vector);
        entry.map_or_else(zero, |(_, elements)| elements.clone())
    }

    /// Bounds of the elements of a vector: rows of coefficients of the largest deviations of the signals, and of 1.
    fn magnitude(&self, vector: Vector) -> DMatrix<f64> {
        let mut magnitude = match vector {
            Vector::StoredXR | Vector::NextXR => return self.state_of_filter.clone(),
            Vector::Residual => return self.residual_magnitude(),
            Vector::S => return self.matrix(Matrix::LF).abs() * self.get(Vector::E).magnitude,
            Vector::E => return self.innovation(&self.get(Vector::XHat).magnitude),
            Vector::StoredXHat | Vector::NextXHat | Vector::XHat if self.is_predicted(vector) => {
                self.matrix(Matrix::A).abs() * self.unit(Kind::State)
                    + self.matrix(Matrix::B).abs() * self.unit(Kind::Actuator)
                    + self.matrix(Matrix::FA).abs() * self.integral_part()
            }
            Vector::StoredFHat | Vector::NextFHat | Vector::FHat | Vector::FHatI
                if self.is_predicted(vector) =>
            {
                self.matrix(Matrix::AF).abs() * self.integral_part()
            }
            Vector::StoredFHat | Vector::NextFHat | Vector::FHatI => self.integral_part(),
            Vector::Y | Vector::StoredYF | Vector::YF | Vector::NextYF => self.measured(),
            _ => self.unit(vector.kind()),
        };
        let signals = match vector {
            Vector::StoredXHat | Vector::XValue | Vector::NextXHat => &self.controller.states,
            Vector::StoredYF | Vector::Measured | Vector::NextYF => &self.controller.measurements,
            Vector::Command => &self.controller.actuators,
            Vector::Referred => &self.controller.references,
            _ => return magnitude,
        };
        let constant = magnitude.ncols() - 1;
        for (i, signal) in signals.iter().enumerate() {
            magnitude[(i, constant)] += signal.operating.abs();
        }
        magnitude
    }

    /// Whether a vector is an estimate that a current estimator has not corrected yet: the size of such an estimate
    /// follows from the signals of the sample before.
    fn is_predicted(&self, vector: Vector) -> bool {
        let is_first = || !self.history.iter().any(|(other, _)| *other == vector);
        let is_current = self.controller.estimator == Estimator::Current;
        is_current
            && match vector {
                Vector::StoredXHat | Vector::NextXHat | Vector::StoredFHat | Vector::NextFHat => {
                    true
                }
                Vector::XHat | Vector::FHatI => is_first(),
                Vector::FHat => !self.controller.has(Matrix::PF) && is_first(),
                _ => false,
            }
    }

    /// The largest deviations of the signals of a kind: rows of the identity, signals of the kind x all signals.
    fn unit(&self, kind: Kind) -> DMatrix<f64> {
        let (rows, signals) = (self.count(kind), self.widths().signals);
        let mut unit = DMatrix::zeros(rows, signals);
        unit.columns_mut(first_signal(kind, self.controller), rows).fill_with_identity();
        unit
    }

    /// A bound of the innovation: |e| <= |y - D u| + |C| |x_hat|.
    fn innovation(&self, x_hat: &DMatrix<f64>) -> DMatrix<f64> {
        self.measured() + self.matrix(Matrix::C).abs() * x_hat
    }

    /// A bound of the measurements without feedthrough: |y - D u| <= |y| + |D| |u|; y without D.
    fn measured(&self) -> DMatrix<f64> {
        let of_commands = self.matrix(Matrix::D).abs() * self.unit(Kind::Actuator);
        self.unit(Kind::Measurement) + of_commands
    }

    /// A bound of the integral part of the fault estimates: |f_hat_i| <= |f_hat| + |P_f| |e| with a direct term, else
    /// |f_hat|.
    fn integral_part(&self) -> DMatrix<f64> {
        let innovation = self.innovation(&self.unit(Kind::State));
        self.unit(Kind::Fault) + self.matrix(Matrix::PF).abs() * innovation
    }

    /// A bound of the residuals, residuals x signals: |r| <= |C| |x_r| + |D_u| |u| + |D_y| |y|.
    fn residual_magnitude(&self) -> DMatrix<f64> {
        let mut all = self.matrix(Matrix::ResidualC).abs() * &self.state_of_filter;
        for (kind, matrix) in
            [(Kind::Actuator, Matrix::ResidualDu), (Kind::Measurement, Matrix::ResidualDy)]
        {
            let first = first_signal(kind, self.controller);
            let direct = self.matrix(matrix).abs();
            all.columns_mut(first, direct.ncols()).add_assign(&direct);
        }
        all
    }

    /// Adds a computed vector to the history; its rounding errors become new error variables w.
    fn record(&mut self, vector: Vector, mut elements: Elements) {
        elements.magnitude = self.magnitude(vector);
        for (i, error) in elements.error.row_iter().enumerate() {
            if error.amax() > 0.0 {
                elements.form[(i, self.order() + self.errors.len())] = 1.0;
                self.errors.push(error.into_owned());
            }
        }
        elements.error.fill(0.0);
        self.history.push((vector, elements));
    }

    /// Follows the equations in the order of `Signals::estimate`, `Signals::set_commands` and `Signals::predict`.
    fn follow(&mut self) {
        let controller = self.controller;
        let numbers = Numbers::of(controller, Rounded::Constant, Rounded::Constant);
        let points = [Vector::XOp, Vector::UOp, Vector::YOp, Vector::ROp];
        let points = points.map(|vector| self.get(vector).numbers());
        let [x_op, u_op, y_op, r_op] = &points;
        let design = Design { x_op, u_op, y_op, r_op, ..numbers.design() };
        let mut memory = Memory::of(|vector| match vector.length(controller) {
            0 => Vec::new(),
            _ => self.get(vector).numbers(),
        });
        let (state, mut vectors) = (memory.state(), Vectors::zero(controller));
        let has_direct_term = controller.has(Matrix::PF);
        let integral = if has_direct_term { Vector::FHatI } else { Vector::FHat };
        vectors.signals().set_deviations(&design, &state);
        self.record_all(&mut vectors, [Vector::Y, Vector::XHat, Vector::YF, Vector::R]);
        self.record_as(&mut vectors, Vector::FHatI, integral);
        if controller.has(Matrix::D) {
            vectors.signals().remove_feedthrough(&design, &state);
            self.record_all(&mut vectors, [Vector::Y]);
        }
        vectors.signals().set_innovation(&design);
        self.record_all(&mut vectors, [Vector::E]);
        if design.is_current {
            vectors.signals().correct_states(&design);
            self.record_all(&mut vectors, [Vector::XHat]);
            if controller.sliding_mode.is_some() {
                vectors.signals().set_sliding_variable(&design);
                self.record_as(&mut vectors, Vector::FHatI, Vector::S);
                let mut injected = Elements::zero(self.count(Kind::Fault), self.widths());
                self.inject(&mut injected);
                vectors.get_mut(Vector::FHatI).clone_from_slice(&injected.numbers());
            } else {
                vectors.signals().correct_faults(&design);
            }
            self.record_as(&mut vectors, Vector::FHatI, integral);
            if has_direct_term {
                vectors.signals().set_innovation(&design);
                self.record_all(&mut vectors, [Vector::E]);
            }
        }
        vectors.signals().add_direct_term(&design, true);
        if has_direct_term {
            self.record_all(&mut vectors, [Vector::FHat]);
        }
        vectors.signals().set_values(&design, &state);
        vectors.signals().set_commands(&design, &state, true);
        self.record_all(&mut vectors, [Vector::XValue, Vector::FValue, Vector::U]);
        vectors.signals().set_command_values(&design);
        self.record_all(&mut vectors, [Vector::Command]);
        // No command is at a limit, so the change by the limits is exactly zero.
        vectors.get_mut(Vector::Excess).fill(Rounded::zero());
        vectors.signals().predict_states(&design);
        vectors.signals().predict_faults(&design, true);
        vectors.signals().predict_filter(&design);
        vectors.signals().predict_integrals(&design, &state);
        self.record_all(
            &mut vectors,
            [Vector::NextXHat, Vector::NextFHat, Vector::NextYF, Vector::NextXI],
        );
        if controller.detection.is_some() {
            let [mut next, mut residuals] = [Kind::ResidualState, Kind::Residual]
                .map(|kind| vec![Rounded::zero(); self.count(kind)]);
            let x_r = self.get(Vector::StoredXR).numbers();
            let signals = vectors.signals();
            let inputs: [&[_]; 3] = [&x_r, signals.u, signals.y];
            numbers.filter_of_residuals().advance(inputs, false, &mut next, &mut residuals);
            self.record(Vector::Residual, Elements::of(&residuals, self.widths()));
            self.record(Vector::NextXR, Elements::of(&next, self.widths()));
        }
    }

    /// Records vectors that the equations have computed, and replaces them by the recorded ones.
    fn record_all<const N: usize>(&mut self, vectors: &mut Vectors<Rounded>, names: [Vector; N]) {
        for vector in names {
            self.record_as(vectors, vector, vector);
        }
    }

    /// Same as [`Self::record_all`] for the vector `meaning`, which the equations store in `place`; does nothing if the
    /// design does not have this vector.
    fn record_as(&mut self, vectors: &mut Vectors<Rounded>, place: Vector, meaning: Vector) {
        let numbers = vectors.get_mut(place);
        if numbers.is_empty() {
            return;
        }
        self.record(meaning, Elements::of(numbers, self.widths()));
        numbers.clone_from_slice(&self.get(meaning).numbers());
    }

    /// Sets `injected` to rho s / (|s| + delta), split into a linear part, half the largest slope times s, and an
    /// input v.
    fn inject(&mut self, injected: &mut Elements) {
        let Some(SlidingMode { rho, delta }) = &self.controller.sliding_mode else { return };
        let s = self.get(Vector::S);
        injected.magnitude = self.magnitude(Vector::FHat);
        for (i, (rho, delta)) in rho.iter().zip(delta).enumerate() {
            let half_slope = rho / (2.0 * delta);
            let position = self.errors.len();
            injected.form.row_mut(i).copy_from(&(s.form.row(i) * half_slope));
            injected.form[(i, self.order() + position)] = 1.0;
            self.errors.push(RowDVector::zeros(self.widths().signals));
            self.chords.push(Chord { position, half_slope });
            // The errors of product, sum, quotient and constants, relative to the result.
            let relative = 3.0 * UNIT + constant_error(*rho) / rho + constant_error(*delta) / delta;
            let rounding = injected.magnitude.row(i) * relative;
            injected.error.row_mut(i).add_assign(&rounding);
        }
    }

    /// A bound of the differences of the outputs, outputs x signals, from the peak-to-peak gains of [`Self::system`]; s
    /// of a sliding-mode law is not among these outputs. An error if the slope of the sliding-mode law changes too much
    /// for the small-gain theorem.
    pub(super) fn bound(&self, gains: &DMatrix<f64>) -> Result<DMatrix<f64>, String> {
        let linear = gains * self.kappa();
        let count = self.chords.len();
        if count == 0 {
            return Ok(linear);
        }
        let outputs = gains.nrows() - count;
        let back = DMatrix::from_fn(gains.nrows(), count, |i, j| {
            let Chord { position, half_slope } = self.chords[j];
            gains[(i, position)] * half_slope
        });
        let Some(loops) = without_loop(&back.rows(outputs, count).into_owned()) else {
            return Err("the slope of the sliding-mode law changes too much for one".to_owned());
        };
        let of_s = loops * linear.rows(outputs, count);
        Ok(linear.rows(0, outputs) + back.rows(0, outputs) * of_s)
    }

    /// Whether [`Self::bound`] for the largest signals is smaller than these signals, so that rounding does not make
    /// the loop unstable.
    pub(super) fn contracts(&self, bound: &DMatrix<f64>) -> bool {
        let [n, q, p, m, _, integrals] = Kind::ALL.map(|kind| self.count(kind));
        let residuals = self.count(Kind::Residual);
        let signals = self.widths().signals - 1;
        let mut all = DMatrix::zeros(signals, signals);
        let mut first = 0;
        for (kind, rows) in [
            (Some(Kind::Actuator), m),
            (Some(Kind::Fault), q),
            (None, residuals),
            (Some(Kind::State), n),
            (Some(Kind::Measurement), p),
            (Some(Kind::Integral), integrals),
        ] {
            if let Some(kind) = kind {
                let place = first_signal(kind, self.controller);
                all.rows_mut(place, rows).copy_from(&bound.view((first, 0), (rows, signals)));
            }
            first += rows;
        }
        without_loop(&all).is_some()
    }

    /// The loop from the errors w, v included, to [u; `f_hat`; r; `x_hat`; y; `x_i`], and s of a sliding-mode law.
    pub(super) fn system(&self) -> StateSpace {
        let ([n, q, p, m, _, integrals], order) =
            (Kind::ALL.map(|kind| self.count(kind)), self.order());
        let inputs = self.errors.len();
        let command = self.get(Vector::Command).form;
        let mut next = DMatrix::zeros(order, self.widths().forms);
        next.view_mut((0, 0), (n, n)).copy_from(&self.matrix(Matrix::A));
        next.rows_mut(0, n).add_assign(&(self.matrix(Matrix::B) * &command));
        if self.controller.filter.is_some() {
            next.rows_mut(n - p, p).copy_from(&self.get(Vector::NextYF).form);
        }
        next.rows_mut(n, n).copy_from(&self.get(Vector::NextXHat).form);
        next.rows_mut(2 * n, q).copy_from(&self.get(Vector::NextFHat).form);
        next.rows_mut(2 * n + q, integrals).copy_from(&self.get(Vector::NextXI).form);
        let [k, residuals] = [Kind::ResidualState, Kind::Residual].map(|kind| self.count(kind));
        next.rows_mut(order - k, k).copy_from(&self.get(Vector::NextXR).form);
        let chords = self.chords.len();
        let sizes = [m, q, residuals, n, p, integrals, chords];
        let mut outputs = DMatrix::zeros(sizes.iter().sum(), self.widths().forms);
        let mut first = 0;
        for (rows, vector) in sizes.into_iter().zip([
            Vector::Command,
            Vector::FValue,
            Vector::Residual,
            Vector::XValue,
            Vector::Measured,
            Vector::StoredXI,
            Vector::S,
        ]) {
            let form = self.get(vector).form;
            outputs.rows_mut(first, rows).copy_from(&form.rows(0, rows));
            first += rows;
        }
        StateSpace {
            a: next.columns(0, order).into_owned(),
            b: next.columns(order, inputs).into_owned(),
            c: outputs.columns(0, order).into_owned(),
            d: outputs.columns(order, inputs).into_owned(),
            domain: Domain::Sampled { period: self.controller.sample_time },
        }
    }

    /// The matrix kappa of the error bounds kappa s, errors x signals.
    fn kappa(&self) -> DMatrix<f64> {
        DMatrix::from_rows(&self.errors)
    }
}

/// (1 - M)^-1 of a matrix M without negative elements; `None` if its spectral radius is not below 1.
fn without_loop(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let count = matrix.nrows();
    let inverse = (DMatrix::identity(count, count) - matrix).try_inverse()?;
    // The spectral radius is below 1 if M x < x for some x > 0; here M x = x - 1.
    let x = &inverse * DVector::from_element(count, 1.0);
    x.iter().all(|entry| *entry >= 1.0 - 1e-9 && entry.is_finite()).then_some(inverse)
}
