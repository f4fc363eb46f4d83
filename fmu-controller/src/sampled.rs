//! The observer of a sampled controller, which acts at t_k = t_start + k T and holds u in between.
//!
//! With z = [x_hat; f_hat; y_f; x_i; u_t], e = y - C x_hat (with a filter, y_f - C x_hat), z[k|k-1] estimated
//! from the measurements before sample k, and the matrices of the sampled plant,
//!
//! ```text
//! current:     x_hat[k|k] = x_hat[k|k-1] + L_x e[k]       f_hat[k|k] = f_hat[k|k-1] + L_f e[k]
//!              u[k] = K_x x_hat[k|k] + K_f f_hat[k|k]
//!              x_hat[k+1|k] = A x_hat[k|k] + B u[k] + F_a f_hat[k|k]
//!              f_hat[k+1|k] = A_f f_hat[k|k]
//! prediction:  u[k] = K_x x_hat[k|k-1] + K_f f_hat[k|k-1]
//!              x_hat[k+1|k] = A x_hat[k|k-1] + B u[k] + F_a f_hat[k|k-1] + L_x e[k]
//!              f_hat[k+1|k] = A_f f_hat[k|k-1] + L_f e[k]
//! both:        y_f[k+1] = y_f[k] + W (y[k] - y_f[k])
//!              x_i[k+1] = x_i[k] + T (r[k] - H y[k] + F_i f_hat) + L_w (u[k] - free command)
//!              u_t[k+1] = u_t[k] - w u_t[k]
//! ```
//!
//! with K_i x_i[k] + N_r r[k] + u_t[k] in u[k], and f_hat in x_i[k+1] the one that u[k] uses: the terms of
//! `equations.rs` for references. f_hat changes only while estimating, K_f f_hat is in u only while compensating, and u
//! is kept within its limits. A design without A_f has A_f = I. In a design with a direct term P_f, z has f_hat_i in
//! place of f_hat, and f_hat[k] = f_hat_i + P_f (y[k] - C x_hat) with the estimates that u[k] uses. A sliding-mode law
//! has f_hat[k|k] = rho L_f e[k] / (|L_f e[k]| + delta), element by element. All signals are deviations from the
//! operating point. In a design with D, the measurement contains D u[k-1], and y[k] is the measurement without it;
//! u[-1] is the command of the operating point.

use num_dual::Dual64;
use serde::{Deserialize, Serialize};

use crate::equations::Equations;
use crate::mode::Mode;
use crate::number::Number;
use crate::signals::{OperatingPoint, Signals, Values};
use aso_controller::clock::Clock;
use aso_controller::design::{Design, Estimator};

/// Clock and state of a sampled controller.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Sampler {
    estimator: Estimator,
    /// The instants of the samples.
    pub(crate) clock: Clock,
    /// z[k|k-1] of the next sample in absolute values, as the importer sees it, so that an initial value has no
    /// rounding of the operating point.
    prediction: Vec<f64>,
    /// The deviations z[k|k-1] of the last sample.
    last_prediction: Vec<f64>,
}

impl Sampler {
    /// The sampler of `design`; `None` for a continuous controller.
    pub(crate) fn new(design: &Design) -> Option<Self> {
        Some(Self {
            estimator: design.estimator?,
            clock: Clock::new(design.sample_time?),
            prediction: vec![0.0; design.order()],
            last_prediction: vec![0.0; design.order()],
        })
    }

    /// Starts at `time` from the estimate `z` as the importer sees it; sample 0 is due.
    pub(crate) fn start(&mut self, time: f64, z: &[f64]) {
        self.clock.start(time);
        self.prediction.copy_from_slice(z);
    }

    /// Whether no sample was taken since the start.
    pub(crate) fn is_at_start(&self) -> bool {
        self.clock.number() <= 0.0
    }

    /// Sets an element of the prediction for the next sample.
    pub(crate) fn set_prediction(&mut self, position: usize, value: f64) {
        self.prediction[position] = value;
    }

