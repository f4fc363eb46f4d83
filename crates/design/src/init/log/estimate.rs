//! The choice of the order, the estimate, and its tolerance.

use control::hold::continuous;
use control::identification::{
    IdentifiedModel, MeasuredStates, ResponseUnits, Subspace, Windows, equivalent_tolerance,
};
use control::{Domain, StateSpace};
use nalgebra::DMatrix;

use crate::init::log::fit::{SHORT, estimation, relative_errors};
use crate::init::log::read::Log;

/// Numbers of earlier samples to try, from which the next sample is predicted.
const PASTS: [usize; 5] = [5, 10, 20, 40, 80];
/// The largest number of columns of the compressed samples, which bounds the computing time; the first of [`PASTS`] may
/// have more.
const COLUMNS: usize = 250;
/// Largest order to try unless the order is stated.
const ORDERS: usize = 10;
/// Largest excess of the chosen order, the smallest possible, over the least sum of the logarithms of the errors.
const MARGIN: f64 = 0.2;
/// Least decrease of the sum of the logarithms of the errors for which a direct term D is assumed.
const FEEDTHROUGH: f64 = 1.0;
/// Prediction error, as a part of the variance, below which the error counts as rounding.
const ROUNDING: f64 = 1e-12;
/// Number of blocks of the log; each is left out once to estimate the tolerance.
const BLOCKS: usize = 10;
/// Smallest tolerance of the entries that the plant file states.
const SMALLEST: f64 = 1e-3;

/// The identified plant.
pub(super) struct Estimate {
    pub(super) windows: Windows,
    pub(super) model: IdentifiedModel,
    /// The continuous plant whose samples the model predicts.
    pub(super) continuous: StateSpace,
    /// The measurements whose rates follow the measurements as states; None if the states have no meaning.
    pub(super) rates: Option<Vec<usize>>,
    past: usize,
    feedthrough: bool,
    period: f64,
}

/// Structure of the model that an estimate assumes.
#[derive(Clone, Copy)]
struct Assumption {
    past: usize,
    order: usize,
    feedthrough: bool,
    /// Sum of the logarithms of the errors on the samples that were not used for the estimate.
    score: f64,
}

impl Estimate {
    /// Tries lengths of the past and, unless `order` is stated, orders, and estimates the plant with the best ones.
    pub(super) fn new(logs: &[Log], order: Option<usize>) -> Result<Self, String> {
        let assumption = best(logs, order)?;
        let Assumption { past, order, feedthrough, .. } = assumption;
        let sentence = |error: control::Error| error.to_string();
        let windows = windows(logs, past).map_err(sentence)?;
        let subspace = Subspace::new(&windows, feedthrough).map_err(sentence)?;
        let model = subspace.model(order).map_err(sentence)?;
        let period = logs[0].period;
        let plant = continuous_plant(&model, period).map_err(sentence)?;
        let states = MeasuredStates::new(&plant.a, &plant.c).map_err(sentence)?;
        let (continuous, rates) = match states.filter(|_| !feedthrough) {
            Some(states) => (in_states(&plant, &states), Some(states.rates)),
            None => (plant, None),
        };
        Ok(Self { windows, model, continuous, rates, past, feedthrough, period })
    }

    /// Returns the tolerance of the entries from estimates without one block each; an error says why there is none.
    pub(super) fn tolerance(&self, logs: &[Log]) -> Result<f64, String> {
        let sentence = |error: control::Error| error.to_string();
        let blocks = blocks(logs, self.past).map_err(sentence)?;
        let without = |left_out: usize| {
            let others = blocks.iter().enumerate().filter(|(at, _)| *at != left_out);
            let windows = Windows::joined(&others.map(|(_, block)| block).collect::<Vec<_>>())?;
            let subspace = Subspace::new(&windows, self.feedthrough)?;
            Ok(sampled_plant(&subspace.model(self.continuous.a.nrows())?, self.period))
        };
        let parts = (0..blocks.len()).map(without).collect::<Result<Vec<_>, _>>();
        let parts = parts.map_err(|error: control::Error| {
            format!("without one of {} parts, {error}", blocks.len())
        })?;
        let estimate = sampled_plant(&self.model, self.period);
        let deviations = self.windows.deviations();
        let (inputs, outputs) = deviations.split_at(self.continuous.b.ncols());
        let units = ResponseUnits {
            frequencies: frequencies(logs, self.period),
            inputs: inputs.to_vec(),
            outputs: outputs.to_vec(),
        };
        let tolerance =
            equivalent_tolerance(&self.continuous, &estimate, &parts, &units).map_err(sentence)?;
        if !tolerance.is_finite() {
            return Err("no entry of the matrices varies".to_owned());
        }
        Ok(rounded_up(tolerance.max(SMALLEST)))
    }
}

