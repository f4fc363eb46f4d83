//! The text of a new plant file.

use std::fmt::Write as _;
use std::path::Path;

use fmu_description::unit::Unit;
use nalgebra::DMatrix;
use plant_file::signals::Signal;

/// A plant, before its plant file is written.
pub(super) struct Draft {
    /// The source of the plant, in one line.
    pub(super) origin: String,
    pub(super) model: Model,
    pub(super) actuators: Vec<Signal>,
    pub(super) measurements: Vec<Signal>,
    /// Names of outputs that are not used as measurements, because a command enters them directly.
    pub(super) left_out: Vec<String>,
    pub(super) has_feedthrough: bool,
    pub(super) identification: Identification,
}

/// The results of an identification; for other plants only `warnings`.
#[derive(Default)]
pub(super) struct Identification {
    /// Time, s, between the samples of the log.
    pub(super) sample_time: Option<f64>,
    /// Relative tolerance of the entries.
    pub(super) tolerance: Option<f64>,
    /// The method and the quality of the identification, in lines.
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

pub(super) enum Model {
    Matrices {
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        states: Vec<Signal>,
        /// Sample time, s, of sampled matrices.
        sampled: Option<f64>,
    },
    Fmu {
        path: String,
        inputs: Vec<(String, f64)>,
    },
}

/// The choices for a new plant file.
#[derive(Clone)]
pub(super) struct Settings {
    /// The actuators that may be faulty.
    pub(super) faulty: Vec<usize>,
    /// Rate of the measurement filter, 1/s.
    pub(super) filter: Option<f64>,
    pub(super) bandwidths: Option<Bandwidths>,
}

/// The bandwidths of feedback and observer, rad/s.
#[derive(Clone, Copy)]
pub(super) struct Bandwidths {
    pub(super) feedback: f64,
    pub(super) observer: f64,
}

impl Draft {
    /// Removes units that FMI does not know, which a plant file cannot state; each is a warning.
    pub(super) fn without_unknown_units(mut self) -> Self {
        let Self { model, actuators, measurements, identification, .. } = &mut self;
        let states: &mut [Signal] = match model {
            Model::Matrices { states, .. } => states,
            Model::Fmu { .. } => &mut [],
        };
        for signal in states.iter_mut().chain(actuators).chain(measurements) {
            let Some(Err(error)) = signal.unit.as_deref().map(Unit::parse) else { continue };
            signal.unit = None;
            let warning = format!("the unit of {} is left out: {error}", signal.name);
            // A state and a measurement may be one signal.
            if !identification.warnings.contains(&warning) {
                identification.warnings.push(warning);
            }
        }
        self
    }

    /// Returns the plant file. `refusal`: the lines that say why no controller was found; empty if one was found.
    pub(super) fn text(&self, settings: &Settings, refusal: &[&str]) -> String {
        let mut text = format!(
            "# Plant: {}. Each entry is described in the reference of plant files.\n\n",
            self.origin
        );
        self.notes(&mut text);
        self.plant(&mut text);
        list(&mut text, "actuators", &self.actuators);
        list(&mut text, "measurements", &self.measurements);
        if !self.left_out.is_empty() {
            let _ = writeln!(
                text,
                "# Left out, as they contain a command: {}",
                self.left_out.join(", ")
            );
        }
        self.faults(&mut text, settings);
        if let Some(rate) = settings.filter {
            text += "\n# 1/s, rate of the low-pass filters of the measurements, as these contain a command.\n";
            line(&mut text, "filter", rate);
        }
        if !refusal.is_empty() {
            text += "\n# No controller was found for this plant yet:\n";
            for line in refusal {
                let _ = writeln!(text, "#   {}", line.trim_end());
            }
        }
        if let Some(Bandwidths { feedback, observer }) = settings.bandwidths {
            text += "\n# rad/s. A larger bandwidth is faster, and asks for larger commands and better sensors.\n";
            line(&mut text, "feedback.bandwidth", feedback);
            line(&mut text, "observer.bandwidth", observer);
        }
        if let Some(tolerance) = self.identification.tolerance {
            text += "\n# Two standard deviations of the identification, as a part of each entry of A, B and C.\n";
            line(&mut text, "robustness.tolerance", tolerance);
        }
        text += "\n# Often needed as well:\n";
        let sampled = matches!(self.model, Model::Matrices { sampled: Some(_), .. });
        if self.identification.sample_time.is_none() && !sampled {
            text += "# sample_time = 0.01                  # s, of a controller that acts at regular times\n";
        }
        if self.identification.tolerance.is_none() {
            text += "# robustness.tolerance = 0.1          # each entry of A, B and C may differ by 10 %\n";
        }
        text +=
            "# In a table of `actuators`, limits = [-10, 10] states what the actuator can do.\n";
        text
    }

