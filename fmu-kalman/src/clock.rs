//! The instants of the samples, and the mean of the commands between them.

use serde::{Deserialize, Serialize};

/// The part of the sample time by which a sample may be early, in addition to 8 units of rounding of the time: an
/// importer adds up its steps with rounding.
const TOLERANCE: f64 = 1e-4;

/// The clock of the samples at start + k T. Sample 0 belongs to the initialisation.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Clock {
    /// T in s.
    period: f64,
    /// The time of sample 0 in s.
    start: f64,
    /// k of the next sample: a whole number, exact up to 2^53.
    next: f64,
}

impl Clock {
    pub(crate) fn new(period: f64) -> Self {
        Self { period, start: 0.0, next: 1.0 }
    }

    /// Starts at `time` in s, with sample 0.
    pub(crate) fn start(&mut self, time: f64) {
        (self.start, self.next) = (time, 1.0);
    }

    /// The time of sample 0 in s.
    pub(crate) fn first(&self) -> f64 {
        self.start
    }

    /// The instant of the next sample in s, at most `end`; `None` if it is due after `end`.
    pub(crate) fn next_until(&self, end: f64) -> Option<f64> {
        let next = self.start + self.next * self.period;
        let tolerance = TOLERANCE * self.period + 8.0 * f64::EPSILON * end.abs();
        (next <= end + tolerance).then_some(next.min(end))
    }

    /// The instant of the last sample in s.
    pub(crate) fn last(&self) -> f64 {
        self.start + (self.next - 1.0) * self.period
    }

    /// The number of the next sample.
    pub(crate) fn next_number(&self) -> f64 {
        self.next
    }

    /// Goes on to the next sample.
    pub(crate) fn tick(&mut self) {
        self.next += 1.0;
    }
}

/// The mean over time of values that are held.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct HeldMean {
    /// The integrals over time.
    integrals: Vec<f64>,
    /// Space for the means.
    means: Vec<f64>,
    /// The time in s over which the integrals extend.
    duration: f64,
}

impl HeldMean {
    /// The mean of `count` values; no time has passed.
    pub(crate) fn of(count: usize) -> Self {
        Self { integrals: vec![0.0; count], means: vec![0.0; count], duration: 0.0 }
    }

    /// Starts the mean again.
    pub(crate) fn clear(&mut self) {
        self.integrals.fill(0.0);
        self.duration = 0.0;
    }

    /// Adds `values`, held for `duration` in s; ignores a duration that is not positive.
    pub(crate) fn add(&mut self, values: &[f64], duration: f64) {
        if duration <= 0.0 {
            return;
        }
        for (integral, value) in self.integrals.iter_mut().zip(values) {
            *integral += value * duration;
        }
        self.duration += duration;
    }

    /// The mean since the last [`HeldMean::clear`]; `values` if no time has passed.
    pub(crate) fn mean(&mut self, values: &[f64]) -> &[f64] {
        if self.duration <= 0.0 {
            self.means.copy_from_slice(values);
        } else {
            for (mean, integral) in self.means.iter_mut().zip(&self.integrals) {
                *mean = integral / self.duration;
            }
        }
        &self.means
    }
}
