//! Judges logs and estimates: refuses logs, and warns about estimates.

use control::eigen::eigenvalues;
use control::identification::Windows;
use fmu_description::number::rounded;
use nalgebra::DMatrix;

use crate::init::log::estimate::Estimate;
use crate::init::log::fit::{Fit, estimation, validation};
use crate::init::log::read::Log;
use plant_file::signals::Signal;

/// Smallest number of samples of a log from which a plant is identified.
const SAMPLES: usize = 100;
/// Relative change of a signal below which the signal counts as constant.
const CONSTANT: f64 = 1e-12;
/// Singular values of the inputs below this part of the largest do not excite the plant.
const EXCITATION: f64 = 1e-4;
/// Fit in per cent below which the identified model gets a warning.
const POOR_FIT: f64 = 60.0;
/// Tolerance of the entries above which the identified model gets a warning.
const LARGE_TOLERANCE: f64 = 0.3;
/// |eigenvalue| times sample time above which a mode is too fast for the samples.
const FAST: f64 = 2.5;
/// |eigenvalue| of the fastest mode times sample time, below which the samples are too dense.
const SLOW: f64 = 0.02;

/// Refuses logs from which no plant can be identified: with too few rows, or with a signal that does not change.
pub(super) fn refuse(logs: &[Log]) -> Result<(), String> {
    for log in logs {
        let count = log.record.len();
        if count < SAMPLES {
            return Err(format!("expected at least {SAMPLES} rows, found {count}"));
        }
    }
    let Log { inputs, outputs, .. } = &logs[0];
    let commands = constant_signal(inputs, logs, |log| &log.record.inputs);
    if let Some((name, value)) = commands {
        return Err(format!(
            "command {name} is {value} throughout the first three quarters of the log, which estimate the plant; \
             expected a log in which it changes there: its effect cannot be identified"
        ));
    }
    let measurements = constant_signal(outputs, logs, |log| &log.record.outputs);
    if let Some((name, value)) = measurements {
        return Err(format!(
            "measurement {name} is {value} throughout the first three quarters of the log, which estimate the plant; \
             expected a log in which it moves there, or --outputs without it"
        ));
    }
    Ok(())
}

/// Returns the first signal that does not change in the samples that are used to estimate, with its value; None if all
/// do.
fn constant_signal<'a>(
    signals: &'a [Signal],
    logs: &[Log],
    rows: impl Fn(&Log) -> &DMatrix<f64>,
) -> Option<(&'a str, f64)> {
    signals.iter().enumerate().find_map(|(at, signal)| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for log in logs {
            for value in rows(log).row(at).iter().take(estimation(log).end) {
                (low, high) = (low.min(*value), high.max(*value));
            }
        }
        (high - low <= CONSTANT * high.abs()).then_some((signal.name.as_str(), low))
    })
}

/// Returns warnings of a plant that may be useless; `order`: the order that the user states.
pub(super) fn warnings(
    logs: &[Log],
    order: Option<usize>,
    estimate: &Estimate,
    fits: &[Fit],
    tolerance: Result<&f64, &String>,
) -> Vec<String> {
    let mut warnings = Vec::new();
    for (output, fit) in logs[0].outputs.iter().zip(fits) {
        let (percent, how) = match fit.simulated {
            Some(simulated) => (simulated, "a simulation"),
            None => (fit.predicted, "a prediction"),
        };
        if percent < POOR_FIT {
            warnings.push(format!(
                "{how} of {} has a fit of {percent:.0} % only: noise, a disturbance or a nonlinearity is large, or a command is missing",
                output.name
            ));
        }
    }
    match tolerance {
        Ok(tolerance) if *tolerance > LARGE_TOLERANCE => warnings.push(format!(
            "parts of the log give plants that differ much, a tolerance of {:.0} %: a longer log, or one with larger commands, \
             is needed",
            100.0 * tolerance
        )),
        Ok(_) => {}
        Err(reason) => warnings.push(format!("the uncertainty of the plant is unknown: {reason}")),
    }
    warnings.extend(rest(logs, order));
    warnings.extend(excitation(logs, estimate));
    if estimate.continuous.d.amax() > 0.0 {
        warnings.push(
            "a measurement follows a command in the same row: if it is no acceleration or current, the commands were logged \
             after they acted, and belong one row later"
                .to_owned(),
        );
    }
    let rows = logs.iter().map(|log| log.record.len()).max().unwrap_or_default();
    warnings.extend(sampling(&estimate.continuous.a, logs[0].period, rows));
    warnings
}

