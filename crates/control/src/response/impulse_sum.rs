//! Peak gains of a sampled system by adding every sample of its impulse responses.

use super::Bracket;
use crate::check::as_number;
use crate::{Error, StateSpace};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::TAU;

/// The binary logarithm of the largest number of samples within which the state must shrink by half.
const LONGEST: u32 = 24;
/// The approximate number of contractions by half that a sum needs.
const HALVINGS: f64 = 12.0;
/// Number of intervals that [`super::peak_gain`] needs for an impulse response, and for each oscillation of the
/// response.
const INTERVALS: [f64; 2] = [500.0, 50.0];
/// The number of different lengths of the intervals of `peak_gain`.
const LENGTHS: f64 = 30.0;
/// A sum is complete when the state, relative to the first state, is below this times the required width.
const NEGLIGIBLE: f64 = 1e-9;

/// Bounds of |D| + the sum over k of |C A^k B|, entry by entry.
///
/// The lower bound is the sum of finitely many samples; the upper bound adds a bound of all later ones, from the
/// contraction of A. `eigenvalues`: of A. None if A contracts so slowly that intervals of many samples are cheaper.
pub(super) fn impulse_sums(
    system: &StateSpace,
    eigenvalues: &[Complex<f64>],
    width: f64,
) -> Result<Option<Bracket>, Error> {
    let StateSpace { a, b: mut states, c, .. } = system.balanced();
    // After `block` samples the state has at most half of its norm: the root of the product of the largest sums of
    // rows and of columns is not below the norm of the power.
    let (mut block, mut power) = (1_u32, a.clone());
    let largest_sum =
        |m: &DMatrix<f64>| m.column_iter().map(|column| column.lp_norm(1)).fold(0.0, f64::max);
    while (largest_sum(&power) * largest_sum(&power.transpose())).sqrt().min(power.norm()) > 0.5 {
        if block == 1 << LONGEST || f64::from(block) > largest_block(system, eigenvalues) {
            return Ok(None);
        }
        block *= 2;
        power = &power * &power;
    }
    // Bounds of the sums after a state of norm one.
    let mut tails = vec![0.0; c.nrows()];
    let mut rows = c.clone();
    for _ in 0..block {
        tails.iter_mut().zip(rows.row_iter()).for_each(|(tail, row)| *tail += 2.0 * row.norm());
        rows *= &a;
    }
    let lengths = |states: &DMatrix<f64>| -> Vec<f64> {
        states.column_iter().map(|column| column.norm()).collect()
    };
    let initial = lengths(&states);
    let mut lower = system.d.abs();
    let mut response = DMatrix::zeros(c.nrows(), states.ncols());
    let mut next = states.clone();
    loop {
        for _ in 0..block {
            response.gemm(1.0, &c, &states, 0.0);
            lower.zip_apply(&response, |sum, value| *sum += value.abs());
            next.gemm(1.0, &a, &states, 0.0);
            std::mem::swap(&mut states, &mut next);
        }
        let sizes = lengths(&states);
        // If an input does not reach an output, the sum is zero, and no bound of its tail is small relative to the sum.
        let is_short = |input: usize| sizes[input] <= NEGLIGIBLE * width * initial[input];
        let is_small =
            |row: usize, input: usize| tails[row] * sizes[input] <= width * lower[(row, input)];
        let is_complete =
            |input| is_short(input) || (0..tails.len()).all(|row| is_small(row, input));
        if (0..sizes.len()).all(is_complete) {
            let upper = DMatrix::from_fn(tails.len(), sizes.len(), |row, input| {
                lower[(row, input)] + tails[row] * sizes[input]
            });
            return Ok(Some(Bracket { lower, upper }));
        }
    }
}

/// The largest number of samples per contraction by half for which adding all samples is cheaper than intervals.
fn largest_block(system: &StateSpace, eigenvalues: &[Complex<f64>]) -> f64 {
    let [order, inputs] = [system.a.nrows(), system.b.ncols()].map(as_number);
    let oscillations = |value: &Complex<f64>| {
        let decay = -value.norm().max(f64::MIN_POSITIVE).ln();
        value.arg().abs() / TAU * HALVINGS / decay
    };
    let oscillations = eigenvalues.iter().filter(|value| value.im != 0.0).map(oscillations);
    let intervals = INTERVALS[0] + INTERVALS[1] * oscillations.fold(0.0, f64::max);
    (3.0 * order * intervals + 2.0 * order * order * LENGTHS / inputs.max(1.0)) / HALVINGS
}
