//! Compares predictions with the part of the logs that was not used to estimate.

use std::ops::Range;

use control::eigen::eigenvalues;
use control::identification::IdentifiedModel;
use nalgebra::DMatrix;

use crate::init::log::read::Log;

/// Horizon in samples of the predictions whose fit is stated; even an unstable plant can be predicted this far.
pub(super) const SHORT: usize = 20;

/// Logarithm of the growth of an error over a simulation above which the simulation is not used.
const GROWTH: f64 = 1.0;

/// Variance, as a part of the mean square of the samples, below which the variance counts as rounding.
const ROUNDING: f64 = 1e-15;

/// The fit of one measurement, 100 % for predictions without error, 0 for predictions as good as the mean.
pub(super) struct Fit {
    /// The fit of a simulation, which uses the inputs only; None if the errors of the simulation grow.
    pub(super) simulated: Option<f64>,
    /// The fit of predictions [`SHORT`] samples ahead.
    pub(super) predicted: f64,
}

/// Returns the samples of a log that are used to estimate the plant: the first three quarters.
pub(super) fn estimation(log: &Log) -> Range<usize> {
    0..log.record.len() / 4 * 3
}

/// Returns the samples of a log that are used to judge the estimate: the last quarter.
pub(super) fn validation(log: &Log) -> Range<usize> {
    estimation(log).end..log.record.len()
}

/// Returns for each measurement the mean squared error of predictions `horizon` samples ahead, relative to the variance
/// of the samples, at least [`ROUNDING`] of their mean square; on the part of the logs that was not used to estimate.
pub(super) fn relative_errors(
    logs: &[Log],
    model: &IdentifiedModel,
    horizon: usize,
) -> Result<Vec<f64>, control::Error> {
    let outputs = logs[0].outputs.len();
    let (mut errors, mut variances) = (vec![0.0; outputs], vec![0.0; outputs]);
    for log in logs {
        let range = validation(log);
        let samples = log.record.outputs.columns(range.start, range.len());
        let differences = model.predict(&log.record, range, horizon)? - samples;
        let deviations = centred(&samples.into());
        for output in 0..outputs {
            errors[output] += differences.row(output).norm_squared();
            let rounding = ROUNDING * samples.row(output).norm_squared();
            variances[output] += deviations.row(output).norm_squared().max(rounding);
        }
    }
    let ratio = |(error, variance): (&f64, &f64)| error / variance.max(f64::MIN_POSITIVE);
    Ok(errors.iter().zip(&variances).map(ratio).collect())
}

fn centred(samples: &DMatrix<f64>) -> DMatrix<f64> {
    let means = samples.column_mean();
    DMatrix::from_fn(samples.nrows(), samples.ncols(), |i, j| samples[(i, j)] - means[i])
}

/// Returns the fit of each measurement.
pub(super) fn fits(logs: &[Log], model: &IdentifiedModel) -> Result<Vec<Fit>, control::Error> {
    let percent = |error: &f64| 100.0 * (1.0 - error.sqrt());
    let predicted = relative_errors(logs, model, SHORT)?;
    let simulated = if can_be_simulated(logs, model)? {
        let errors = relative_errors(logs, model, usize::MAX)?;
        errors.iter().map(|error| Some(percent(error))).collect()
    } else {
        vec![None; predicted.len()]
    };
    let one =
        |(error, simulated): (&f64, Option<f64>)| Fit { simulated, predicted: percent(error) };
    Ok(predicted.iter().zip(simulated).map(one).collect())
}

/// Whether an error of a state grows by less than a factor e over the longest simulation.
fn can_be_simulated(logs: &[Log], model: &IdentifiedModel) -> Result<bool, control::Error> {
    let values = eigenvalues(&model.a)?;
    let radius = values.iter().map(|value| value.norm()).fold(0.0, f64::max);
    let longest = logs.iter().map(|log| validation(log).len()).max().unwrap_or_default();
    #[expect(clippy::cast_precision_loss, reason = "a number of rows")]
    let growth = radius.ln() * longest as f64;
    Ok(growth < GROWTH)
}

#[cfg(test)]
mod tests {
    use control::identification::{Record, Subspace, Windows};

    use super::*;
    use plant_file::signals::Signal;

    /// y[k+1] = 3 + u[k] / 2, with a command that stays the same in the last quarter.
    #[test]
    fn an_exact_model_of_a_measurement_at_rest_has_the_full_fit() -> Result<(), control::Error> {
        let command = |k: usize| if k < 280 { f64::from(u8::from(k * k % 7 < 3)) } else { 0.7 };
        let inputs = DMatrix::from_fn(1, 400, |_, k| command(k));
        let outputs = DMatrix::from_fn(1, 400, |_, k| 3.0 + 0.5 * command(k.saturating_sub(1)));
        let record = Record { inputs, outputs };
        let windows = Windows::new(&record, 3, 0..300)?;
        let model = Subspace::new(&windows, false)?.model(1)?;
        let log = Log { period: 1.0, inputs: Vec::new(), outputs: vec![Signal::default()], record };
        let fit = fits(&[log], &model)?.swap_remove(0).predicted;
        assert!((fit - 100.0).abs() < 0.01, "{fit}");
        Ok(())
    }
}
