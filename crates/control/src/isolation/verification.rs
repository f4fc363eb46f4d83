//! Verification of a residual generator on its plant.

use super::DisturbedPlant;
use super::decoupled::size_or_one;
use crate::blocks::{ComplexMatrix, beside, to_complex};
use crate::residual::ResidualGenerator;
use crate::response::Transfer;
use crate::{Domain, StateSpace};
use nalgebra::Complex;

/// Frequencies at which the decoupling is verified, relative to the fastest pole, in sampled time to pi / period.
const CONTINUOUS: [f64; 5] = [0.03, 0.3, 1.0, 3.0, 30.0];
const SAMPLED: [f64; 5] = [0.01, 0.1, 0.3, 0.6, 0.9];

/// The largest response to an input from which the residual is decoupled, relative to the terms that cancel.
///
/// ```text
/// |q_y g + q_u| / (|q_y| |g| + |q_u| + max_i |q_y,i| c_i (|b| / |A| + max_i |d_i| / c_i))
/// ```
///
/// g is a column of the plant with b and d, [`q_u`, `q_y`] the generator, `c_i` the length of row i of C.
/// The last term, the effect that an input of this size could have, keeps rounding errors out where
/// no terms cancel. The result is the largest over commands, disturbances and decoupled faults, at five
/// frequencies; a frequency at which plant or generator have a pole is left out.
///
/// `plant`: in balanced coordinates; `fastest`: the rate of the fastest pole of the generator.
pub(super) fn decoupling_error(
    plant: &DisturbedPlant,
    pattern: &[bool],
    generator: &ResidualGenerator,
    fastest: f64,
) -> f64 {
    let commands = plant.b_u.ncols();
    let first_fault = commands + plant.b_d.ncols();
    let whole = StateSpace {
        a: plant.a.clone(),
        b: beside(&beside(&plant.b_u, &plant.b_d), &plant.b_f),
        c: plant.c.clone(),
        d: beside(&beside(&plant.d_u, &plant.d_d), &plant.d_f),
        domain: plant.domain,
    };
    let lengths: Vec<f64> =
        plant.c.row_iter().map(|row| if row.norm() > 0.0 { row.norm() } else { 1.0 }).collect();
    let size = size_or_one(&plant.a);
    let possible = |input: usize| {
        let direct = whole.d.column(input);
        let direct = direct.iter().zip(&lengths).map(|(d, length)| d.abs() / length);
        whole.b.column(input).norm() / size + direct.fold(0.0, f64::max)
    };
    let possible: Vec<f64> = (0..whole.b.ncols()).map(possible).collect();
    let filter = generator.system();
    let (whole, filter) = (response(&whole), response(&filter));
    let frequencies = match plant.domain {
        Domain::Continuous => CONTINUOUS.map(|factor| factor * fastest),
        Domain::Sampled { period } => SAMPLED.map(|factor| factor * std::f64::consts::PI / period),
    };
    let mut largest: f64 = 0.0;
    for frequency in frequencies {
        let (Some(g), Some(q)) = (whole(frequency), filter(frequency)) else {
            continue;
        };
        let (q_u, q_y) = (q.columns(0, commands), q.columns(commands, plant.c.nrows()));
        let strongest = q_y.iter().zip(&lengths).map(|(q, length)| q.norm() * length);
        let strongest = strongest.fold(0.0, f64::max);
        let is_decoupled = |input: &usize| *input < first_fault || !pattern[*input - first_fault];
        for input in (0..g.ncols()).filter(is_decoupled) {
            let direct = if input < commands { q_u[(0, input)] } else { Complex::new(0.0, 0.0) };
            let column = g.column(input);
            let terms = q_y.iter().zip(column.iter());
            let start = (direct, direct.norm() + strongest * possible[input]);
            let (sum, size) =
                terms.fold(start, |(sum, size), (q, g)| (sum + q * g, size + (q * g).norm()));
            if size > 0.0 {
                largest = largest.max(sum.norm() / size);
            }
        }
    }
    largest
}

/// The frequency response of a system that may have no states; None at a pole.
fn response(system: &StateSpace) -> impl Fn(f64) -> Option<ComplexMatrix> {
    let transfer = (!system.a.is_empty()).then(|| Transfer::new(system));
    move |frequency| match &transfer {
        Some(transfer) => transfer.gain(frequency).ok(),
        None => Some(to_complex(&system.d)),
    }
}
