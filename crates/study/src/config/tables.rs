//! The small tables of `system.toml`.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{Every, Memory};
use files::Place;

/// Location and text of an error.
type EntryError = (Place, String);

/// An entry of `[[connections]]`: `to = factor from + offset`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConnectionEntry {
    /// The output, `slave.variable`.
    pub from: Spanned<String>,
    /// The input, `slave.variable`.
    pub to: Spanned<String>,
    /// Factor of the transformation; default: 1. If factor or offset is stated, units are not converted.
    pub factor: Option<f64>,
    /// Offset of the transformation, in the unit of the input; default: 0.
    pub offset: Option<f64>,
}

impl ConnectionEntry {
    /// Creates a connection without a location and without a transformation, as on the command line.
    #[must_use]
    pub fn new(from: String, to: String) -> Spanned<Self> {
        let text = |text| Spanned::new(0..0, text);
        Spanned::new(0..0, Self { from: text(from), to: text(to), factor: None, offset: None })
    }

    pub(super) fn check(&self, place: &Place) -> Result<(), EntryError> {
        let numbers = [("factor", self.factor), ("offset", self.offset)];
        match numbers.iter().find(|(_, number)| number.is_some_and(|value| !value.is_finite())) {
            Some((name, _)) => Err((place.clone(), format!("{name}: expected a finite number"))),
            None => Ok(()),
        }
    }
}

/// `[experiment]`: the times and tolerance that the FMUs receive in `fmi2SetupExperiment`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Experiment {
    /// Start time in s.
    pub start_time: Option<Spanned<f64>>,
    /// Stop time in s.
    pub stop_time: Option<Spanned<f64>>,
    /// Relative tolerance for solvers inside the FMUs.
    pub tolerance: Option<Spanned<f64>>,
}

impl Experiment {
    pub(super) fn check(&self) -> Result<(), EntryError> {
        for (name, time) in [("start-time", &self.start_time), ("stop-time", &self.stop_time)] {
            check_number(name, time.as_ref(), "a finite number", f64::is_finite)?;
        }
        check_positive("tolerance", self.tolerance.as_ref())
    }
}

/// `[results]`: results file, recorded variables, plot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Results {
    /// The results file, `.csv` or `.parquet`.
    pub file: Option<PathBuf>,
    /// Variables to record, by name or pattern.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub record: Vec<String>,
    /// Variables not to record, by name or pattern.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<String>,
    /// Interval between rows.
    pub every: Option<Every>,
    /// Variables to plot, by name or pattern.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub plot: Vec<String>,
    /// File of the plot, `.svg` or `.png`.
    pub plot_file: Option<PathBuf>,
    /// File of the frames of the CAN buses, `.log` (candump), `.asc` or `.pcapng`.
    pub bus_trace: Option<PathBuf>,
}

/// `[isolation]`: FMUs in separate processes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Isolation {
    /// Whether each FMU runs in a separate process.
    pub isolate: Option<bool>,
    /// Time limit of a call, in s of wall-clock time.
    pub time_limit: Option<Spanned<f64>>,
    /// Memory limit of each process.
    pub memory_limit: Option<Memory>,
}

impl Isolation {
    pub(super) fn check(&self) -> Result<(), EntryError> {
        check_positive("time-limit", self.time_limit.as_ref())
    }
}

/// `[checkpoint]`: file and interval of checkpoints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct CheckpointSettings {
    /// The checkpoint file.
    pub file: Option<PathBuf>,
    /// Simulated time in s between two checkpoints; default: only a checkpoint at the end, which is written anyway.
    pub every: Option<Spanned<f64>>,
}

impl CheckpointSettings {
    pub(super) fn check(&self) -> Result<(), EntryError> {
        check_positive("every", self.every.as_ref())?;
        match &self.every {
            Some(every) if self.file.is_none() => {
                Err((every.span(), "every: expected file beside it".to_owned()))
            }
            _ => Ok(()),
        }
    }
}

fn check_positive(name: &str, value: Option<&Spanned<f64>>) -> Result<(), EntryError> {
    let is_positive = |value: f64| value > 0.0 && value.is_finite();
    check_number(name, value, "a finite number above 0", is_positive)
}

/// Checks a value, if it is stated, by the condition `is_valid`, which `expected` describes.
fn check_number(
    name: &str,
    value: Option<&Spanned<f64>>,
    expected: &str,
    is_valid: fn(f64) -> bool,
) -> Result<(), EntryError> {
    match value {
        Some(value) if !is_valid(*value.get_ref()) => {
            let message = format!("{name}: expected {expected}, found {}", value.get_ref());
            Err((value.span(), message))
        }
        _ => Ok(()),
    }
}
