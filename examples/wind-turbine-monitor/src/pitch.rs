//! The residuals of one blade's pitch actuator and its two sensors.

use crate::test::{Cusum, THRESHOLD};
use crate::{NOISE_PITCH, PERIOD};

/// `2 zeta omega_n` and `omega_n^2` of the intact actuator.
const DAMPING: f64 = 2.0 * 0.6 * 11.11;
const STIFFNESS: f64 = 11.11 * 11.11;
/// Gains of the observer: angle per residual, at the start 1 / (number of samples), and rate per residual, 1/s.
const GAINS: [f64; 2] = [0.02, 0.02];

/// The observer of a blade and the tests of its residuals.
///
/// The actuator follows `beta'' = omega_n^2 (beta_ref - (m1 + m2) / 2) - 2 zeta omega_n beta'`: what it
/// takes from its sensors m1 and m2 is known, also where they are faulty. So an observer with small gains
/// keeps following the true angle, and each sensor has a residual of its own.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Blade {
    beta: f64,
    rate: f64,
    samples: f64,
    sensors: [Cusum; 2],
    difference: Cusum,
    common: Cusum,
    pub(crate) sensor_fault: [bool; 2],
    pub(crate) actuator_fault: bool,
}

impl Blade {
    /// Takes the measurements `m` of the two sensors at a sample, and predicts the next sample.
    pub(crate) fn sample(&mut self, beta_ref: f64, m: [f64; 2]) {
        let residuals = m.map(|angle| angle - self.beta);
        let scaled = |residual: f64, noise: f64| residual / (noise * NOISE_PITCH);
        let differ = self.difference.take(scaled(m[0] - m[1], std::f64::consts::SQRT_2));
        let before = self.sensor_fault;
        let tripped = [0, 1].map(|k| self.sensors[k].take(scaled(residuals[k], 1.0)));
        let mean = 0.5 * (residuals[0] + residuals[1]);
        let moved = self.common.take(scaled(mean, std::f64::consts::FRAC_1_SQRT_2));
        // Sensors that differ name the faulty one: the one with the larger residual, which stays named.
        let larger = usize::from(residuals[1].abs() > residuals[0].abs());
        let named = before.iter().position(|fault| *fault).unwrap_or(larger);
        self.sensor_fault = [0, 1].map(|k| k == named && differ && (tripped[k] || before[k]));
        let agree = !self.difference.is_above(0.5 * THRESHOLD);
        self.actuator_fault = moved && agree && tripped[0] && tripped[1];
        let used = match self.sensor_fault {
            [true, _] => residuals[1],
            [_, true] => residuals[0],
            _ => mean,
        };
        self.samples += 1.0;
        self.beta += GAINS[0].max(1.0 / self.samples) * used;
        self.rate += GAINS[1] * used;
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
