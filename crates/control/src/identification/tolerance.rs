//! The tolerance of matrix entries that is equivalent to the uncertainty of an identification.

use nalgebra::DMatrix;

use crate::blocks::ComplexMatrix;
use crate::check::as_number;
use crate::response::frequency_response;
use crate::{Error, StateSpace, check};

/// Relative change of an entry in a difference quotient.
const STEP: f64 = 1e-6;

/// The frequencies and units in which frequency responses are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseUnits {
    /// The frequencies in rad per unit of time.
    pub frequencies: Vec<f64>,
    /// The size of each input.
    pub inputs: Vec<f64>,
    /// The size of each output.
    pub outputs: Vec<f64>,
}

/// The relative tolerance of the entries of `plant` that moves its frequency response as far as two standard deviations
/// of its estimate do.
///
/// `estimate`: `plant`, or the sampled plant whose continuous form is `plant`; `parts`: the estimates from the same
/// samples without one of g blocks each, the jackknife. With the distance
///
/// ```text
/// d(G, H)^2 = sum over frequencies of |G - H|^2 / ((1 + |G|^2) (1 + |H|^2)),    | | the Frobenius norm,
/// ```
///
/// of responses in units of the signals, the estimate G has the variance (g - 1) / g times the sum of d(G, `G_i`)^2.
/// Independent entries of A, B, C and D with relative deviation r give r^2 times the sum of the squared derivatives
/// of d by the logarithm of each entry. Zeros and rows of C with a single 1 are exact. The result, 2 r, depends neither
/// on units nor on the scales of the states; it is not finite if no entry varies, and zero for fewer than two parts.
/// For one input and one output d is the chordal distance of the responses. It gives the most weight to frequencies
/// near a gain of one, where a feedback acts.
///
/// Source: B. Efron, The jackknife, the bootstrap and other resampling plans, SIAM (1982), equation 3.6; G. Vinnicombe,
/// Frequency domain uncertainty and the graph topology, IEEE Trans. Autom. Control 38 (1993).
///
/// # Errors
///
/// Same as [`frequency_response`], for `plant`, `estimate` and `parts`; [`Error::Shape`] unless `units` has as many
/// inputs and outputs as each of them.
pub fn equivalent_tolerance(
    plant: &StateSpace,
    estimate: &StateSpace,
    parts: &[StateSpace],
    units: &ResponseUnits,
) -> Result<f64, Error> {
    let whole = responses(estimate, units)?;
    let blocks = as_number(parts.len());
    let mut variance = 0.0;
    for part in parts {
        variance += distance_squared(&whole, &responses(part, units)?) * (blocks - 1.0) / blocks;
    }
    let nominal = responses(plant, units)?;
    let mut sensitivity = 0.0;
    for matrix in 0..4 {
        for entry in varying(plant, matrix) {
            let mut changed = plant.clone();
            let StateSpace { a, b, c, d, .. } = &mut changed;
            [a, b, c, d][matrix][entry] *= 1.0 + STEP;
            sensitivity += distance_squared(&nominal, &responses(&changed, units)?) / (STEP * STEP);
        }
    }
    Ok(2.0 * (variance / sensitivity).sqrt())
}

/// The positions of the entries of A, B, C or D (`number` 0 to 3) that vary: no zeros, no rows of C with a single 1.
fn varying(model: &StateSpace, number: usize) -> Vec<(usize, usize)> {
    let matrix = [&model.a, &model.b, &model.c, &model.d][number];
    let is_zero = |value: f64| value.abs() <= 0.0;
    let is_exact = |row: usize| {
        let entries = matrix.row(row).iter().filter(|entry| !is_zero(**entry)).count();
        number == 2 && entries == 1 && is_zero(matrix.row(row).sum() - 1.0)
    };
    let entries = (0..matrix.nrows()).flat_map(|row| (0..matrix.ncols()).map(move |c| (row, c)));
    entries.filter(|&(row, column)| !is_zero(matrix[(row, column)]) && !is_exact(row)).collect()
}

/// The frequency responses in units of the signals.
fn responses(system: &StateSpace, units: &ResponseUnits) -> Result<Vec<ComplexMatrix>, Error> {
    let points = frequency_response(system, &units.frequencies)?;
    check::length("the units of the inputs", &units.inputs, system.b.ncols())?;
    check::length("the units of the outputs", &units.outputs, system.c.nrows())?;
    let scaled = |gain: ComplexMatrix| {
        DMatrix::from_fn(gain.nrows(), gain.ncols(), |i, j| {
            gain[(i, j)] * (units.inputs[j] / units.outputs[i])
        })
    };
    Ok(points.into_iter().map(|point| scaled(point.gain)).collect())
}

/// d(G, H)^2 of [`equivalent_tolerance`].
fn distance_squared(one: &[ComplexMatrix], other: &[ComplexMatrix]) -> f64 {
    let at_frequency = |(g, h): (&ComplexMatrix, &ComplexMatrix)| {
        (g - h).norm_squared() / ((1.0 + g.norm_squared()) * (1.0 + h.norm_squared()))
    };
    one.iter().zip(other).map(at_frequency).sum()
}