/// Returns the plant with measurements and rates as states.
fn in_states(plant: &StateSpace, states: &MeasuredStates) -> StateSpace {
    let mut a = &states.change * &plant.a * &states.inverse;
    let (p, n) = plant.c.shape();
    let mut c = DMatrix::zeros(p, n);
    c.fill_with_identity();
    // These rows are exact: the derivative of a measurement is the state that is its rate.
    for (at, rate) in states.rates.iter().enumerate() {
        a.row_mut(*rate).fill(0.0);
        a[(*rate, p + at)] = 1.0;
    }
    StateSpace { a, b: &states.change * &plant.b, c, d: plant.d.clone(), domain: plant.domain }
}

/// Returns the value with two digits, rounded up.
fn rounded_up(value: f64) -> f64 {
    let unit = 10.0_f64.powf(value.log10().floor() - 1.0);
    let digits = (value / unit - 1e-9).ceil();
    format!("{:.1e}", digits * unit).parse().unwrap_or(value)
}

/// Returns the continuous plant whose samples the model predicts; an error if there is none.
fn continuous_plant(model: &IdentifiedModel, period: f64) -> Result<StateSpace, control::Error> {
    let (a, b) = continuous(&model.a, &model.b, period)?;
    Ok(StateSpace { a, b, c: model.c.clone(), d: model.d.clone(), domain: Domain::Continuous })
}

fn sampled_plant(model: &IdentifiedModel, period: f64) -> StateSpace {
    let [a, b, c, d] = [&model.a, &model.b, &model.c, &model.d].map(Clone::clone);
    StateSpace { a, b, c, d, domain: Domain::Sampled { period } }
}

/// Returns the windows of the samples that are used to estimate.
fn windows(logs: &[Log], past: usize) -> Result<Windows, control::Error> {
    let one = |log: &Log| Windows::new(&log.record, past, estimation(log));
    let parts = logs.iter().map(one).collect::<Result<Vec<_>, _>>()?;
    Windows::joined(&parts.iter().collect::<Vec<_>>())
}

/// Divides the windows of [`windows`] into about [`BLOCKS`] blocks, at least one for each log that has a window.
fn blocks(logs: &[Log], past: usize) -> Result<Vec<Windows>, control::Error> {
    let all: usize = logs.iter().map(|log| estimation(log).len()).sum();
    let mut blocks = Vec::new();
    for log in logs.iter().filter(|log| estimation(log).len() > past) {
        let samples = estimation(log).len();
        let count = ((samples * BLOCKS + all / 2) / all).max(1);
        let edge = |at: usize| past + (samples - past) * at / count;
        for at in 0..count {
            blocks.push(Windows::new(&log.record, past, edge(at)..edge(at + 1))?);
        }
    }
    Ok(blocks)
}

/// Returns 41 frequencies in rad/s, from one period in the longest log to nearly half of the sample rate.
fn frequencies(logs: &[Log], period: f64) -> Vec<f64> {
    let longest = logs.iter().map(|log| estimation(log).len()).max().unwrap_or(2);
    #[expect(clippy::cast_precision_loss, reason = "a number of rows")]
    let lowest = std::f64::consts::TAU / (longest as f64 * period);
    let highest = 0.9 * std::f64::consts::PI / period;
    (0..=40).map(|k| lowest * (highest / lowest).powf(f64::from(k) / 40.0)).collect()
}

