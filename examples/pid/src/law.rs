//! The control law, without FMI.

use serde::{Deserialize, Serialize};

/// A PID controller: every `T_s`, `u = K (e - T_d y') + sum of K e T_s / T_i` with `e = w - y`,
/// limited to `u_max`.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(crate) struct Law {
    pub(crate) mode: i32,
    pub(crate) hold: bool,
    pub(crate) sample_time: f64,
    pub(crate) u: f64,
    setpoint: f64,
    measurement: f64,
    manual: f64,
    gain: f64,
    integral_time: f64,
    derivative_time: f64,
    limit: f64,
    integral: f64,
    last_measurement: f64,
}

/// Name, description, unit, limits and field of a number.
pub(crate) type Real = (&'static str, &'static str, &'static str, [f64; 2], Field);
type Field = fn(&mut Law) -> &mut f64;

pub(crate) const INPUTS: [Real; 3] = [
    ("w", "Setpoint", "1", [-1e9, 1e9], |law| &mut law.setpoint),
    ("y", "Measurement", "1", [-1e9, 1e9], |law| &mut law.measurement),
    ("u_manual", "Command in manual mode", "1", [-1e9, 1e9], |law| &mut law.manual),
];

pub(crate) const PARAMETERS: [Real; 5] = [
    ("K", "Gain", "1", [-1e9, 1e9], |law| &mut law.gain),
    ("T_i", "Integral time", "s", [1e-6, 1e9], |law| &mut law.integral_time),
    ("T_d", "Derivative time", "s", [0.0, 1e9], |law| &mut law.derivative_time),
    ("T_s", "Sample time", "s", [1e-6, 1e9], |law| &mut law.sample_time),
    ("u_max", "Limit of u in either direction", "1", [0.0, 1e9], |law| &mut law.limit),
];

impl Law {
    pub(crate) fn new() -> Self {
        let (gain, integral_time, sample_time, limit) = (1.0, 1.0, 0.1, 10.0);
        Self { gain, integral_time, sample_time, limit, hold: true, ..Self::default() }
    }

    /// Resets the controller to the time before its first sample; returns the status.
    pub(crate) fn start(&mut self) -> String {
        (self.u, self.integral, self.last_measurement) = (0.0, 0.0, self.measurement);
        "no sample yet".to_owned()
    }

    /// Takes a sample and returns the status: the mode, and whether u is limited.
    ///
    /// Outside of the automatic mode, and with anti-windup also at a limit, the integral is set to the
    /// value for which the law gives u, so that u does not jump when the law takes over again.
    pub(crate) fn sample(&mut self) -> String {
        let error = self.setpoint - self.measurement;
        let slope = (self.measurement - self.last_measurement) / self.sample_time;
        let rest = self.gain * (error - self.derivative_time * slope);
        let integral = self.integral + self.gain * error * self.sample_time / self.integral_time;
        let (command, mode) = match self.mode {
            1 => (self.manual, "manual"),
            2 => (rest + integral, "automatic"),
            _ => (0.0, "off"),
        };
        self.u = command.clamp(-self.limit, self.limit);
        let limited = command.abs() > self.limit;
        let is_tracking = self.mode != 2 || limited && self.hold;
        self.integral = if is_tracking { self.u - rest } else { integral };
        self.last_measurement = self.measurement;
        if limited { format!("{mode}, limited") } else { mode.to_owned() }
    }
}
