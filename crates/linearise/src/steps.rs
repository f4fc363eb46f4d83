//! The Jacobian from communication steps: short runs with pulses of the inputs from a saved FMU
//! state, a step map fitted to the responses, and its logarithm.

use control::logarithm::logarithm_of_one_plus;
use nalgebra::DMatrix;

use super::bench::{Bench, Pulse, Record, index};
use super::differences::{Side, extrapolate};
use super::fit::{Directions, least_squares};
use super::parts::{Part, Parts};
use super::result::{Differences, MethodResult, RawResult, relative_error};
use super::{Linearise, LineariseError};
use fmu_import::Fmu;

/// Minimum and maximum number of steps of a record; more than 255 states need a longer one.
const MIN_STEPS: usize = 8;
const MAX_STEPS: usize = 512;
/// Relative error of the result below which longer records are not tried.
const SUFFICIENT_ERROR: f64 = 1e-8;
/// The largest accepted relative error.
const MAX_ERROR: f64 = 0.1;
/// The error if the least squares have no finite result.
const INACCURATE: LineariseError =
    LineariseError::Inaccurate { relative: f64::INFINITY, allowed: MAX_ERROR };
/// Degree in time of the coefficients if the operating point drifts.
const DEGREE: usize = 2;
/// The smallest accepted contrast of the directions.
const MIN_CONTRAST: f64 = 1e-8;
/// The step map is determined for these multiples of the step and extrapolated to step zero.
const MULTIPLES: [f64; 3] = [4.0, 2.0, 1.0];
/// The largest accepted relative prediction error for an input signal that the fit did not use.
const MAX_PREDICTION_ERROR: f64 = 1e-2;

/// The result of records of one length.
pub(super) struct RecordResult {
    pub(super) raw: RawResult,
    /// The largest error of an entry, relative to the largest entry of its row.
    pub(super) relative: f64,
}

/// [A, B, x'; C, D, 0] for one step size, and the standard deviations.
struct Map {
    values: DMatrix<f64>,
    deviations: DMatrix<f64>,
}

/// The step map: x[k+1] - x[k] = `change` [x[k]; u[k]], y[k+1] = `outputs` [x[k+1]; u[k]], with the values of the
/// matrices at the start of the record.
struct Discrete {
    change: DMatrix<f64>,
    outputs: DMatrix<f64>,
    /// The coefficients of the powers of time, for `change` and for `outputs`; no columns without drift.
    powers: [DMatrix<f64>; 2],
    /// Standard deviations of the rows of `change`, then of `outputs`.
    deviations: DMatrix<f64>,
}

impl Discrete {
    /// Returns `change` (0) or `outputs` (1), a polynomial in time, at `fraction` of the record, times `x_u` = [x; u].
    fn times(&self, which: usize, fraction: f64, x_u: &DMatrix<f64>) -> DMatrix<f64> {
        let mut product = [&self.change, &self.outputs][which] * x_u;
        let (powers, width) = (&self.powers[which], x_u.nrows());
        let mut power = fraction;
        for first in (0..powers.ncols()).step_by(width) {
            product += powers.columns(first, width) * x_u * power;
            power *= fraction;
        }
        product
    }
}

/// Linearises by steps of `step` s and its multiples; returns the most accurate result. The records get longer until
/// the errors are small: a short record excites slow states little, during a long one the operating point drifts.
pub(super) fn of_steps(
    fmu: &Fmu,
    parts: &Parts,
    states: &[Part],
    request: &Linearise,
    step: f64,
) -> Result<RecordResult, LineariseError> {
    let bench = Bench::new(fmu, parts, states, request, step)?;
    let mut benches: Vec<_> =
        MULTIPLES.iter().map(|multiple| bench.with_step(multiple * step)).collect();
    let mut best: Option<RecordResult> = None;
    let mut refusal = None;
    for count in lengths(states.len()) {
        match of_count(&mut benches, parts, states, count) {
            Ok(record) if best.as_ref().is_none_or(|known| record.relative < known.relative) => {
                let is_accurate = record.relative < SUFFICIENT_ERROR;
                best = Some(record);
                if is_accurate {
                    break;
                }
            }
            // A record of another length may excite all directions.
            Err(error) if matches!(refusal, None | Some(LineariseError::Unreachable { .. })) => {
                refusal = Some(error);
            }
            Ok(_) | Err(_) => {}
        }
    }
    best.ok_or_else(|| refusal.unwrap_or_else(|| unreachable(None, parts, states)))
}