/// Returns the smallest order that predicts about best, without D unless D is needed; an error if no assumption gives a
/// continuous plant.
fn best(logs: &[Log], order: Option<usize>) -> Result<Assumption, String> {
    let [without, with] = [false, true].map(|feedthrough| candidates(logs, order, feedthrough));
    let choose = |candidates: &[Assumption]| {
        let least = candidates.iter().map(|one| one.score).fold(f64::INFINITY, f64::min);
        let close = candidates.iter().filter(|one| one.score <= least + MARGIN);
        close
            .min_by(|one, other| {
                one.order.cmp(&other.order).then(one.score.total_cmp(&other.score))
            })
            .copied()
    };
    let refusal = without.as_ref().err().cloned();
    let [without, with] = [without, with].map(|all| all.ok().and_then(|all| choose(&all)));
    match (without, with) {
        (Some(without), Some(with)) if with.score < without.score - FEEDTHROUGH => Ok(with),
        (Some(without), _) => Ok(without),
        (None, with) => with.ok_or_else(|| refusal.unwrap_or_default()),
    }
}

/// Returns all assumptions that give a continuous plant; the reason if none does.
fn candidates(
    logs: &[Log],
    order: Option<usize>,
    feedthrough: bool,
) -> Result<Vec<Assumption>, String> {
    let signals = logs[0].inputs.len() + logs[0].outputs.len();
    let mut all = Vec::new();
    let mut refusal = "expected more samples".to_owned();
    for (at, past) in PASTS.into_iter().enumerate() {
        if at > 0 && 1 + (past + 1) * signals > COLUMNS {
            continue;
        }
        let subspace = windows(logs, past).and_then(|windows| Subspace::new(&windows, feedthrough));
        let subspace = match subspace {
            Ok(subspace) => subspace,
            Err(error) => {
                refusal = if all.is_empty() { error.to_string() } else { refusal };
                continue;
            }
        };
        let most = subspace.singular_values().len();
        let orders = order.map_or(1..=most.min(ORDERS), |order| order..=order);
        for order in orders {
            let assumption = subspace.model(order).and_then(|model| {
                continuous_plant(&model, logs[0].period)?;
                let score = score(logs, &model)?;
                Ok(Assumption { past, order, feedthrough, score })
            });
            match assumption {
                Ok(assumption) => all.push(assumption),
                Err(error) => refusal = format!("{order} states: {error}"),
            }
        }
    }
    if all.is_empty() { Err(refusal) } else { Ok(all) }
}

/// Returns the sum of the logarithms of the errors over a short, a middle and the longest horizon.
///
/// Predicting the mean has the error 1; larger errors count as 1, because an unstable plant cannot be predicted over a
/// long horizon.
fn score(logs: &[Log], model: &IdentifiedModel) -> Result<f64, control::Error> {
    let mut score = 0.0;
    for horizon in [SHORT / 4, SHORT, usize::MAX] {
        let errors = relative_errors(logs, model, horizon)?;
        let bounded = |error: &f64| if *error < 1.0 { *error } else { 1.0 };
        let outputs = errors.iter().map(bounded).sum::<f64>();
        #[expect(clippy::cast_precision_loss, reason = "a number of measurements")]
        let mean = outputs / errors.len() as f64;
        score += mean.max(ROUNDING).ln();
    }
    Ok(score)
}

#[cfg(test)]
mod tests {
    use control::identification::Record;

    use super::*;

    /// A log of ones with this number of samples.
    fn log(samples: usize) -> Log {
        let ones = DMatrix::from_element(1, samples, 1.0);
        let record = Record { inputs: ones.clone(), outputs: ones };
        Log { period: 1.0, inputs: Vec::new(), outputs: Vec::new(), record }
    }

    /// Three quarters of 200 samples are 150: all but the first 40 end a window with 40 earlier samples. Three quarters
    /// of 52 samples are too few for a window.
    #[test]
    fn blocks_have_the_windows_of_the_logs_that_are_long_enough() -> Result<(), control::Error> {
        let blocks = blocks(&[log(52), log(200)], 40)?;
        assert_eq!(blocks.iter().map(Windows::count).sum::<usize>(), 150 - 40);
        Ok(())
    }
}
