//! The file `resources/filter.toml` of a Kalman filter that carries its plant.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::design::Signal;
use crate::matrix::Matrix;

/// The content of the file: n states, m commands, p measurements, q states of the fault model, N = n + q.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KalmanDesign {
    /// What the filter is for, in one sentence.
    pub description: String,
    /// The sample time T in s.
    pub sample_time: f64,
    /// Number of integration steps in a sample.
    pub integration_steps: i32,
    /// End of the default experiment in s.
    pub stop_time: f64,
    /// W, N x N: the covariance of the process noise of one sample.
    #[serde(rename = "W")]
    pub w: Matrix,
    /// V, p x p: the covariance of the noise of one sample of the measurements.
    #[serde(rename = "V")]
    pub v: Matrix,
    /// P, N x N: the covariance of the estimate before the first sample.
    #[serde(rename = "P")]
    pub p: Matrix,
    /// Values of parameters and inputs of the plant's FMU.
    pub settings: BTreeMap<String, f64>,
    /// The m commands, inputs of the plant's FMU.
    pub commands: Vec<Signal>,
    /// The p measurements, outputs of the plant's FMU.
    pub measurements: Vec<Signal>,
    /// The n states of the plant's FMU, with the estimate before the first sample.
    pub states: Vec<Signal>,
    /// The faults.
    pub faults: Vec<CarriedFault>,
}

/// A fault that is estimated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarriedFault {
    /// The name of the fault.
    pub name: String,
    /// The unit of the fault, as FMI writes it.
    pub unit: Option<String>,
    /// The description of the fault for a reader.
    #[serde(default)]
    pub description: String,
    /// The signal to which the fault is added.
    pub enters: Entry,
    /// For a ramp, the position of its rate among the states of the fault model; `None` for a constant fault. The first
    /// states of the fault model are the faults, in their order.
    pub rate: Option<usize>,
}

/// The signal to which a fault is added.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Entry {
    /// The command at this position.
    Actuator(usize),
    /// The measurement at this position.
    Sensor(usize),
    /// The input of the plant's FMU with this name.
    Input(String),
}

impl KalmanDesign {
    /// Number of states of the fault model: the faults and the rates of ramps.
    #[must_use]
    pub fn fault_states(&self) -> usize {
        self.faults.len() + self.faults.iter().filter(|fault| fault.rate.is_some()).count()
    }

    /// Reads a file; errors name `path`.
    ///
    /// # Errors
    ///
    /// A sentence with `path`: the text is no such file, a number is out of its range, a shape does not fit, a fault
    /// names a command, a measurement or a rate that does not exist, or two faults name the same one.
    pub fn parse(text: &str, path: &str) -> Result<Self, String> {
        let design: Self = toml::from_str(text).map_err(|error| format!("{path}: {error}"))?;
        design.check().map_err(|text| format!("{path}: {text}"))?;
        Ok(design)
    }

    fn check(&self) -> Result<(), String> {
        let positive = |name, value: f64| {
            let is_positive = value.is_finite() && value > 0.0;
            is_positive.then_some(()).ok_or(format!("{name} = {value}, expected a number above 0"))
        };
        positive("sample_time", self.sample_time)?;
        positive("stop_time", self.stop_time)?;
        positive("integration_steps", f64::from(self.integration_steps))?;
        let (q, p) = (self.fault_states(), self.measurements.len());
        let size = self.states.len() + q;
        for (name, matrix, expected) in
            [("W", &self.w, size), ("V", &self.v, p), ("P", &self.p, size)]
        {
            let (rows, columns) = (matrix.rows, matrix.columns);
            if (rows, columns) != (expected, expected) {
                return Err(format!(
                    "{name} is {rows} x {columns}, expected {expected} x {expected}"
                ));
            }
            if matrix.values.iter().any(|value| !value.is_finite()) {
                return Err(format!("{name} has a number that is not finite"));
            }
        }
        let (m, faults) = (self.commands.len(), self.faults.len());
        let check_position = |what: &str, at: usize, count: usize| {
            (at < count).then_some(()).ok_or(format!("a fault names {what} {at} of {count}"))
        };
        for (position, fault) in self.faults.iter().enumerate() {
            match fault.enters {
                Entry::Actuator(at) => check_position("command", at, m)?,
                Entry::Sensor(at) => check_position("measurement", at, p)?,
                Entry::Input(_) => {}
            }
            if let Some(rate) = fault.rate {
                check_position("rate", rate, q)?;
                (rate >= faults).then_some(()).ok_or("the rate of a fault is a fault")?;
            }
            for other in &self.faults[..position] {
                let shared = if other.enters == fault.enters {
                    "enter at the same signal; expected one fault in place of both"
                } else if fault.rate.is_some() && other.rate == fault.rate {
                    "have the same rate; expected a position for each"
                } else {
                    continue;
                };
                return Err(format!("the faults `{}` and `{}` {shared}", other.name, fault.name));
            }
        }
        Ok(())
    }

    /// The text of the file.
    ///
    /// # Errors
    ///
    /// The error of the serializer for an entry that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks a filter of one state, for two ramps that add to these commands and whose rates are at these positions.
    fn check(commands: [usize; 2], rates: [usize; 2]) -> Result<(), String> {
        let signal = |name: &str| Signal {
            name: name.to_owned(),
            unit: None,
            description: String::new(),
            operating: None,
        };
        let ramp = |(name, command, rate): (&str, usize, usize)| CarriedFault {
            name: name.to_owned(),
            unit: None,
            description: String::new(),
            enters: Entry::Actuator(command),
            rate: Some(rate),
        };
        let ones = |size| Matrix { rows: size, columns: size, values: vec![1.0; size * size] };
        let faults = [("f", commands[0], rates[0]), ("g", commands[1], rates[1])];
        let design = KalmanDesign {
            description: String::new(),
            sample_time: 1.0,
            integration_steps: 1,
            stop_time: 10.0,
            w: ones(5),
            v: ones(1),
            p: ones(5),
            settings: BTreeMap::new(),
            commands: ["u", "v"].map(signal).into(),
            measurements: vec![signal("y")],
            states: vec![signal("x")],
            faults: faults.map(ramp).into(),
        };
        design.check()
    }

    /// Two ramps have four states: two faults and two rates, so the faults cannot share a rate.
    #[test]
    fn each_fault_has_a_signal_and_a_rate_of_its_own() {
        assert_eq!(check([0, 1], [2, 3]), Ok(()));
        let refused = |text: &str| Err::<(), _>(format!("the faults `f` and `g` {text}"));
        let expected = "enter at the same signal; expected one fault in place of both";
        assert_eq!(check([1, 1], [2, 3]), refused(expected));
        let expected = "have the same rate; expected a position for each";
        assert_eq!(check([0, 1], [3, 3]), refused(expected));
    }
}
