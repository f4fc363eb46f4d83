//! Detection and isolation of faults: residuals, tests, the decision.
//!
//! The residuals follow from the measurements and the commands that are really applied, not from the observer. A
//! sampled controller computes and tests them in each sample. In a continuous one the filter is part of the piecewise
//! linear system of the observer (`observer.rs`, with M and N) and stepped exactly. Its residuals are averages over
//! intervals of the detection's own sample time T, times T^(1/2); q integrates them in each interval:
//!
//! ```text
//! [z; x_r; q]' = [M, 0, 0; B_u K, A, 0; D_u K, C, 0] [z; x_r; q] + [N; B_u S + B_y Y; D_u S + D_y Y] v
//! r[k] = q(t_k) / T^(1/2),  q(t_k) is then set to 0
//! ```
//!
//! v = [y; r; w], w the commands of the channels at a limit, u = K z + S v, y = Y v; A, B_u, B_y, C, D_u, D_y are of
//! the filter, x_r is its state. A sampled controller also has a sample at the start of a run, which is not tested.

mod decision;
mod tests_of_residuals;

use std::ops::{AddAssign as _, SubAssign as _};

use control::Error;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::dense::dense;
use crate::mode::Mode;
use crate::observer::{self, Propagators};
use aso_controller::Design;
use aso_controller::clock::clock_rounding;
use aso_controller::design::detection::DetectionDesign;
pub(crate) use decision::Decision;
use tests_of_residuals::TestState;

/// The fraction of the sample time by which a sample may be early, in addition to [`clock_rounding`].
const TOLERANCE: f64 = 1e-6;
/// Times between samples are rounded to this fraction of the sample time, so that equal times have equal bits.
const RESOLUTION: f64 = 1.0 / 1_073_741_824.0;
/// The most samples in one step.
const MOST_SAMPLES: f64 = 1e7;

/// State and outputs of the detection.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(crate) struct Detector {
    /// [x_r; q]: the state of the filter and, in a continuous controller, the integrals of the residuals.
    state: Vec<f64>,
    /// Start of the run, or end of the last rest, in s.
    start: f64,
    /// Number of samples since `start`.
    samples: f64,
    pub(crate) residuals: Vec<f64>,
    pub(crate) statistics: Vec<f64>,
    tests: Vec<TestState>,
    pub(crate) decision: Decision,
    /// The value of the input `detection_reset`.
    pub(crate) reset: bool,
    #[serde(skip)]
    work: Work,
}

/// Space of a step, and the propagators of a continuous controller; empty in a state read from bytes.
#[derive(Clone, Default)]
struct Work {
    propagators: Propagators,
    before: Vec<f64>,
    after: Vec<f64>,
    input: Vec<f64>,
    input_slope: Vec<f64>,
}

