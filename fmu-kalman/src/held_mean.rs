//! The mean of the commands between samples.

use serde::{Deserialize, Serialize};

/// The mean over time of values that are held.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct HeldMean {
    /// The integrals of the values over time.
    integrals: Vec<f64>,
    /// Space for the means.
    means: Vec<f64>,
    /// The duration in s of the integrals.
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