/// Returns the numbers of steps of the records that are tried for this number of states, at least one.
fn lengths(states: usize) -> impl Iterator<Item = usize> {
    let first = MIN_STEPS.max(2 * (states + 1));
    std::iter::successors(Some(first), |count| Some(2 * count).filter(|next| *next <= MAX_STEPS))
}

/// Linearises by records of `count` steps. The last of `benches` has the shortest step.
fn of_count(
    benches: &mut [Bench],
    parts: &Parts,
    states: &[Part],
    count: usize,
) -> Result<RecordResult, LineariseError> {
    let Some((bench, longer)) = benches.split_last_mut() else {
        return Err(unreachable(None, parts, states));
    };
    let record = bench.record(count)?;
    let directions = Directions::of(&record.before);
    if directions.contrast < MIN_CONTRAST {
        return Err(unreachable(Some(directions), parts, states));
    }
    let discrete = fit(&record, parts, states, degree(&record)).ok_or(INACCURATE)?;
    let missed = prediction_error(bench, &discrete, &record, count)?;
    if missed.is_nan() || missed > MAX_PREDICTION_ERROR {
        return Err(LineariseError::NotStates { missed, allowed: MAX_PREDICTION_ERROR });
    }
    let maps = maps(bench, longer, &record, count, parts, states)?;
    let (values, errors) = at_step_zero(&maps);
    let (n, columns) = (states.len(), values.ncols() - 1);
    let (jacobian, errors) =
        (values.columns(0, columns).into_owned(), errors.columns(0, columns).into_owned());
    let scales = super::scales(states, &bench.x, &parts.inputs, &bench.u);
    let relative = relative_error(&errors, &jacobian, &scales);
    if relative.is_nan() || relative > MAX_ERROR {
        return Err(LineariseError::Inaccurate { relative, allowed: MAX_ERROR });
    }
    let names = parts.inputs.iter().map(|part| part.name.clone());
    let heights = names.zip(record.pulses.iter().map(|pulse| pulse.height)).collect();
    let how = Differences::OfSteps { step: bench.step, count, heights, missed };
    let raw = RawResult {
        states: states.to_vec(),
        x: bench.x.clone(),
        u: bench.u.clone(),
        y: bench.y.clone(),
        rates: (0..n).map(|k| values[(k, columns)]).collect(),
        jacobian,
        method: MethodResult::Differences(how, errors),
    };
    Ok(RecordResult { raw, relative })
}

/// Returns the error that names the variables without an independent direction; none without `directions`.
fn unreachable(directions: Option<Directions>, parts: &Parts, states: &[Part]) -> LineariseError {
    let names: Vec<&Part> = states.iter().chain(&parts.inputs).collect();
    let weak = directions.map(|directions| directions.weak(MIN_CONTRAST)).unwrap_or_default();
    LineariseError::Unreachable {
        rank: names.len() - weak.len(),
        expected: names.len(),
        names: weak.iter().map(|&column| names[column].name.clone()).collect(),
    }
}

/// Returns the continuous systems of `bench`, last, and of the benches `longer`, whose steps descend. Leaves out a step
/// size that has no continuous system, and all longer ones; it is an error if fewer than two step sizes remain.
fn maps(
    bench: &Bench,
    longer: &mut [Bench],
    record: &Record,
    count: usize,
    parts: &Parts,
    states: &[Part],
) -> Result<Vec<Map>, LineariseError> {
    let mut maps = Vec::new();
    for bench in longer {
        // A longer step may be too long for the FMU or for a real logarithm.
        match bench.record(count).map(|record| map(bench, &record, parts, states)) {
            Ok(Some(map)) => maps.push(map),
            _ => maps.clear(),
        }
    }
    let (step, map) = (bench.step, map(bench, record, parts, states));
    maps.push(map.ok_or(LineariseError::NoLogarithm { step })?);
    if maps.len() < 2 {
        return Err(LineariseError::NoLogarithm { step: 2.0 * step });
    }
    Ok(maps)
}

