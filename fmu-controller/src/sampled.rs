//! The observer of a sampled controller, which acts at t_k = t_start + k T and holds u in between.
//!
//! With z = [x_hat; f_hat; y_f], e = y - C x_hat (with a filter, y_f - C x_hat), z[k|k-1] estimated
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
//! ```
//!
//! f_hat only while estimating, K_f f_hat only while compensating, u within its limits. A design
//! without A_f has A_f = I.

use serde::{Deserialize, Serialize};

use crate::design::{Design, Estimator};
use crate::equations::{Knowns, Mode, innovation, innovation_along};
use crate::signals::Signals;

/// A sample is due this part of the sample time before its instant: an importer adds up its steps,
/// with rounding.
const TOLERANCE: f64 = 1e-4;
/// The most samples in one step.
const MOST_SAMPLES: f64 = 1e7;

/// Clock and memory of a sampled controller.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Sampler {
    estimator: Estimator,
    /// T in s.
    period: f64,
    /// t_start in s.
    start: f64,
    /// k of the next sample: a whole number, exact up to 2^53.
    next: f64,
    /// z[k|k-1] of that sample.
    prediction: Vec<f64>,
    /// Of the last sample, z[k|k-1] as the equations take it, and e.
    before: Vec<f64>,
    innovations: Vec<f64>,
}

/// What holds at one sample.
#[derive(Clone, Copy)]
pub(crate) struct Sample<'a> {
    pub(crate) design: &'a Design,
    /// The slopes of the measurements, and how long ago they were given with their values, in s.
    pub(crate) slopes: (&'a [f64], f64),
    pub(crate) compensating: bool,
    pub(crate) estimating: bool,
}

impl Sampler {
    /// The sampler of `design`, if that is one of a sampled controller.
    pub(crate) fn of(design: &Design) -> Option<Self> {
        Some(Self {
            estimator: design.estimator?,
            period: design.sample_time?,
            start: 0.0,
            next: 0.0,
            prediction: vec![0.0; design.order()],
            before: vec![0.0; design.order()],
            innovations: vec![0.0; design.measurements.len()],
        })
    }

    /// Starts at `time` from the estimate `z`; sample 0 is due.
    pub(crate) fn begin(&mut self, time: f64, z: &[f64]) {
        (self.start, self.next) = (time, 0.0);
        self.prediction.copy_from_slice(z);
    }

    /// The instant of the next sample in s.
    pub(crate) fn next_instant(&self) -> f64 {
        self.start + self.next * self.period
    }

    /// How long after `begin` the next sample is taken, if it is due until `end`.
    pub(crate) fn due(&self, begin: f64, end: f64) -> Option<f64> {
        let elapsed = self.next * self.period;
        let due = elapsed <= end - self.start + TOLERANCE * self.period;
        due.then_some(elapsed - (begin - self.start))
    }

    /// Whether more samples are due until `end` than a step may have.
    pub(crate) fn is_flooded(&self, end: f64) -> bool {
        (end - self.start) / self.period - self.next > MOST_SAMPLES
    }

    /// Takes the next sample: z and u of `values`, by their `deviations` where the design has an
    /// operating point; the mode.
    pub(crate) fn sample(
        &mut self,
        sample: Sample<'_>,
        values: &mut Signals,
        deviations: &mut Option<Signals>,
    ) -> Mode {
        let Sample { design, slopes: (slopes, offset), compensating, estimating } = sample;
        values.z.copy_from_slice(&self.prediction);
        let own = relative(design, values, deviations);
        self.before.copy_from_slice(&own.z);
        let [x_hat, _, y_f] = design.parts(&own.z);
        for (k, e) in self.innovations.iter_mut().enumerate() {
            *e = innovation(design, x_hat, y_f, (k, own.y[k] + slopes[k] * offset));
        }
        if self.estimator == Estimator::Current {
            self.correct(design, Mode::free(compensating, estimating), &mut values.z);
        }
        let own = relative(design, values, deviations);
        let mode = Mode::of(design, &own.z, compensating, estimating);
        mode.command(design, &own.z, &mut own.u);
        self.predict(design, mode, own);
        if let Some(deviations) = deviations {
            deviations.command_into(design, mode, &mut values.u);
        }
        let [_, _, filtered] = design.parts_mut(&mut self.prediction);
        for (k, (w, next)) in design.filter.iter().flatten().zip(filtered).enumerate() {
            let y_f = values.z[design.filtered_at(k)];
            *next = y_f + w * (values.y[k] + slopes[k] * offset - y_f);
        }
        self.next += 1.0;
        mode
    }

    /// Adds the gains times the innovations to `z`.
    fn correct(&self, design: &Design, mode: Mode, z: &mut [f64]) {
        let [x_hat, f_hat, _] = design.parts_mut(z);
        for (k, e) in self.innovations.iter().enumerate() {
            mode.correct(design, (k, *e), x_hat, f_hat);
        }
    }

    /// The prediction of x_hat and f_hat from the estimate and the command in `own`.
    fn predict(&mut self, design: &Design, mode: Mode, own: &Signals) {
        let mut prediction = std::mem::take(&mut self.prediction);
        mode.free_rates(design, &own.z, &own.u, &mut prediction);
        if self.estimator == Estimator::Prediction {
            self.correct(design, mode, &mut prediction);
        }
        self.prediction = prediction;
        let [x_hat, f_hat, _] = design.parts_mut(&mut self.prediction);
        for (next, state) in x_hat.iter_mut().zip(&design.states) {
            *next += state.operating.unwrap_or_default();
        }
        if design.a_f.is_none() || !mode.estimating {
            let [_, kept, _] = design.parts(&own.z);
            f_hat.iter_mut().zip(kept).for_each(|(next, kept)| *next += kept);
        }
    }

    /// The derivative of z and u of sample 0, which led to `point`: those of `along`, in which z is
    /// what the sample started from. `changes` is space for the derivative of e.
    pub(crate) fn first_sample_along(
        &self,
        mode: Mode,
        point: Knowns<'_>,
        design: &Design,
        (along, changes): (&mut Signals, &mut [f64]),
    ) {
        if self.estimator == Estimator::Current {
            let designs = [point.design, design];
            for (k, de) in changes.iter_mut().enumerate() {
                *de = innovation_along(designs, [&self.before, &along.z], k, along.y[k]);
            }
            let [x_hat, f_hat, _] = design.parts_mut(&mut along.z);
            for (k, (e, de)) in self.innovations.iter().zip(changes).enumerate() {
                mode.correct_along(designs, (k, [*e, *de]), x_hat, f_hat);
            }
        }
        mode.command_along(point, design, along);
    }

    /// Space for the derivatives of the innovations, in the sampler of a direction.
    pub(crate) fn changes(&mut self) -> &mut [f64] {
        &mut self.innovations
    }
}

/// What the equations take: the deviations of `values`, or these themselves.
fn relative<'a>(
    design: &Design,
    values: &'a mut Signals,
    deviations: &'a mut Option<Signals>,
) -> &'a mut Signals {
    match deviations {
        None => values,
        Some(deviations) => {
            deviations.deviate(design, values);
            deviations
        }
    }
}