/// Returns a warning if no command changes in the last quarter of the logs, which judges the estimate and, unless it is
/// stated, selects the order.
fn rest(logs: &[Log], order: Option<usize>) -> Option<String> {
    let is_constant = |log: &Log| {
        let commands = log.record.inputs.columns_range(validation(log));
        commands.row_iter().all(|row| row.max() - row.min() <= CONSTANT * row.amax())
    };
    let (purpose, advice) = match order {
        None => ("chooses the order and judges", ", or --order,"),
        Some(_) => ("judges", ""),
    };
    logs.iter().all(is_constant).then(|| {
        format!(
            "no command changes in the last quarter of the log, which {purpose} the estimate: a log with changes up to \
             its end{advice} is needed"
        )
    })
}

/// Returns a warning if the commands excite fewer directions than the order needs.
fn excitation(logs: &[Log], estimate: &Estimate) -> Option<String> {
    let order = estimate.continuous.a.nrows();
    let parts = logs.iter().map(|log| Windows::new(&log.record, 2 * order, estimation(log)));
    let parts = parts.collect::<Result<Vec<_>, _>>().ok()?;
    let windows = Windows::joined(&parts.iter().collect::<Vec<_>>()).ok()?;
    let (rank, full) =
        (windows.excitation(EXCITATION).ok()?, logs[0].inputs.len() * (2 * order + 1));
    (rank < full).then(|| {
        format!(
            "the commands excite {rank} of {full} directions that {order} states need; a log with steps of irregular lengths in \
             each command, at different times, excites all"
        )
    })
}

/// Returns a warning if the fastest mode of A is too fast or too slow for the samples. A mode that is slower than a log
/// of `rows` samples is an integrator, for which no samples are too dense.
fn sampling(a: &DMatrix<f64>, period: f64, rows: usize) -> Option<String> {
    let values = eigenvalues(a).ok()?;
    let fastest = values.iter().map(|value| value.norm()).fold(0.0, f64::max);
    let rate = rounded(fastest, 3);
    if fastest * period > FAST {
        return Some(format!(
            "a mode of {rate} rad/s is as fast as the samples, every {period} s: log faster, or state a smaller --order"
        ));
    }
    #[expect(clippy::cast_precision_loss, reason = "a number of rows")]
    let is_integrator = fastest * period * (rows as f64) < 1.0;
    (fastest * period < SLOW && !is_integrator).then(|| {
        format!(
            "the fastest mode, {rate} rad/s, is slow for samples every {period} s: the mean of some rows as one row \
             would identify it more precisely"
        )
    })
}

#[cfg(test)]
mod tests {
    use control::identification::Record;

    use super::*;

    #[test]
    fn a_log_whose_commands_rest_in_the_last_quarter_is_doubtful() {
        let log = |last_change: usize| {
            let command = |k: usize| if k < last_change { 2.0 } else { 2.5 };
            let inputs = DMatrix::from_fn(1, 200, |_, k| command(k));
            let record = Record { outputs: inputs.clone(), inputs };
            Log { period: 1.0, inputs: Vec::new(), outputs: Vec::new(), record }
        };
        // The last quarter starts with sample 150.
        assert!(rest(&[log(150)], None).unwrap().ends_with(", or --order, is needed"));
        assert_eq!(rest(&[log(151)], None), None);
        assert_eq!(rest(&[log(150), log(199)], None), None);
        // The advice that has been followed is not repeated.
        let stated = rest(&[log(150)], Some(2)).unwrap();
        assert!(
            stated
                .ends_with("which judges the estimate: a log with changes up to its end is needed"),
            "{stated}"
        );
    }

    /// A room with a time constant of two hours, 1 / 7200 s.
    #[test]
    fn a_slow_mode_has_its_rate_in_the_warning() {
        let room = DMatrix::from_element(1, 1, -1.0 / 7200.0);
        let warning = sampling(&room, 60.0, 1000).unwrap();
        assert!(warning.contains("mode, 0.000139 rad/s, is slow"), "{warning}");
        assert_eq!(sampling(&room, 600.0, 1000), None);
        // Within 100 minutes the room is an integrator.
        assert_eq!(sampling(&room, 60.0, 100), None);
    }
}