/// Returns the degree in time of the fitted coefficients: 0 without drift, otherwise at most as many coefficients as the
/// record has rows. The first record of one input has two rows for each coefficient of degree 0.
fn degree(record: &Record) -> usize {
    let (rows, width) = record.before.shape();
    if record.is_drifting { DEGREE.min((rows / width).saturating_sub(1)) } else { 0 }
}

/// Fits the continuous system to a record; `None` if the fit is not finite or has no real logarithm. If the operating
/// point drifts, the effect of the last degree in time is added to the error.
fn map(bench: &Bench, record: &Record, parts: &Parts, states: &[Part]) -> Option<Map> {
    let fitted = |degree| continuous(bench, &fit(record, parts, states, degree)?, record);
    let degree = degree(record);
    let mut map = fitted(degree)?;
    if degree > 0 {
        map.deviations += (&map.values - fitted(degree - 1)?.values).abs();
    }
    Some(map)
}

/// Fits the step map to a record, with coefficients that are polynomials of `degree` in time; `None` if the result is
/// not finite. The row of an output that is a state itself is exact.
fn fit(record: &Record, parts: &Parts, states: &[Part], degree: usize) -> Option<Discrete> {
    let width = record.before.ncols();
    let (state_noise, output_noise) = record.noise.split_at(states.len());
    let before = record.regressors(&record.before, 0, degree);
    let change = least_squares(&before, &record.change, state_noise)?;
    let after = record.regressors(&record.after, 1, degree);
    let outputs = least_squares(&after, &record.outputs, output_noise)?;
    let at_zero = |matrix: &DMatrix<f64>| matrix.rows(0, width).transpose();
    let powers = |matrix: &DMatrix<f64>| matrix.rows(width, matrix.nrows() - width).transpose();
    let mut discrete = Discrete {
        change: at_zero(&change.solution),
        outputs: at_zero(&outputs.solution),
        powers: [powers(&change.solution), powers(&outputs.solution)],
        deviations: DMatrix::zeros(states.len() + parts.outputs.len(), width),
    };
    let deviations = &mut discrete.deviations;
    deviations.rows_mut(0, states.len()).copy_from(&at_zero(&change.deviations));
    let mut output_rows = deviations.rows_mut(states.len(), parts.outputs.len());
    output_rows.copy_from(&at_zero(&outputs.deviations));
    for (row, output) in parts.outputs.iter().enumerate() {
        if let Some(state) = states.iter().position(|part| part.reference == output.reference) {
            discrete.outputs.row_mut(row).fill(0.0);
            discrete.outputs[(row, state)] = 1.0;
            discrete.powers[1].row_mut(row).fill(0.0);
            discrete.deviations.row_mut(states.len() + row).fill(0.0);
        }
    }
    Some(discrete)
}

/// Returns the continuous system whose exact step is the map: [A, B, x'] = log([Phi, Gamma, g; 0, I]) / h, where g is
/// the drift over one step; `None` without a real logarithm. The logarithm is taken in units of the typical
/// sizes and of the pulse heights.
fn continuous(bench: &Bench, discrete: &Discrete, record: &Record) -> Option<Map> {
    let (n, width) = discrete.change.shape();
    let mut scales: Vec<f64> = (0..n).map(|k| bench.scale(k)).collect();
    scales.extend(record.pulses.iter().map(|pulse| pulse.height));
    scales.push(1.0);
    let drift = bench.drift();
    let entry = |i: usize, j: usize| if j < width { discrete.change[(i, j)] } else { drift[i] };
    let scaled = DMatrix::from_fn(width + 1, width + 1, |i, j| {
        if i < n { entry(i, j) * scales[j] / scales[i] } else { 0.0 }
    });
    let logarithm = logarithm_of_one_plus(&scaled)?;
    let (p, h) = (discrete.outputs.nrows(), bench.step);
    let values = DMatrix::from_fn(n + p, width + 1, |i, j| match (i < n, j < width) {
        (true, _) => logarithm[(i, j)] * scales[i] / scales[j] / h,
        (false, true) => discrete.outputs[(i - n, j)],
        (false, false) => 0.0,
    });
    let deviations = DMatrix::from_fn(n + p, width + 1, |i, j| {
        let scale = if i < n { 1.0 / h } else { 1.0 };
        if j < width { discrete.deviations[(i, j)] * scale } else { 0.0 }
    });
    Some(Map { values, deviations })
}