    fn notes(&self, text: &mut String) {
        for note in &self.identification.notes {
            let _ = writeln!(text, "# {note}");
        }
        for warning in &self.identification.warnings {
            let _ = writeln!(text, "# Warning: {warning}.");
        }
        if !self.identification.notes.is_empty() || !self.identification.warnings.is_empty() {
            *text += "\n";
        }
        if let Some(period) = self.identification.sample_time {
            *text += "# s, the time between the samples of the log.\n";
            line(text, "sample_time", period);
        }
    }

    fn plant(&self, text: &mut String) {
        match &self.model {
            Model::Matrices { a, b, c, d, states, sampled } => {
                if let Some(period) = sampled {
                    *text += "# x[k+1] = A x[k] + B u[k], y = C x + D u, in deviations from the operating point.\n\
                              matrices = \"sampled\"\n";
                    line(text, "sample_time", *period);
                } else {
                    *text += "# x' = A x + B u, y = C x + D u, in deviations from the operating point.\n";
                }
                for (name, matrix) in [("A", a), ("B", b), ("C", c)] {
                    self::matrix(text, name, matrix);
                }
                if self.has_feedthrough {
                    self::matrix(text, "D", d);
                }
                list(text, "states", states);
            }
            Model::Fmu { path, inputs } => {
                let _ = writeln!(text, "plant = {}", quoted(path));
                *text += "\n# The operating point: inputs, parameters and states; others have their start values.\n\
                          # Commands must move the plant there: a friction that holds it is a parameter to state, as 0.\n";
                for (name, value) in inputs {
                    let _ = writeln!(text, "operating_point.{} = {value}", key(name));
                }
                *text += "\n";
            }
        }
    }

    fn faults(&self, text: &mut String, settings: &Settings) {
        if settings.faulty.len() == self.actuators.len() {
            *text += "\n# What adds to each command, a friction or an offset, is estimated and cancelled.\n\
                      actuator_faults = \"all\"\n";
            return;
        }
        *text += "\n# What adds to these commands is estimated and cancelled. The measurements cannot tell apart that of \
                  all actuators.\n";
        let names = settings.faulty.iter().map(|&at| quoted(&self.actuators[at].name));
        let names = names.collect::<Vec<_>>().join(", ");
        let _ = writeln!(text, "actuator_faults = [{names}]");
    }
}

/// Returns the name of a file without its folder.
pub(super) fn shown(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn line(text: &mut String, key: &str, value: f64) {
    let _ = writeln!(text, "{key} = {value}");
}

fn matrix(text: &mut String, name: &str, matrix: &DMatrix<f64>) {
    let _ = writeln!(text, "{name} = [");
    for row in matrix.row_iter() {
        let row: Vec<_> = row.iter().map(ToString::to_string).collect();
        let _ = writeln!(text, "    [{}],", row.join(", "));
    }
    *text += "]\n";
}

fn list(text: &mut String, key: &str, signals: &[Signal]) {
    let _ = writeln!(text, "{key} = [");
    for Signal { name, unit, description, operating, .. } in signals {
        let mut parts = vec![format!("name = {}", quoted(name))];
        let description = Some(description).filter(|text| !text.is_empty());
        for (key, value) in [("unit", unit.as_ref()), ("description", description)] {
            parts.extend(value.map(|value| format!("{key} = {}", quoted(value))));
        }
        parts.extend(operating.map(|value| format!("operating = {value}")));
        let _ = writeln!(text, "    {{ {} }},", parts.join(", "));
    }
    *text += "]\n";
}

/// Returns the name as a key of TOML.
fn key(name: &str) -> String {
    let is_bare = |sign: char| sign.is_ascii_alphanumeric() || "_-".contains(sign);
    if !name.is_empty() && name.chars().all(is_bare) { name.to_owned() } else { quoted(name) }
}

/// Returns the text as a string of TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