    /// Takes the next sample of a controller that rests. The prediction for the sample after it becomes `z`, as the
    /// importer sees it.
    pub(crate) fn rest(&mut self, z: &[f64]) {
        self.prediction.copy_from_slice(z);
        self.clock.tick();
    }

    /// The time in s from `start` to the next sample, negative if the sample was due before; `None` if it is due
    /// after `end`.
    pub(crate) fn time_to_sample(&self, start: f64, end: f64) -> Option<f64> {
        self.clock.next_until(end).map(|_| self.clock.time_to_next(start))
    }

    /// Takes the next sample, `offset` s after the measurements in `values` were given: computes z, e
    /// and u, and the prediction for the sample after it. Returns `mode` with the commands that are now
    /// at a limit.
    pub(crate) fn sample(
        &mut self,
        design: &Design,
        mode: Mode,
        values: &mut Values,
        point: &OperatingPoint,
        mut signals: &mut Signals,
        offset: f64,
    ) -> Mode {
        values.z.copy_from_slice(&self.prediction);
        signals.set(values, point, offset);
        signals.remove_feedthrough(design);
        self.last_prediction.copy_from_slice(&signals.z);
        let equations = Equations::<f64>::new(design, mode);
        estimate(self.estimator, equations, &self.last_prediction, &mut signals);
        if self.estimator == Estimator::Current {
            values.set_estimate(&signals.z[..design.filtered_at(0)], point);
        }
        values.transfer(design, mode, point, signals);
        let mode = mode.limited(design, &signals.z, [&signals.y, &signals.r]);
        mode.set_limited(design, &mut signals.u);
        let equations = Equations::<f64>::new(design, mode);
        equations.set_free_commands(&mut signals);
        values.set_commands(&signals.u, design, mode, point);
        self.predict(design, equations, signals);
        for (next, point) in self.prediction.iter_mut().zip(&point.z) {
            *next += point;
        }
        self.clock.tick();
        mode
    }

    /// Computes the deviations z[k+1|k], in `prediction`, from z, e and u of sample k.
    fn predict(&mut self, design: &Design, equations: Equations<'_, f64>, signals: &mut Signals) {
        let mut knowns = equations.knowns(&signals);
        if self.estimator == Estimator::Current {
            knowns = knowns.without_innovations();
        }
        equations.set_slopes(knowns, &mut &mut self.prediction[..]);
        let first_with_sum =
            if equations.has_fault_model() { design.filtered_at(0) } else { design.states.len() };
        for (next, z) in self.prediction.iter_mut().zip(&signals.z).skip(first_with_sum) {
            *next += z;
        }
    }

    /// Computes the derivatives of e, z and u of sample 0 in a direction, from those of z[0|-1], of y
    /// and of the commands at a limit.
    pub(crate) fn differentiate_first_sample(
        &self,
        equations: Equations<'_, Dual64>,
        direction: &mut Self,
        signals: &mut <Dual64 as Number>::Out<'_, Signals>,
    ) {
        direction.last_prediction.copy_from_slice(&signals.1.z);
        let predictions = [&self.last_prediction[..], &direction.last_prediction];
        estimate(self.estimator, equations, predictions, signals);
        equations.set_free_commands(signals);
    }
}

/// Computes e[k] from `prediction`, the deviations z[k|k-1], and with a current estimator z[k|k].
fn estimate<D: Number>(
    estimator: Estimator,
    equations: Equations<'_, D>,
    prediction: D::In<'_, [f64]>,
    signals: &mut D::Out<'_, Signals>,
) {
    for k in 0..D::values(D::read(signals)).e.len() {
        let z = equations.estimate(prediction);
        let e = equations.innovation(k, z, equations.knowns(signals).y);
        D::write(signals, |signals| &mut signals.e[k], e);
    }
    if estimator == Estimator::Current {
        equations.correct(signals);
    }
}
