//! The reference controller of the benchmark: most power below rated power, constant power above.

use std::f64::consts::PI;

use crate::plant::{DENSITY, EFFICIENCY, GEAR, GENERATOR_EFFICIENCY, POWER_COEFFICIENT, RADIUS};

/// Rated power, W.
const RATED_POWER: f64 = 4.8e6;
/// Rated speed of the generator, rad/s.
const RATED_SPEED: f64 = 162.0;
/// Difference between the rated speed and the speed at which the operation at constant power ends, rad/s.
const HYSTERESIS: f64 = 15.0;
/// Gains of the pitch controller: degrees per rad/s, and per rad.
const PROPORTIONAL: f64 = 4.0;
const INTEGRAL: f64 = 1.0;
/// Range of the commanded pitch angle, degrees.
const PITCH: [f64; 2] = [-2.0, 90.0];

/// The state of the controller from one sample to the next.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Controller {
    /// Whether it keeps the power constant; otherwise it takes most power.
    constant_power: bool,
    /// The last deviation from the rated speed, rad/s.
    excess: f64,
    /// Commanded pitch angle, degrees.
    pub(crate) beta_ref: f64,
    /// Commanded torque, N.m.
    pub(crate) tau_ref: f64,
}

/// Returns the torque in N.m that gives most power at the generator speed `omega_g` in rad/s, `K_opt omega_g^2`. The
/// optimal tip-speed ratio is 8.
pub(crate) fn optimal_torque(omega_g: f64) -> f64 {
    let speed = omega_g / (8.0 * GEAR);
    let swept = 0.5 * DENSITY * PI * RADIUS.powi(5);
    swept * EFFICIENCY[0] * POWER_COEFFICIENT * speed * speed / (8.0 * GEAR)
}

impl Controller {
    /// Takes a sample: measured speed in rad/s, measured power in W, sample time in s.
    pub(crate) fn sample(&mut self, omega_g: f64, power: f64, period: f64) {
        let excess = omega_g - RATED_SPEED;
        let was_constant = self.constant_power;
        self.constant_power = if was_constant {
            excess >= -HYSTERESIS
        } else {
            power >= RATED_POWER || excess >= 0.0
        };
        if self.constant_power {
            let last = if was_constant { self.excess } else { excess };
            let change = PROPORTIONAL * (excess - last) + INTEGRAL * period * last;
            self.beta_ref = (self.beta_ref + change).clamp(PITCH[0], PITCH[1]);
            self.tau_ref = RATED_POWER / (GENERATOR_EFFICIENCY * omega_g.max(1.0));
        } else {
            self.beta_ref = 0.0;
            self.tau_ref = optimal_torque(omega_g);
        }
        self.excess = excess;
    }
}
