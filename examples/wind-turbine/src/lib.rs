//! The wind turbine benchmark of Odgaard, Stoustrup and Kinnaert: a turbine of 4.8 MW with its reference
//! controller, noisy sensors and nine faults, sampled every 10 ms.
#![forbid(unsafe_code)]

mod controller;
mod noise;
mod plant;

use std::array::from_fn;

use fmu::{Experiment, Failure, Model, Step, Variables};

use controller::{Controller, optimal_torque};
use plant::{EFFICIENCY, GENERATOR_EFFICIENCY, HeldInputs, State};

/// Sample time, s.
const PERIOD: f64 = 0.01;
/// Length scale of the turbulence, m.
const LENGTH: f64 = 600.0;
/// Standard deviations of the noise: wind in m/s, speeds of rotor and generator in rad/s, torque in N.m, power
/// in W, pitch angles in degrees.
const NOISE: [f64; 6] = [0.5, 0.025, 0.05, 90.0, 1e3, 0.2];
/// Time in s in which fault 7 grows, and in which it shrinks again.
const RISE: f64 = 30.0;

/// The model. The comment of a field is the description of its variable; skipped fields are no variables.
#[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
struct WindTurbine {
    /// Mean speed of the wind
    #[fmu(input, unit = "m/s", min = 3, max = 30, start = 12)]
    v_mean: f64,
    /// Intensity of the turbulence: standard deviation over mean
    #[fmu(parameter, unit = "1", min = 0, max = 0.3, start = 0.12)]
    turbulence: f64,
    /// Factor of the noise of all sensors
    #[fmu(parameter, unit = "1", min = 0, max = 10, start = 1)]
    noise: f64,
    /// Seed of turbulence and noise
    #[fmu(parameter, min = 0, max = 2_147_483_647, start = 1)]
    seed: i32,
    /// Start of each fault
    #[fmu(parameter, unit = "s", start = [2000.0, 2300.0, 2600.0, 1500.0, 1000.0, 2900.0, 3400.0, 3800.0, 4100.0])]
    fault_from: [f64; 9],
    /// End of each fault; a fault that ends before its start does not happen
    #[fmu(parameter, unit = "s", start = [2100.0, 2400.0, 2700.0, 1600.0, 1100.0, 3000.0, 3500.0, 3900.0, 4300.0])]
    fault_until: [f64; 9],
    /// Measured speed of the wind
    #[fmu(output, discrete, unit = "m/s")]
    v_m: f64,
    /// Speed of the rotor by its two sensors
    #[fmu(output, discrete, unit = "rad/s")]
    omega_r_m: [f64; 2],
    /// Speed of the generator by its two sensors
    #[fmu(output, discrete, unit = "rad/s")]
    omega_g_m: [f64; 2],
    /// Measured torque of the generator
    #[fmu(output, discrete, unit = "N.m")]
    tau_g_m: f64,
    /// Measured power
    #[fmu(output, discrete, unit = "W")]
    p_g_m: f64,
    /// Pitch angle of each blade by its first sensor
    #[fmu(output, discrete, unit = "deg")]
    beta_m1: [f64; 3],
    /// Pitch angle of each blade by its second sensor
    #[fmu(output, discrete, unit = "deg")]
    beta_m2: [f64; 3],
    /// Commanded pitch angle
    #[fmu(output, discrete, unit = "deg")]
    beta_ref: f64,
    /// Commanded torque
    #[fmu(output, discrete, unit = "N.m")]
    tau_ref: f64,
    /// Speed of the wind
    #[fmu(discrete, unit = "m/s")]
    v: f64,
    /// Speed of the rotor
    #[fmu(discrete, unit = "rad/s")]
    omega_r: f64,
    /// Speed of the generator
    #[fmu(discrete, unit = "rad/s")]
    omega_g: f64,
    /// Torque of the generator
    #[fmu(discrete, unit = "N.m")]
    tau_g: f64,
    /// Pitch angle of each blade
    #[fmu(discrete, unit = "deg")]
    beta: [f64; 3],
    /// Turbulence over its standard deviation.
    #[fmu(skip)]
    gust: f64,
    /// Number of the next sample.
    #[fmu(skip)]
    sample: u32,
    /// Start of the run in s.
    #[fmu(skip)]
    start: f64,
    #[fmu(skip)]
    state: State,
    #[fmu(skip)]
    controller: Controller,
}

impl WindTurbine {
    /// Returns the time of a sample in s.
    fn instant(&self, sample: u32) -> f64 {
        self.start + PERIOD * f64::from(sample)
    }