/// A part of a step in which the mode stays; signals as deviations, times in s.
#[derive(Clone, Copy)]
pub(crate) struct Stretch<'a> {
    /// z at the start of this part.
    pub(crate) z: &'a [f64],
    pub(crate) mode: Mode,
    /// The measurements at the start of the step, and their slopes.
    pub(crate) y: [&'a [f64]; 2],
    /// The references at the start of the step, and their slopes.
    pub(crate) r: [&'a [f64]; 2],
    /// Start of the step.
    pub(crate) start: f64,
    /// Start of this part after the start of the step.
    pub(crate) offset: f64,
    /// Length of this part.
    pub(crate) size: f64,
}

impl Detector {
    /// The detector of `design`, if it has one.
    pub(crate) fn new(design: &Design) -> Option<Self> {
        let detection = design.detection.as_ref()?;
        let integrals = if detection.sample_time.is_some() { detection.c.rows } else { 0 };
        let tests = &detection.tests;
        Some(Self {
            state: vec![0.0; detection.a.rows + integrals],
            start: 0.0,
            samples: 0.0,
            residuals: vec![0.0; detection.c.rows],
            statistics: vec![0.0; tests.len()],
            tests: tests.iter().map(TestState::new).collect(),
            decision: Decision::default(),
            reset: false,
            work: Work::default(),
        })
    }

    /// Starts at `time` in s from the deviations `x_hat` of the states.
    pub(crate) fn start(&mut self, detection: &DetectionDesign, time: f64, x_hat: &[f64]) {
        self.state.fill(0.0);
        detection.start.add_product::<true>(x_hat, &mut self.state);
        (self.start, self.samples) = (time, 0.0);
        self.residuals.fill(0.0);
        self.work.propagators = Propagators::default();
        self.clear();
    }

    /// Clears sums, windows and decision.
    fn clear(&mut self) {
        self.statistics.fill(0.0);
        self.tests.iter_mut().for_each(TestState::clear);
        self.decision = Decision::default();
    }

    /// Restarts at `time` in s from the operating point. Residuals and statistics become 0; the decision stays.
    pub(crate) fn rest(&mut self, time: f64) {
        self.state.fill(0.0);
        (self.start, self.samples) = (time, 0.0);
        self.residuals.fill(0.0);
        self.statistics.fill(0.0);
        self.tests.iter_mut().for_each(TestState::restart);
    }

    /// Takes a sample of a sampled controller at `time` in s, with the deviations of the measurements `y` and of the
    /// commands `u` that are applied from this sample on. The first sample after a start is not tested.
    pub(crate) fn sample(&mut self, detection: &DetectionDesign, u: &[f64], y: &[f64], time: f64) {
        let first = self.samples < 1.0;
        if !first {
            self.residuals.fill(0.0);
            detection.c.add_product::<true>(&self.state, &mut self.residuals);
            detection.d_u.add_product::<true>(u, &mut self.residuals);
            detection.d_y.add_product::<true>(y, &mut self.residuals);
        }
        let next = &mut self.work.after;
        next.clear();
        next.resize(self.state.len(), 0.0);
        detection.a.add_product::<true>(&self.state, next);
        detection.b_u.add_product::<true>(u, next);
        detection.b_y.add_product::<true>(y, next);
        self.state.copy_from_slice(next);
        self.samples += 1.0;
        if !first {
            self.decide(detection, time);
        }
    }

    /// Advances the filter over a part of a step of a continuous controller, and takes the samples in this part.
    pub(crate) fn follow(
        &mut self,
        design: &Design,
        detection: &DetectionDesign,
        stretch: &Stretch<'_>,
    ) -> Result<(), Error> {
        let Some(period) = detection.sample_time else { return Ok(()) };
        let start = stretch.start + stretch.offset;
        let (mut at, end) = (0.0, stretch.size);
        let tolerance = TOLERANCE * period + clock_rounding(start);
        self.work.before.clear();
        self.work.before.extend(stretch.z.iter().chain(&self.state));
        loop {
            let instant = self.start + (self.samples + 1.0) * period;
            let rounded = ((instant - start) / (RESOLUTION * period)).round();
            let due = rounded * RESOLUTION * period;
            let sampled = due <= end + tolerance;
            // A sample that is due at the end, up to rounding, is taken exactly at the end.
            let to = if due < end - tolerance { due } else { end };
            if to > at {
                self.propagate(design, detection, stretch, at, to - at)?;
                at = to;
            }
            if !sampled {
                break;
            }
            self.samples += 1.0;
            let integrals = &mut self.work.before[stretch.z.len() + detection.a.rows..];
            let root = period.sqrt();
            for (residual, integral) in self.residuals.iter_mut().zip(integrals) {
                (*residual, *integral) = (*integral / root, 0.0);
            }
            self.decide(detection, instant);
        }
        self.state.copy_from_slice(&self.work.before[stretch.z.len()..]);
        Ok(())
    }

    /// Advances [z; x_r; q], stored in `before`, over `size` s, starting `at` s after the start of the part.
    fn propagate(
        &mut self,
        design: &Design,
        detection: &DetectionDesign,
        stretch: &Stretch<'_>,
        at: f64,
        size: f64,
    ) -> Result<(), Error> {
        let Work { propagators, before, after, input, input_slope } = &mut self.work;
        input.clear();
        input_slope.clear();
        let offset = stretch.offset + at;
        for [values, slopes] in [stretch.y, stretch.r] {
            input.extend(values.iter().zip(slopes).map(|(value, slope)| value + slope * offset));
            input_slope.extend_from_slice(slopes);
        }
        for j in 0..design.actuators.len() {
            input.push(stretch.mode.held_deviation(design, j).unwrap_or(0.0));
            input_slope.push(0.0);
        }
        let hold =
            propagators.of(stretch.mode, size, || system(design, detection, stretch.mode))?;
        after.clear();
        after.resize(before.len(), 0.0);
        hold.step_into(before, input, input_slope, after)?;
        std::mem::swap(before, after);
        Ok(())
    }

    /// Tests the residuals at `time` in s, unless it is before `detect_from`, and decides. If `reset` is set, clears
    /// sums, windows and decision first.
    fn decide(&mut self, detection: &DetectionDesign, time: f64) {
        if self.reset {
            self.clear();
        }
        if time < self.start + detection.from - clock_rounding(time) {
            return;
        }
        let mut first = 0;
        for (at, (test, state)) in detection.tests.iter().zip(&mut self.tests).enumerate() {
            let residuals = &self.residuals[first..first + test.residuals];
            first += test.residuals;
            let onset = state.take(test, residuals, time);
            self.statistics[at] = state.statistic;
            if let Some(onset) = onset {
                self.decision.alarm(time, onset);
            }
        }
        self.decision.isolate(detection, |at| self.tests[at].has_alarmed);
    }

    /// Whether more samples are due until `end` than one step may take.
    pub(crate) fn has_too_many_samples(&self, detection: &DetectionDesign, end: f64) -> bool {
        detection
            .sample_time
            .is_some_and(|period| (end - self.start) / period - self.samples > MOST_SAMPLES)
    }
}

/// The matrices by which [z; x_r; q]' depends on [z; x_r; q] and on [y; r; w] in `mode`.
fn system(
    design: &Design,
    detection: &DetectionDesign,
    mode: Mode,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let responses = observer::unit_responses(design, mode);
    let (order, p) = (design.order(), design.measurements.len());
    let (k, rows) = (detection.a.rows, detection.c.rows);
    let whole = order + k + rows;
    let (mut state, mut input) =
        (DMatrix::zeros(whole, whole), DMatrix::zeros(whole, responses.len() - order));
    let feedthrough = design.d.as_ref().map(dense);
    let [b_u, b_y, d_u, d_y] =
        [&detection.b_u, &detection.b_y, &detection.d_u, &detection.d_y].map(dense);
    for (at, [slopes, u]) in responses.into_iter().enumerate() {
        let u = DVector::from_vec(u);
        let mut column = DVector::zeros(whole);
        column.rows_mut(0, order).copy_from_slice(&slopes);
        column.rows_mut(order, k).copy_from(&(&b_u * &u));
        column.rows_mut(order + k, rows).copy_from(&(&d_u * &u));
        if (order..order + p).contains(&at) {
            column.rows_mut(order, k).add_assign(b_y.column(at - order));
            column.rows_mut(order + k, rows).add_assign(d_y.column(at - order));
        }
        if let Some(d) = &feedthrough {
            let fed = d * &u;
            column.rows_mut(order, k).sub_assign(&b_y * &fed);
            column.rows_mut(order + k, rows).sub_assign(&d_y * &fed);
        }
        match at.checked_sub(order) {
            None => state.set_column(at, &column),
            Some(at) => input.set_column(at, &column),
        }
    }
    state.view_mut((order, order), (k, k)).copy_from(&dense(&detection.a));
    state.view_mut((order + k, order), (rows, k)).copy_from(&dense(&detection.c));
    (state, input)
}
