//! The residuals of the speeds of rotor and generator and of the converter's torque.

use crate::test::{Cusum, Pair};
use crate::{NOISE_GENERATOR, NOISE_ROTOR, NOISE_TORQUE, PERIOD};

/// Ratio of the gear.
const GEAR: f64 = 95.0;
/// Inertia of the generator, kg.m2.
const INERTIA: f64 = 390.0;
/// Gains of the tracking filter: speed per residual; acceleration by the shaft per residual, 1/s.
const GAINS: [f64; 2] = [0.3, 4.0];
/// Standard deviation of the residual of a generator's sensor, relative to the noise of the sensor: larger, because the
/// shaft oscillates.
const FILTER: f64 = 1.6;
/// Bandwidth of the converter, 1/s.
const CONVERTER: f64 = 50.0;
/// Gain of the observer of the converter: torque per residual.
const CONVERTER_GAIN: f64 = 0.002;

/// A filter that tracks the speed of the generator, omega' = shaft - tau / J, and the tests of the speed sensors. It
/// uses the sensors without a fault, and the torque tau of the converter's observer.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Speeds {
    speed: f64,
    /// Acceleration by the torque of the shaft, rad/s2.
    shaft: f64,
    pub(crate) generator: Pair,
    pub(crate) rotor: Pair,
}

impl Speeds {
    /// Takes a sample: the measurements of the two sensors of the rotor and of the generator in rad/s, and the torque of
    /// the generator in N.m.
    pub(crate) fn sample(&mut self, rotor: [f64; 2], generator: [f64; 2], torque: f64) {
        let residuals = generator.map(|speed| speed - self.speed);
        self.generator.take(residuals, [NOISE_GENERATOR, FILTER * NOISE_GENERATOR]);
        let residual = self.generator.trusted_residual(residuals);
        self.speed += GAINS[0] * residual;
        self.shaft += GAINS[1] * residual;
        let residuals = rotor.map(|speed| speed - self.speed / GEAR);
        self.rotor.take(residuals, [NOISE_ROTOR, 1.05 * NOISE_ROTOR]);
        self.speed += PERIOD * (self.shaft - torque / INERTIA);
    }

    /// Starts at the mean of the generator's sensors, with the torques in balance.
    pub(crate) fn starting_at(generator: [f64; 2], torque: f64) -> Self {
        let speed = 0.5 * (generator[0] + generator[1]);
        Self { speed, shaft: torque / INERTIA, ..Self::default() }
    }
}

/// An observer of the converter, `tau' = 50 (tau_ref - tau)`, and the test of its residual.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Converter {
    pub(crate) torque: f64,
    test: Cusum,
    pub(crate) fault: bool,
}

impl Converter {
    /// Takes the measured and the commanded torque at a sample, N.m.
    pub(crate) fn sample(&mut self, measured: f64, commanded: f64) {
        let residual = measured - self.torque;
        self.fault = self.test.take(residual / NOISE_TORQUE);
        if !self.fault {
            self.torque += CONVERTER_GAIN * residual;
        }
        let decay = libm::exp(-CONVERTER * PERIOD);
        self.torque = commanded + (self.torque - commanded) * decay;
    }

    /// Starts at the measured torque.
    pub(crate) fn starting_at(measured: f64) -> Self {
        Self { torque: measured, ..Self::default() }
    }
}