/// Extrapolates each entry to step zero; returns the values and their errors. An FMU without integration error gives
/// the same entry for every step h; the error of an integration method of order q is of order h^q.
fn at_step_zero(maps: &[Map]) -> (DMatrix<f64>, DMatrix<f64>) {
    let (rows, columns) = maps[0].values.shape();
    let mut values = DMatrix::zeros(rows, columns);
    let mut errors = DMatrix::zeros(rows, columns);
    for i in 0..rows {
        for j in 0..columns {
            let entries: Vec<f64> = maps.iter().map(|map| map.values[(i, j)]).collect();
            let noise = |level: usize| maps[level].deviations[(i, j)];
            (values[(i, j)], errors[(i, j)]) = extrapolate(&entries, noise, 2.0, |order| order);
        }
    }
    (values, errors)
}

/// Returns the largest prediction error of the map, relative to the response of each reading, for
/// all inputs switched on and off in the Thue-Morse sequence.
fn prediction_error(
    bench: &mut Bench,
    discrete: &Discrete,
    record: &Record,
    count: usize,
) -> Result<f64, LineariseError> {
    let n = discrete.change.nrows();
    let shape = |step: usize, input: usize| {
        let Pulse { side, height } = record.pulses[input];
        let on = (step / 2 + input).count_ones().is_multiple_of(2);
        let sign = if side == Side::Below { -1.0 } else { 1.0 };
        if on { 0.5 * sign * height } else { 0.0 }
    };
    let is_both = record.pulses.iter().all(|pulse| pulse.side == Side::Both);
    let side = if is_both { Side::Both } else { Side::Above };
    let (response, _) = bench.response(count, 2, Pulse { side, height: 1.0 }, shape)?;
    let mut state = DMatrix::zeros(n, 1);
    let mut expected = DMatrix::zeros(count + 1, response.ncols());
    for step in 0..count {
        let with_inputs = |state: &DMatrix<f64>| {
            let inputs = (0..record.pulses.len()).map(|input| shape(step, input));
            DMatrix::from_iterator(discrete.change.ncols(), 1, state.iter().copied().chain(inputs))
        };
        let part = |step: usize| index(step) / index(count);
        state += discrete.times(0, part(step), &with_inputs(&state));
        let outputs = discrete.times(1, part(step + 1), &with_inputs(&state));
        for (column, value) in state.iter().chain(outputs.iter()).enumerate() {
            expected[(step + 1, column)] = *value;
        }
    }
    let sizes: Vec<f64> =
        (0..response.ncols()).map(|k| response.column(k).amax() / bench.scale(k)).collect();
    let least = 1e-6 * sizes.iter().fold(0.0_f64, |largest, &size| largest.max(size));
    let relative = (0..response.ncols()).map(|k| {
        let difference = (response.column(k) - expected.column(k)).amax() / bench.scale(k);
        difference / sizes[k].max(least).max(f64::MIN_POSITIVE)
    });
    Ok(relative.fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::lengths;

    #[test]
    fn records_have_two_steps_for_each_state_even_if_there_are_many() {
        assert!(lengths(3).eq([8, 16, 32, 64, 128, 256, 512]));
        assert!(lengths(255).eq([512]));
        assert!(lengths(300).eq([602]));
    }
}