    /// Returns the degree of fault `number` (1 to 9) at `time`: 0 without the fault, 1 with the full fault.
    fn fault(&self, number: usize, time: f64) -> f64 {
        let [from, until] = [self.fault_from[number - 1], self.fault_until[number - 1]];
        let active = time >= from - 1e-6 * PERIOD && time < until - 1e-6 * PERIOD;
        match number {
            _ if !active => 0.0,
            7 => ((time - from).min(until - time) / RISE).min(1.0),
            _ => 1.0,
        }
    }

    /// Returns the random number of a channel for the next sample.
    fn random(&self, channel: u64) -> f64 {
        noise::normal(u64::from(self.seed.unsigned_abs()), channel, u64::from(self.sample))
    }

    /// Measures, controls, and advances the state to the next sample.
    fn take_sample(&mut self) {
        let time = self.instant(self.sample);
        self.v = self.v_mean * (1.0 + self.turbulence * self.gust).max(0.2);
        self.measure(time);
        let speed = 0.5 * (self.omega_g_m[0] + self.omega_g_m[1]);
        self.controller.sample(speed, self.p_g_m, PERIOD);
        (self.beta_ref, self.tau_ref) = (self.controller.beta_ref, self.controller.tau_ref);
        let memory = libm::exp(-PERIOD * self.v_mean / LENGTH);
        self.gust = memory * self.gust + libm::sqrt(1.0 - memory * memory) * self.random(0);
        let [pressure, air] = [6, 7].map(|number| self.fault(number, time));
        let held = HeldInputs {
            wind: self.v,
            torque: self.tau_ref + 2000.0 * self.fault(8, time),
            pitch_error: from_fn(|i| self.beta_ref - 0.5 * (self.beta_m1[i] + self.beta_m2[i])),
            actuators: [[1.0, 0.0, 0.0], [1.0 - pressure, pressure, 0.0], [1.0 - air, 0.0, air]],
            efficiency: if self.fault(9, time) > 0.0 { EFFICIENCY[1] } else { EFFICIENCY[0] },
        };
        self.state = self.state.after(&held, PERIOD);
        self.sample += 1;
    }

    /// Sets the variables of the plant and the measurements at `time`.
    fn measure(&mut self, time: f64) {
        let State { omega_r, omega_g, tau_g, beta, .. } = self.state;
        (self.omega_r, self.omega_g, self.tau_g, self.beta) = (omega_r, omega_g, tau_g, beta);
        let deviations = NOISE.map(|deviation| self.noise * deviation);
        let with_noise =
            |value: f64, kind: usize, channel: u64| value + deviations[kind] * self.random(channel);
        let v_m = with_noise(self.v, 0, 1);
        let mut rotor = [2, 3].map(|channel| with_noise(omega_r, 1, channel));
        let mut generator = [4, 5].map(|channel| with_noise(omega_g, 2, channel));
        let tau_g_m = with_noise(tau_g, 3, 6);
        let p_g_m = with_noise(GENERATOR_EFFICIENCY * omega_g * tau_g, 4, 7);
        let [mut first, mut second] = [[8, 9, 10], [11, 12, 13]]
            .map(|channels: [u64; 3]| from_fn(|i| with_noise(beta[i], 5, channels[i])));
        let faulty = |number| self.fault(number, time) > 0.0;
        if faulty(1) {
            first[0] = 5.0;
        }
        if faulty(2) {
            second[1] *= 1.2;
        }
        if faulty(3) {
            first[2] = 10.0;
        }
        if faulty(4) {
            rotor[0] = 1.4;
        }
        if faulty(5) {
            rotor[1] *= 1.1;
            generator[0] *= 0.9;
        }
        (self.v_m, self.tau_g_m, self.p_g_m) = (v_m, tau_g_m, p_g_m);
        (self.omega_r_m, self.omega_g_m) = (rotor, generator);
        (self.beta_m1, self.beta_m2) = (first, second);
    }
}

#[fmu::model(stop_time = 4400, step_size = 0.01)]
impl Model for WindTurbine {
    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        (self.start, self.sample, self.gust) = (experiment.start_time, 0, 0.0);
        // At 11.5 m/s the turbine is still below its rated power and speed.
        self.state = State::at_optimal_speed(self.v_mean.min(11.5), optimal_torque);
        self.controller = Controller::default();
        self.take_sample();
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        while self.instant(self.sample) <= step.end() + 1e-6 * PERIOD {
            if self.sample == u32::MAX {
                return Err(Failure::Error("expected a run of at most 42949672 s".to_owned()));
            }
            self.take_sample();
        }
        Ok(())
    }
}

fmu::export!(WindTurbine);
#[cfg(test)]
mod tests;
