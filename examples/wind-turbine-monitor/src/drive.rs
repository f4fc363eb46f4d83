//! The residuals of the speeds of rotor and generator and of the converter's torque.

use std::f64::consts::SQRT_2;

use crate::test::Cusum;
use crate::{NOISE_GENERATOR, NOISE_ROTOR, NOISE_TORQUE, PERIOD};

/// Ratio of the gear.
const GEAR: f64 = 95.0;
/// Inertia of the generator, kg.m2.
const INERTIA: f64 = 390.0;
/// Gains of the tracking filter: speed per residual; acceleration by the shaft per residual, 1/s.
const GAINS: [f64; 2] = [0.3, 4.0];
/// Standard deviation of the residual of a generator's sensor over that of the noise, because the shaft
/// oscillates.
const FILTER: f64 = 1.6;
/// Bandwidth of the converter, 1/s, and gain of its observer.
const CONVERTER: f64 = 50.0;
const CONVERTER_GAIN: f64 = 0.002;

/// A filter that tracks the speed of the generator, omega' = shaft - tau / J, by the sensors without an
/// alarm, with the torque tau of the converter's observer; and the tests.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Speeds {
    speed: f64,
    /// Acceleration by the torque of the shaft, rad/s2.
    shaft: f64,
    generator: [Cusum; 2],
    rotor: [Cusum; 2],
    /// Of the sensors of the generator and of the rotor.
    differences: [Cusum; 2],
    pub(crate) generator_fault: [bool; 2],
    pub(crate) rotor_fault: [bool; 2],
}

impl Speeds {
    /// Takes the speeds by the two sensors of rotor and generator at a sample in rad/s, and the torque of
    /// the generator in N.m.
    pub(crate) fn sample(&mut self, rotor: [f64; 2], generator: [f64; 2], torque: f64) {
        let residuals = generator.map(|speed| speed - self.speed);
        let mut differ = |pair: usize, [first, second]: [f64; 2], noise: f64| {
            self.differences[pair].take((first - second) / (SQRT_2 * noise))
        };
        let generators_differ = differ(0, generator, NOISE_GENERATOR);
        let rotors_differ = differ(1, rotor, NOISE_ROTOR);
        for (k, residual) in residuals.into_iter().enumerate() {
            let tripped = self.generator[k].take(residual / (FILTER * NOISE_GENERATOR));
            self.generator_fault[k] = generators_differ && tripped;
        }
        let used = match self.generator_fault {
            [true, false] => residuals[1],
            [false, true] => residuals[0],
            _ => 0.5 * (residuals[0] + residuals[1]),
        };
        self.speed += GAINS[0] * used;
        self.shaft += GAINS[1] * used;
        for (k, speed) in rotor.into_iter().enumerate() {
            let residual = speed - self.speed / GEAR;
            let tripped = self.rotor[k].take(residual / (1.05 * NOISE_ROTOR));
            self.rotor_fault[k] = rotors_differ && tripped;
        }
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
