//! The design file `resources/design.toml`: the matrices of plant, gains and observer, and the
//! names and units of the signals.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// A design as the file states it. Shapes: n states, m actuators, p measurements, q faults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Design {
    /// What the controller is for, in one sentence.
    pub(crate) description: String,
    /// Start of the compensation in s.
    pub(crate) t_on: f64,
    /// Whether the fault is estimated while it is not compensated.
    #[serde(default)]
    pub(crate) monitor: bool,
    /// A, n x n.
    #[serde(rename = "A")]
    pub(crate) a: Matrix,
    /// B, n x m.
    #[serde(rename = "B")]
    pub(crate) b: Matrix,
    /// C, p x n.
    #[serde(rename = "C")]
    pub(crate) c: Matrix,
    /// F_a, n x q.
    #[serde(rename = "F_a")]
    pub(crate) f_a: Matrix,
    /// K_x, m x n.
    #[serde(rename = "K_x")]
    pub(crate) k_x: Matrix,
    /// K_f, m x q.
    #[serde(rename = "K_f")]
    pub(crate) k_f: Matrix,
    /// L_x, n x p.
    #[serde(rename = "L_x")]
    pub(crate) l_x: Matrix,
    /// L_f, q x p.
    #[serde(rename = "L_f")]
    pub(crate) l_f: Matrix,
    /// The n states.
    pub(crate) states: Vec<Signal>,
    /// The m actuators.
    pub(crate) actuators: Vec<Actuator>,
    /// The p measurements; their names are those of the inputs.
    pub(crate) measurements: Vec<Signal>,
    /// The q fault channels.
    pub(crate) faults: Vec<Signal>,
    /// The experiment that importers run by default.
    pub(crate) experiment: Defaults,
}

/// Name and unit of a signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Signal {
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) unit: Option<String>,
    #[serde(default)]
    pub(crate) description: String,
}

/// An actuator, with its limits where it has any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Actuator {
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) unit: Option<String>,
    #[serde(default)]
    pub(crate) description: String,
    /// The smallest and the largest command.
    #[serde(default)]
    pub(crate) limits: Option<[f64; 2]>,
}

/// `DefaultExperiment`, times in s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Defaults {
    pub(crate) stop_time: f64,
    pub(crate) step_size: f64,
}

/// Why a design file cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DesignError {
    #[error("{path}: {source}")]
    Unreadable { path: String, source: std::io::Error },
    #[error("{path}: {message}")]
    Malformed { path: String, message: String },
    #[error("{path}: {matrix} is {found}, expected {expected} ({meaning})")]
    Shape { path: String, matrix: &'static str, found: String, expected: String, meaning: String },
    #[error("{path}: {what} = {value}, expected {rule}")]
    Value { path: String, what: String, value: f64, rule: &'static str },
    #[error("{path}: {what}")]
    Empty { path: String, what: &'static str },
}

impl Design {
    /// Reads `design.toml` in the folder `resources`.
    pub(crate) fn read(resources: &Path) -> Result<Self, DesignError> {
        let file = resources.join("design.toml");
        let path = file.display().to_string();
        match std::fs::read_to_string(&file) {
            Ok(text) => Self::parse(&text, path),
            Err(source) => Err(DesignError::Unreadable { path, source }),
        }
    }

    /// Reads a design from `text`; `path` is for messages.
    pub(crate) fn parse(text: &str, path: String) -> Result<Self, DesignError> {
        let design: Self = match toml::from_str(text) {
            Ok(design) => design,
            Err(error) => {
                return Err(DesignError::Malformed {
                    path,
                    message: error.to_string().trim_end().to_owned(),
                });
            }
        };
        design.check_counts(&path)?;
        design.check_shapes(&path)?;
        design.check_values(&path)?;
        Ok(design)
    }

    fn check_counts(&self, path: &str) -> Result<(), DesignError> {
        let counts = [
            (self.states.len(), "at least one state is needed"),
            (self.actuators.len(), "at least one actuator is needed"),
            (self.measurements.len(), "at least one measurement is needed"),
            (self.faults.len(), "at least one fault is needed"),
        ];
        match counts.iter().find(|(count, _)| *count == 0) {
            Some(&(_, what)) => Err(DesignError::Empty { path: path.to_owned(), what }),
            None if self.actuators.len() > 64 => {
                Err(DesignError::Empty { path: path.to_owned(), what: "more than 64 actuators" })
            }
            None => Ok(()),
        }
    }

    fn check_shapes(&self, path: &str) -> Result<(), DesignError> {
        let n = ("states", self.states.len());
        let m = ("actuators", self.actuators.len());
        let p = ("measurements", self.measurements.len());
        let q = ("faults", self.faults.len());
        let expected = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p)];
        for ((matrix, found), (rows, columns)) in self.matrices().into_iter().zip(expected) {
            if (found.rows, found.columns) != (rows.1, columns.1) {
                return Err(DesignError::Shape {
                    path: path.to_owned(),
                    matrix,
                    found: format!("{} x {}", found.rows, found.columns),
                    expected: format!("{} x {}", rows.1, columns.1),
                    meaning: format!("{} x {}", rows.0, columns.0),
                });
            }
        }
        Ok(())
    }

    fn check_values(&self, path: &str) -> Result<(), DesignError> {
        let refuse = |what: String, value: f64, rule: &'static str| {
            Err(DesignError::Value { path: path.to_owned(), what, value, rule })
        };
        for (name, matrix) in self.matrices() {
            for (k, &value) in matrix.values.iter().enumerate() {
                if !value.is_finite() {
                    return refuse(matrix.element(name, k), value, "a finite number");
                }
            }
        }
        if !self.t_on.is_finite() {
            return refuse("t_on".to_owned(), self.t_on, "a time in s");
        }
        for actuator in &self.actuators {
            if let Some([low, high]) = actuator.limits
                && !(low.is_finite() && high.is_finite() && low < high)
            {
                let what = format!("limits of {} from {low} to", actuator.name);
                return refuse(what, high, "two finite numbers, the smaller one first");
            }
        }
        let Defaults { stop_time, step_size } = self.experiment;
        if !(step_size > 0.0 && step_size.is_finite()) {
            return refuse("step_size".to_owned(), step_size, "more than 0 s");
        }
        if !(stop_time > step_size && stop_time.is_finite()) {
            return refuse("stop_time".to_owned(), stop_time, "more than step_size");
        }
        Ok(())
    }

    /// The eight matrices by the name that the file and the variables have.
    pub(crate) fn matrices(&self) -> [(&'static str, &Matrix); 8] {
        [
            ("A", &self.a),
            ("B", &self.b),
            ("C", &self.c),
            ("F_a", &self.f_a),
            ("K_x", &self.k_x),
            ("K_f", &self.k_f),
            ("L_x", &self.l_x),
            ("L_f", &self.l_f),
        ]
    }
}
