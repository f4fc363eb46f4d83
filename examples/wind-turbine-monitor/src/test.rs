//! Two-sided CUSUM tests of residuals, and of two sensors of one quantity.

use std::f64::consts::SQRT_2;

/// Residual in standard deviations above which the sums grow, and the threshold of the sums.
///
/// The mean number of samples between two false alarms of one side is about
/// (exp(2 k (h + 1.166)) - 1 - 2 k (h + 1.166)) / (2 k^2) (Siegmund 1985), 1e12 for these values.
pub(crate) const ALLOWANCE: f64 = 1.0;
pub(crate) const THRESHOLD: f64 = 13.0;
/// Upper limit of the sums, so that an alarm ends soon after its fault.
const LARGEST: f64 = 20.0;

/// The sums of E. S. Page, "Continuous inspection schemes" (1954), of both signs.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Cusum {
    sums: [f64; 2],
}

impl Cusum {
    /// Takes a residual divided by its standard deviation; returns whether a sum is above the threshold.
    pub(crate) fn take(&mut self, residual: f64) -> bool {
        for (sum, signed) in self.sums.iter_mut().zip([residual, -residual]) {
            *sum = (*sum + signed - ALLOWANCE).clamp(0.0, LARGEST);
        }
        self.is_above(THRESHOLD)
    }

    /// Whether a sum is above `limit`.
    pub(crate) fn is_above(&self, limit: f64) -> bool {
        self.sums.iter().any(|sum| *sum > limit)
    }
}

/// Two sensors of one quantity: the tests of their residuals and of their difference.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Pair {
    sensors: [Cusum; 2],
    difference: Cusum,
    /// Whether each sensor is faulty; at most one of them is.
    pub(crate) faulty: [bool; 2],
}

impl Pair {
    /// Takes the residuals of both sensors. `noise` and `deviation` are the standard deviations of the noise and of the
    /// residual of a sensor.
    ///
    /// If the sensors differ, the sensor with the larger residual is faulty as soon as its own test is above the
    /// threshold. It remains faulty until the sensors agree again.
    pub(crate) fn take(&mut self, residuals: [f64; 2], [noise, deviation]: [f64; 2]) {
        let before = self.faulty;
        let is_apart = self.difference.take((residuals[0] - residuals[1]) / (SQRT_2 * noise));
        let differ = is_apart || before != [false; 2] && !self.agree();
        let mut tripped = [false; 2];
        for k in 0..2 {
            tripped[k] = self.sensors[k].take(residuals[k] / deviation);
        }
        let larger = usize::from(residuals[1].abs() > residuals[0].abs());
        let named = before.iter().position(|faulty| *faulty).unwrap_or(larger);
        self.faulty = [0, 1].map(|k| k == named && differ && (tripped[k] || before[k]));
    }

    /// Whether the tests of both residuals are above the threshold, and the sensors agree.
    pub(crate) fn agree_on_a_change(&self) -> bool {
        let both = self.sensors.iter().all(|sensor| sensor.is_above(THRESHOLD));
        both && self.agree()
    }

    /// Whether the test of the difference is at most at half of its threshold.
    fn agree(&self) -> bool {
        !self.difference.is_above(0.5 * THRESHOLD)
    }

    /// Returns the residual of the sensor without a fault, or the mean of both residuals if no sensor has a fault.
    pub(crate) fn trusted_residual(&self, residuals: [f64; 2]) -> f64 {
        match self.faulty {
            [true, _] => residuals[1],
            [_, true] => residuals[0],
            _ => 0.5 * (residuals[0] + residuals[1]),
        }
    }
}
