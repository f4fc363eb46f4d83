//! The residuals of one blade's pitch actuator and its two sensors.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::test::{Cusum, Pair};
use crate::{NOISE_PITCH, PERIOD};

/// `2 zeta omega_n` and `omega_n^2` of the intact actuator.
const DAMPING: f64 = 2.0 * 0.6 * 11.11;
const STIFFNESS: f64 = 11.11 * 11.11;
/// Gains of the observer: angle per residual, at least 1 / (number of samples), and rate per residual, 1/s.
/// They are small, so that the observer hardly follows a faulty sensor.
const GAINS: [f64; 2] = [0.001, 0.001];
/// Gain of the angle while the actuator is faulty, so that the alarm ends with the fault.
const FAULTY_GAIN: f64 = 0.05;

/// The observer of a blade and the tests of its residuals.
///
/// The actuator follows `beta'' = omega_n^2 (beta_ref - (m1 + m2) / 2) - 2 zeta omega_n beta'`, with the measurements m1
/// and m2, which are known, also if a sensor is faulty. So an observer with small gains follows the true angle, and each
/// sensor has its own residual.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Blade {
    beta: f64,
    rate: f64,
    samples: f64,
    pub(crate) sensors: Pair,
    mean: Cusum,
    pub(crate) actuator_fault: bool,
}

impl Blade {
    /// Takes the measurements `m` of the two sensors at a sample, and predicts the next sample.
    pub(crate) fn sample(&mut self, beta_ref: f64, m: [f64; 2]) {
        let residuals = m.map(|angle| angle - self.beta);
        self.sensors.take(residuals, [NOISE_PITCH; 2]);
        let mean = 0.5 * (residuals[0] + residuals[1]);
        let is_shifted = self.mean.take(mean / (FRAC_1_SQRT_2 * NOISE_PITCH));
        self.actuator_fault = is_shifted && self.sensors.agree_on_a_change();
        let residual = self.sensors.trusted_residual(residuals);
        self.samples += 1.0;
        let gain = if self.actuator_fault { FAULTY_GAIN } else { GAINS[0] };
        self.beta += gain.max(1.0 / self.samples) * residual;
        self.rate += GAINS[1] * residual;
        self.predict(beta_ref - 0.5 * (m[0] + m[1]));
    }

    /// Advances the observer by a sample, exactly for a constant `error`.
    fn predict(&mut self, error: f64) {
        let decay = libm::exp(-DAMPING * PERIOD);
        let last = STIFFNESS * error / DAMPING;
        self.beta += last * PERIOD + (self.rate - last) * (1.0 - decay) / DAMPING;
        self.rate = last + (self.rate - last) * decay;
    }

    /// Starts at the mean of the sensors, at rest.
    pub(crate) fn starting_at(m: [f64; 2]) -> Self {
        Self { beta: 0.5 * (m[0] + m[1]), ..Self::default() }
    }
}
