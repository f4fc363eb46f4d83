//! Rotor, drive train, generator and pitch actuators.
//!
//! Equations and values of the benchmark: P. F. Odgaard, J. Stoustrup and M. Kinnaert, "Fault-tolerant
//! control of wind turbines: a benchmark model" (2013). The table of the torque coefficient is replaced by a
//! formula, scaled to the benchmark's largest power coefficient, 0.4554.

use std::array::from_fn;
use std::f64::consts::PI;

/// Radius of the rotor, m.
pub(crate) const RADIUS: f64 = 57.5;
/// Density of the air, kg/m3.
pub(crate) const DENSITY: f64 = 1.225;
/// Ratio of the gear.
pub(crate) const GEAR: f64 = 95.0;
/// Efficiency of the drive train, and with fault 9.
pub(crate) const EFFICIENCY: [f64; 2] = [0.97, 0.92];
/// Efficiency of the generator.
pub(crate) const GENERATOR_EFFICIENCY: f64 = 0.98;
/// Largest power coefficient.
pub(crate) const POWER_COEFFICIENT: f64 = 0.4554;

/// Damping of the twist, of the rotor's and of the generator's bearings, N.m.s/rad.
const DAMPING: [f64; 3] = [775.49, 7.11, 45.6];
/// Stiffness of the shaft, N.m/rad.
const STIFFNESS: f64 = 2.7e9;
/// Inertia of rotor and generator, kg.m2.
const INERTIA: [f64; 2] = [55e6, 390.0];
/// Bandwidth of the converter, 1/s.
const CONVERTER: f64 = 50.0;
/// Natural frequency in rad/s and damping ratio of a pitch actuator: intact, low pressure, air in the oil.
const PITCH: [[f64; 2]; 3] = [[11.11, 0.6], [5.73, 0.45], [3.42, 0.9]];

/// Speeds in rad/s, twist in rad, torque in N.m, pitch angles in degrees and their rates in degrees/s.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct State {
    pub(crate) omega_r: f64,
    pub(crate) omega_g: f64,
    pub(crate) twist: f64,
    pub(crate) tau_g: f64,
    pub(crate) beta: [f64; 3],
    pub(crate) rate: [f64; 3],
}

/// The inputs, which are constant during a step.
pub(crate) struct HeldInputs {
    /// Speed of the wind, m/s.
    pub(crate) wind: f64,
    /// Reference of the converter's torque, N.m.
    pub(crate) torque: f64,
    /// For each blade, commanded minus measured pitch angle, degrees.
    pub(crate) pitch_error: [f64; 3],
    /// For each actuator, the weights of its intact dynamics and of the two faulty ones.
    pub(crate) actuators: [[f64; 3]; 3],
    /// Efficiency of the drive train.
    pub(crate) efficiency: f64,
}

/// Returns the power coefficient at the tip-speed ratio `lambda` and the pitch angle `beta` in degrees, after S. Heier,
/// "Grid integration of wind energy conversion systems" (1998). Angles below 0 count as 0.
pub(crate) fn power_coefficient(lambda: f64, beta: f64) -> f64 {
    let beta = beta.max(0.0);
    let reciprocal = 1.0 / (lambda + 0.08 * beta) - 0.035 / (beta * beta * beta + 1.0);
    let lift = 0.5176 * (116.0 * reciprocal - 0.4 * beta - 5.0) * libm::exp(-21.0 * reciprocal);
    (lift + 0.0068 * lambda) * POWER_COEFFICIENT / 0.48
}

impl State {
    /// Returns the equilibrium below rated power at a wind of `wind` m/s, with pitch angles of 0; `torque` gives the
    /// torque for the speed of the generator.
    pub(crate) fn at_optimal_speed(wind: f64, torque: impl Fn(f64) -> f64) -> Self {
        let omega_r = 8.0 * wind / RADIUS;
        let omega_g = omega_r * GEAR;
        let tau_g = torque(omega_g);
        let shaft = (tau_g + DAMPING[2] * omega_g) * GEAR / EFFICIENCY[0];
        Self { omega_r, omega_g, tau_g, twist: shaft / STIFFNESS, ..Self::default() }
    }

    /// Returns the derivatives, in the units of the state per second.
    pub(crate) fn slope(&self, held: &HeldInputs) -> Self {
        let Self { omega_r, omega_g, twist, tau_g, beta, rate } = *self;
        let lambda = (omega_r * RADIUS / held.wind).clamp(0.5, 25.0);
        let pressure = 0.5 * DENSITY * PI * RADIUS.powi(3) * held.wind * held.wind;
        let aerodynamic: f64 = beta
            .iter()
            .map(|beta| pressure / 3.0 * power_coefficient(lambda, *beta) / lambda)
            .sum();
        let shaft = STIFFNESS * twist + DAMPING[0] * (omega_r - omega_g / GEAR);
        Self {
            omega_r: (aerodynamic - shaft - DAMPING[1] * omega_r) / INERTIA[0],
            omega_g: (held.efficiency * shaft / GEAR - DAMPING[2] * omega_g - tau_g) / INERTIA[1],
            twist: omega_r - omega_g / GEAR,
            tau_g: CONVERTER * (held.torque - tau_g),
            beta: rate,
            rate: from_fn(|i| {
                let weighted = |part: fn([f64; 2]) -> f64| -> f64 {
                    held.actuators[i]
                        .iter()
                        .zip(PITCH)
                        .map(|(weight, mode)| weight * part(mode))
                        .sum()
                };
                let (stiffness, damping) = (
                    weighted(|[omega, _]| omega * omega),
                    weighted(|[omega, zeta]| 2.0 * zeta * omega),
                );
                stiffness * held.pitch_error[i] - damping * rate[i]
            }),
        }
    }

    /// Returns the state plus `factor` times `slope`.
    fn plus(&self, factor: f64, slope: &Self) -> Self {
        Self {
            omega_r: self.omega_r + factor * slope.omega_r,
            omega_g: self.omega_g + factor * slope.omega_g,
            twist: self.twist + factor * slope.twist,
            tau_g: self.tau_g + factor * slope.tau_g,
            beta: from_fn(|i| self.beta[i] + factor * slope.beta[i]),
            rate: from_fn(|i| self.rate[i] + factor * slope.rate[i]),
        }
    }

    /// Returns the state after `step` seconds, by a Runge-Kutta step of order 4.
    pub(crate) fn after(&self, held: &HeldInputs, step: f64) -> Self {
        let first = self.slope(held);
        let second = self.plus(0.5 * step, &first).slope(held);
        let third = self.plus(0.5 * step, &second).slope(held);
        let fourth = self.plus(step, &third).slope(held);
        let middle = second.plus(1.0, &third);
        self.plus(step / 6.0, &first.plus(1.0, &fourth).plus(2.0, &middle))
    }
}
