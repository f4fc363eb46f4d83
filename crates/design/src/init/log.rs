//! A plant that is identified from logs of its commands and measurements.

mod estimate;
mod fit;
mod judge;
mod read;

use std::path::PathBuf;

use control::StateSpace;

use crate::Error;
use crate::design_file::per_second;
use crate::init::draft::{Draft, Identification, Model, shown};
use estimate::Estimate;
use fit::Fit;
use plant_file::signals::Signal;
use read::Log;

pub(super) use read::is_log;

/// How a plant is identified from a log.
#[derive(Debug, Clone, Default)]
pub struct LogOptions {
    /// The columns that are commands; empty for the columns called `u`, `u1` and so on.
    pub inputs: Vec<String>,
    /// The columns that are measurements; empty for all columns besides stated inputs or, without stated inputs, for
    /// the columns called `y`, `y1` and so on.
    pub outputs: Vec<String>,
    /// The number of states; None for the smallest one that predicts the last quarter of the logs nearly as well as
    /// the best one.
    pub order: Option<usize>,
}

impl LogOptions {
    /// Returns the name of the first option that is stated; None if there is none.
    pub(super) fn stated(&self) -> Option<&'static str> {
        let options = [
            ("--inputs", !self.inputs.is_empty()),
            ("--outputs", !self.outputs.is_empty()),
            ("--order", self.order.is_some()),
        ];
        options.into_iter().find(|(_, is_stated)| *is_stated).map(|(name, _)| name)
    }
}

/// Identifies the plant. Logs after the first one must have the same columns, units and sample time.
pub(super) fn draft(paths: &[PathBuf], options: &LogOptions) -> Result<Draft, Error> {
    let logs = read::logs(paths, options)?;
    let names: Vec<_> = paths.iter().map(|path| shown(path)).collect();
    let invalid = |reason: String| Error::Invalid(format!("{}: {reason}", names.join(", ")));
    judge::refuse(&logs).map_err(invalid)?;
    let estimate = Estimate::new(&logs, options.order).map_err(invalid)?;
    let fits = fit::fits(&logs, &estimate.model).map_err(|error| invalid(error.to_string()))?;
    let tolerance = estimate.tolerance(&logs);
    let notes = notes(&logs, &estimate, &fits);
    let warnings = judge::warnings(&logs, options.order, &estimate, &fits, tolerance.as_ref());
    let Log { inputs, outputs, .. } = &logs[0];
    let means = estimate.windows.means();
    let signals = |names: &[Signal], means: &[f64]| -> Vec<Signal> {
        let one = |(signal, mean): (&Signal, &f64)| Signal {
            operating: Some(rounded(*mean)),
            ..signal.clone()
        };
        names.iter().zip(means).map(one).collect()
    };
    let StateSpace { a, b, c, d, .. } = estimate.continuous.clone();
    let states = states(estimate.rates.as_deref(), outputs, a.nrows());
    Ok(Draft {
        origin: format!("identified from {}", names.join(", ")),
        has_feedthrough: d.amax() > 0.0,
        model: Model::Matrices {
            a: a.map(rounded),
            b: b.map(rounded),
            c: c.map(rounded),
            d: d.map(rounded),
            states,
            sampled: None,
        },
        actuators: signals(inputs, &means[..inputs.len()]),
        measurements: signals(outputs, &means[inputs.len()..]),
        left_out: Vec::new(),
        identification: Identification {
            sample_time: Some(logs[0].period),
            tolerance: tolerance.ok(),
            notes,
            warnings,
        },
    })
}

/// Returns the states: the measurements, then the rates of the measurements at the positions `rates`, without a unit if
/// FMI has none (degC/s). Without `rates` their names are `x1`, `x2` and so on.
fn states(rates: Option<&[usize]>, outputs: &[Signal], order: usize) -> Vec<Signal> {
    let Some(rates) = rates else {
        return (1..=order).map(|at| Signal::named(format!("x{at}"))).collect();
    };
    let rate = |output: &Signal| Signal {
        unit: output.unit.as_deref().and_then(per_second),
        ..Signal::named(format!("{}_rate", output.name))
    };
    outputs.iter().cloned().chain(rates.iter().map(|&at| rate(&outputs[at]))).collect()
}

/// Returns the lines that the plant file has about the identification.
fn notes(logs: &[Log], estimate: &Estimate, fits: &[Fit]) -> Vec<String> {
    let samples: usize = logs.iter().map(|log| log.record.len()).sum();
    let order = estimate.continuous.a.nrows();
    let mut notes = vec![format!(
        "Subspace identification of {order} states from the first three quarters of {samples} samples."
    )];
    notes.push("The fit is that of the last quarter, which was not used to estimate:".to_owned());
    for (output, fit) in logs[0].outputs.iter().zip(fits) {
        let simulated = fit.simulated.map(|fit| format!("simulated {fit:.1} %, "));
        let horizon = fit::SHORT;
        notes.push(format!(
            "  {}: {}predicted {horizon} samples ahead {:.1} %",
            output.name,
            simulated.unwrap_or_default(),
            fit.predicted
        ));
    }
    if fits.iter().any(|fit| fit.simulated.is_none()) {
        notes.push("The plant is not stable, and errors of its simulation grow: the fit is that of predictions.".to_owned());
    }
    notes
}

/// Rounds to eight significant digits, which are more than an identification determines.
fn rounded(value: f64) -> f64 {
    format!("{value:.7e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plant file with the unit degC/s is refused: degC has an offset.
    #[test]
    fn the_rate_of_a_temperature_in_degrees_celsius_has_no_unit() {
        let named = |name: &str, unit: &str| Signal {
            unit: Some(unit.to_owned()),
            ..Signal::named(name.to_owned())
        };
        let outputs = [named("oven", "degC"), named("valve", "m")];
        let states = states(Some(&[0, 1]), &outputs, 4);
        let units: Vec<_> = states.iter().map(|state| state.unit.as_deref()).collect();
        assert_eq!(units, [Some("degC"), Some("m"), None, Some("m/s")]);
    }
}
