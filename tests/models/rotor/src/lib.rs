//! The rotor of the wind turbine benchmark with its drive train, for model exchange: wind, torque of the generator and pitch
//! angle are inputs. An estimator carries it.
#![forbid(unsafe_code)]

#[path = "../../../../examples/wind-turbine/src/plant.rs"]
#[allow(dead_code, reason = "the benchmark uses the rest")]
mod plant;

use fmu::{Failure, Model, Variables};
use plant::{EFFICIENCY, HeldInputs, State};

/// Fields without a comment have the description of their variable.
#[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
struct Rotor {
    /// Speed of the wind
    #[fmu(input, unit = "m/s", start = 12, min = 0.1)]
    v: f64,
    /// Torque of the generator
    #[fmu(input, unit = "N.m", nominal = 1e4, start = 2e4)]
    tau_g: f64,
    /// Pitch angle of all blades
    #[fmu(input, unit = "deg")]
    beta: f64,
    /// Speed of the rotor
    #[fmu(output, unit = "rad/s", start = 1.67)]
    omega_r: f64,
    /// Derivative of the speed of the rotor
    #[fmu(derivative_of = omega_r, unit = "rad/s2")]
    acceleration_r: f64,
    /// Speed of the generator
    #[fmu(output, unit = "rad/s", nominal = 100, start = 158.65)]
    omega_g: f64,
    /// Derivative of the speed of the generator
    #[fmu(derivative_of = omega_g, unit = "rad/s2")]
    acceleration_g: f64,
    /// Twist of the shaft
    #[fmu(output, unit = "rad", nominal = 1e-3, start = 1e-3)]
    twist: f64,
    /// Rate of the twist
    #[fmu(derivative_of = twist, unit = "rad/s")]
    twist_rate: f64,
}

#[fmu::model(stop_time = 100)]
impl Model for Rotor {
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        let Self { v, tau_g, beta, omega_r, omega_g, twist, .. } = *self;
        let held = HeldInputs {
            wind: v,
            torque: tau_g,
            pitch_error: [0.0; 3],
            actuators: [[1.0, 0.0, 0.0]; 3],
            efficiency: EFFICIENCY[0],
        };
        let state = State { omega_r, omega_g, twist, tau_g, beta: [beta; 3], rate: [0.0; 3] };
        let slope = state.slope(&held);
        self.acceleration_r = slope.omega_r;
        self.acceleration_g = slope.omega_g;
        self.twist_rate = slope.twist;
        Ok(())
    }
}

fmu::export!(Rotor);
