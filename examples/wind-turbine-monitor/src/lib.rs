//! Detects and isolates the faults of the wind turbine benchmark by residuals and CUSUM tests, sampled every
//! 10 ms. It knows the equations of the intact turbine, the commands and the measurements only.
#![forbid(unsafe_code)]

mod drive;
mod pitch;
mod test;

use fmu::{About, Experiment, Failure, Model, Step, Variable as V};

use drive::{Converter, Speeds};
use pitch::Blade;

/// Sample time, s.
const PERIOD: f64 = 0.01;
/// Standard deviations of the noise: degrees, rad/s, rad/s, N.m.
const NOISE_PITCH: f64 = 0.2;
const NOISE_ROTOR: f64 = 0.025;
const NOISE_GENERATOR: f64 = 0.05;
const NOISE_TORQUE: f64 = 90.0;

/// Inputs: name, description, unit, and number of channels.
const INPUTS: [(&str, &str, &str, usize); 7] = [
    ("beta_ref", "Commanded pitch angle", "deg", 1),
    ("tau_ref", "Commanded torque", "N.m", 1),
    ("beta_m1", "Pitch angle of each blade by its first sensor", "deg", 3),
    ("beta_m2", "Pitch angle of each blade by its second sensor", "deg", 3),
    ("omega_r_m", "Speed of the rotor by its two sensors", "rad/s", 2),
    ("omega_g_m", "Speed of the generator by its two sensors", "rad/s", 2),
    ("tau_g_m", "Measured torque of the generator", "N.m", 1),
];
/// Number of channels of all inputs.
const COUNT: usize = 13;

/// The decisions: name and description.
const FAULTS: [(&str, &str); 14] = [
    ("fault_beta_m1[1]", "Fault of the first pitch sensor of blade 1"),
    ("fault_beta_m1[2]", "Fault of the first pitch sensor of blade 2"),
    ("fault_beta_m1[3]", "Fault of the first pitch sensor of blade 3"),
    ("fault_beta_m2[1]", "Fault of the second pitch sensor of blade 1"),
    ("fault_beta_m2[2]", "Fault of the second pitch sensor of blade 2"),
    ("fault_beta_m2[3]", "Fault of the second pitch sensor of blade 3"),
    ("fault_omega_r_m[1]", "Fault of the rotor's first speed sensor"),
    ("fault_omega_r_m[2]", "Fault of the rotor's second speed sensor"),
    ("fault_omega_g_m[1]", "Fault of the generator's first speed sensor"),
    ("fault_omega_g_m[2]", "Fault of the generator's second speed sensor"),
    ("fault_pitch[1]", "Fault of the pitch actuator of blade 1"),
    ("fault_pitch[2]", "Fault of the pitch actuator of blade 2"),
    ("fault_pitch[3]", "Fault of the pitch actuator of blade 3"),
    ("fault_converter", "Fault of the converter"),
];

#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct WindTurbineMonitor {
    /// In the order of [`INPUTS`].
    inputs: [f64; COUNT],
    /// In the order of [`FAULTS`].
    faults: [bool; 14],
    /// Number of alarms that have started, of all faults.
    alarms: i32,
    blades: [Blade; 3],
    speeds: Speeds,
    converter: Converter,
    /// Time of the first sample in s.
    start: f64,
    /// Number of samples so far.
    samples: u32,
}

impl WindTurbineMonitor {
    /// Returns the pitch angle of a blade by its two sensors.
    fn pitch(&self, blade: usize) -> [f64; 2] {
        [self.inputs[2 + blade], self.inputs[5 + blade]]
    }

    /// Returns the speed of the rotor by its two sensors, then the speed of the generator.
    fn speeds(&self) -> [[f64; 2]; 2] {
        [[self.inputs[8], self.inputs[9]], [self.inputs[10], self.inputs[11]]]
    }

    fn take_sample(&mut self) {
        let [beta_ref, tau_ref, ..] = self.inputs;
        for i in 0..3 {
            let measured = self.pitch(i);
            self.blades[i].sample(beta_ref, measured);
        }
        let [rotor, generator] = self.speeds();
        self.speeds.sample(rotor, generator, self.converter.torque);
        self.converter.sample(self.inputs[12], tau_ref);
        self.samples += 1;
        let before = self.faults;
        for (i, blade) in self.blades.iter().enumerate() {
            [self.faults[i], self.faults[3 + i]] = blade.sensors.faulty;
            self.faults[10 + i] = blade.actuator_fault;
        }
        [self.faults[6], self.faults[7]] = self.speeds.rotor.faulty;
        [self.faults[8], self.faults[9]] = self.speeds.generator.faulty;
        self.faults[13] = self.converter.fault;
        let started =
            before.iter().zip(self.faults).filter(|(before, now)| !**before && *now).count();
        self.alarms = self.alarms.saturating_add(i32::try_from(started).unwrap_or(i32::MAX));
    }
}

impl Model for WindTurbineMonitor {
    const IDENTIFIER: &'static str = "WindTurbineMonitor";

    fn about(&self) -> About {
        let description = "Detects and isolates faults of the wind turbine benchmark".to_owned();
        About { description, ..fmu::about!(stop_time: 4400.0, step_size: PERIOD) }
    }

    fn new(_resources: &std::path::Path) -> Result<Self, Failure> {
        Ok(Self::default())
    }

    fn variables(&self) -> Vec<V<Self>> {
        let mut all = Vec::new();
        for (name, text, unit, channels) in INPUTS {
            for channel in 1..=channels {
                let name =
                    if channels == 1 { name.to_owned() } else { format!("{name}[{channel}]") };
                let place = all.len();
                let input = V::real(name, text, move |m: &mut Self| &mut m.inputs[place]);
                all.push(input.discrete().unit(unit).input());
            }
        }
        for (k, (name, text)) in FAULTS.into_iter().enumerate() {
            all.push(V::boolean(name, text, move |m: &mut Self| &mut m.faults[k]).output(&[]));
        }
        let alarms = V::integer("alarms", "Alarms that started", |m: &mut Self| &mut m.alarms);
        all.push(alarms.output(&[]));
        all
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        let inputs = self.inputs;
        *self = Self { inputs, start: experiment.start_time, ..Self::default() };
        self.blades = [0, 1, 2].map(|i| Blade::starting_at(self.pitch(i)));
        self.speeds = Speeds::starting_at(self.speeds()[1], self.inputs[12]);
        self.converter = Converter::starting_at(self.inputs[12]);
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        let next = |model: &Self| model.start + PERIOD * f64::from(model.samples);
        while next(self) < step.end() - 1e-6 * PERIOD {
            if self.samples == u32::MAX {
                return Err(Failure::Error("expected a run of at most 42949672 s".to_owned()));
            }
            self.take_sample();
        }
        Ok(())
    }
}

fmu::export!(WindTurbineMonitor);
#[cfg(test)]
mod tests;
