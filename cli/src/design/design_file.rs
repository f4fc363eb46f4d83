//! `design.toml`: what the controller FMU reads.

use std::fmt::Write as _;

use nalgebra::DMatrix;
use serde::Serialize;

/// Everything in the file but the matrices.
#[derive(Serialize)]
pub(crate) struct DesignFile<'a> {
    pub(crate) description: &'a str,
    pub(crate) t_on: f64,
    pub(crate) monitor: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) sample_time: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) estimator: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) filter: Option<Vec<f64>>,
    pub(crate) experiment: Experiment,
    pub(crate) states: Vec<Entry>,
    pub(crate) actuators: Vec<Entry>,
    pub(crate) measurements: Vec<Entry>,
    pub(crate) faults: Vec<Entry>,
}

/// The experiment that importers run by default, times in s.
#[derive(Serialize)]
pub(crate) struct Experiment {
    pub(crate) stop_time: f64,
    pub(crate) step_size: f64,
}

/// A signal.
#[derive(Serialize, Default)]
pub(crate) struct Entry {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) unit: Option<String>,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) description: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) limits: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) operating: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) loss_of: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) least_command: Option<f64>,
}

impl DesignFile<'_> {
    /// The text of the file: scalars, `matrices` with a row on each line, tables.
    pub(crate) fn render(&self, matrices: &[(&str, &DMatrix<f64>)]) -> anyhow::Result<String> {
        let all = toml::Table::try_from(self)?;
        let is_table = |value: &toml::Value| {
            value.as_array().map_or(value.is_table(), |list| list.iter().any(toml::Value::is_table))
        };
        let (tables, scalars): (toml::Table, toml::Table) =
            all.into_iter().partition(|(_, value)| is_table(value));
        let mut text = "# Written by aso-ftc design.\n\n".to_owned();
        text += &toml::to_string(&scalars)?;
        for (name, matrix) in matrices {
            write!(text, "\n{name} = [\n")?;
            for row in matrix.row_iter() {
                let entries: Vec<_> =
                    row.iter().map(|entry| format!("{:?}", entry + 0.0)).collect();
                writeln!(text, "    [{}],", entries.join(", "))?;
            }
            text += "]\n";
        }
        text += "\n";
        text += &toml::to_string(&tables)?;
        Ok(text)
    }
}
