//! A constant gain for a family of systems.

use super::{Affine, Problem, norm_below};
use crate::blocks::to_complex;
use crate::response::{frequency_response, h_infinity};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;

const ROUNDS: usize = 60;
/// Relative distance between the computed lower and upper bound of a norm.
const NORM_WIDTH: f64 = 1e-6;
/// A worst error up to this fraction of the target ends the search: it is at the accuracy of the solver, which cannot
/// prove a lower bound near it.
const ATTAINED: f64 = 1e-6;

/// A constant gain with the least worst error over a family of systems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ConstantGain {
    /// The gain Q, s x r.
    pub gain: DMatrix<f64>,
    /// H-infinity norm of Q `G_i` - M for each system `G_i`, M the target.
    pub norms: Vec<f64>,
    /// The largest of `norms`.
    pub worst: f64,
    /// A lower bound of the worst error of every gain, up to the accuracy of the solver: the minimum for
    /// the frequencies that were evaluated.
    pub lower_bound: f64,
}

/// Computes the constant gain Q that minimises the worst H-infinity error over a family.
///
/// ```text
/// min over Q of max over i of || Q G_i - M ||,   G_i = C_i (s I - A_i)^-1 B_i + D_i
/// ```
///
/// `family`: stable systems `G_i` with r outputs and m inputs each; `target`: M, s x m; `fixed`:
/// entries (row, column, value) of Q that are given, counted from 0; `width`: relative distance of
/// the worst error from its lower bound at which the iteration ends, at least 1e-5. It also ends at a worst error
/// of 1e-6 times the Frobenius norm of M, as of a target that a gain attains exactly.
///
/// With `G_i` from [u; d; f] to [y; u] and M = [0, 0, I], Q [y; u] is a static residual generator for all systems of
/// the family: its error is the response to commands and disturbances together with the error of the fault estimate. If
/// sensor faults act through `D_i` only, fixed entries of Q make the response to them exact.
///
/// The problem is convex. Method: for a finite set of frequencies of each system the minimum is a semidefinite program,
/// and a lower bound; the frequencies of the largest singular values of Q `G_i` - M join the set, until the largest
/// exceeds the bound by less than `width` (an exchange method for semi-infinite programs: R. Hettich and K. O.
/// Kortanek, SIAM Review 35 (1993)). Usually about 10 rounds.
///
/// # Errors
///
/// [`Error::Empty`] for a family without systems; [`Error::Shape`], [`Error::NotFinite`],
/// [`Error::NotHurwitz`], [`Error::NotSchur`] for a bad system, target or entry;
/// [`Error::OutOfRange`] for a `width` not above 0; [`Error::NotConverged`] when the programs do not end.
pub fn constant_gain(
    family: &[StateSpace],
    target: &DMatrix<f64>,
    fixed: &[(usize, usize, f64)],
    width: f64,
) -> Result<ConstantGain, Error> {
    let first = family.first().ok_or(Error::Empty { matrix: "the family", actual: (0, 1) })?;
    let (s, r, m) = (target.nrows(), first.c.nrows(), first.b.ncols());
    check::shape("M", target, (s, m))?;
    check::positive("width", width)?;
    for system in family {
        system.stable_eigenvalues()?;
        check::shape("C", &system.c, (r, system.a.nrows()))?;
        check::shape("B", &system.b, (system.a.nrows(), m))?;
    }
    if let Some(&(row, column, _)) = fixed.iter().find(|entry| entry.0 >= s || entry.1 >= r) {
        let (expected, actual) = ((s, r), (row + 1, column + 1));
        return Err(Error::Shape { matrix: "fixed", expected, actual });
    }
    if let Some(at) = fixed.iter().position(|entry| !entry.2.is_finite()) {
        let (row, value) = (at + 1, fixed[at].2);
        return Err(Error::NotFinite { matrix: "fixed", row, col: 3, value });
    }
    let width = width.max(1e-5);
    let at_ends = |system| [0.0, f64::INFINITY].map(|frequency| response(system, frequency));
    let mut points = family.iter().flat_map(at_ends).collect::<Result<Vec<_>, _>>()?;
    let mut best: Option<ConstantGain> = None;
    for _ in 0..ROUNDS {
        let what = "the program for a constant gain";
        let (bound, gain) = minimum(&points, target, fixed, r)
            .ok_or(Error::NotConverged { what, iterations: ROUNDS })?;
        // The solver may miss a bound of zero by its accuracy.
        let bound = bound.max(0.0);
        let mut norms = Vec::with_capacity(family.len());
        for system in family {
            // Q G - M.
            let (c, d) = (&gain * &system.c, &gain * &system.d - target);
            let norm = h_infinity(&StateSpace { c, d, ..system.clone() }, NORM_WIDTH)?;
            norms.push(norm.upper);
            if norm.lower > bound * (1.0 + 0.5 * width) {
                points.push(response(system, norm.frequency)?);
            }
        }
        let worst = norms.iter().copied().fold(0.0, f64::max);
        let lower_bound = best.as_ref().map_or(bound, |best| best.lower_bound.max(bound));
        match &mut best {
            Some(best) if best.worst <= worst => best.lower_bound = lower_bound,
            _ => best = Some(ConstantGain { gain, norms, worst, lower_bound }),
        }
        let enough = (lower_bound * (1.0 + width)).max(ATTAINED * target.norm());
        if let Some(best) = best.take_if(|best| best.worst <= enough) {
            return Ok(best);
        }
    }
    Err(Error::NotConverged { what: "the exchange of frequencies", iterations: ROUNDS })
}

/// G at one frequency; in sampled time infinity means half of the sample rate.
fn response(system: &StateSpace, frequency: f64) -> Result<DMatrix<Complex<f64>>, Error> {
    let frequency = match system.domain {
        Domain::Continuous if frequency.is_infinite() => return Ok(to_complex(&system.d)),
        Domain::Sampled { period } if frequency.is_infinite() => PI / period,
        _ => frequency,
    };
    Ok(frequency_response(system, &[frequency])?.remove(0).gain)
}

/// The smallest gamma, and its Q with r columns, for which [gamma I, X; X*, gamma I] >= 0 with X = Q G - M at all
/// points G; None if the solver fails.
fn minimum(
    points: &[DMatrix<Complex<f64>>],
    target: &DMatrix<f64>,
    fixed: &[(usize, usize, f64)],
    r: usize,
) -> Option<(f64, DMatrix<f64>)> {
    let s = target.nrows();
    // Column j of Q is in units in which the longest row j of all G has length one.
    let length = |row: usize| points.iter().map(|g| g.row(row).norm()).fold(0.0, f64::max);
    let units: Vec<f64> =
        (0..r).map(|row| if length(row) > 0.0 { length(row) } else { 1.0 }).collect();
    let mut problem = Problem::new();
    let level = problem.level(None);
    let mut gain = Affine::zeros(s, r);
    for row in 0..s {
        for column in 0..r {
            let mut entry = DMatrix::zeros(s, r);
            entry[(row, column)] = 1.0;
            let value = match fixed.iter().find(|entry| (entry.0, entry.1) == (row, column)) {
                Some(&(_, _, value)) => Affine::constant(&(entry * value)),
                None => problem.scalar().times(&(entry / units[column])),
            };
            gain = &gain + &value;
        }
    }
    for g in points {
        let real = &(&gain * &g.map(|entry| entry.re)) - &Affine::constant(target);
        let imaginary = &gain * &g.map(|entry| entry.im);
        let x = Affine::blocks(&[&[&real, &-&imaginary], &[&imaginary, &real]]);
        problem.constrain(&norm_below(&x, &level), 0.0);
    }
    let (bound, unknowns) = problem.minimum()?;
    Some((bound, gain.evaluate(&unknowns)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Q = [-1, 1] makes Q G = 1 for G = [g; g + 1] with any g.
    #[test]
    fn a_target_that_is_attained_exactly_ends_the_iteration() {
        let one = DMatrix::from_element(1, 1, 1.0);
        let system = |rate: f64| StateSpace {
            a: &one * -rate,
            b: one.clone(),
            c: DMatrix::from_element(2, 1, 1.0),
            d: DMatrix::from_column_slice(2, 1, &[0.0, 1.0]),
            domain: Domain::Continuous,
        };
        let family = [0.1, 1.0, 30.0].map(system);
        let best = constant_gain(&family, &one, &[], 1e-3).unwrap();
        assert!(best.worst < 1e-6 && best.lower_bound >= 0.0, "{best:?}");
        let expected = DMatrix::from_row_slice(1, 2, &[-1.0, 1.0]);
        assert!((&best.gain - expected).amax() < 1e-5, "{best:?}");
    }

    #[test]
    fn a_given_entry_that_is_not_a_number_is_refused_by_its_place() {
        let one = DMatrix::from_element(1, 1, 1.0);
        let (a, b, c, d) = (-&one, one.clone(), one.clone(), one.clone());
        let family = [StateSpace { a, b, c, d, domain: Domain::Continuous }];
        let refused = constant_gain(&family, &one, &[(0, 0, f64::NAN)], 1e-3);
        assert!(matches!(refused, Err(Error::NotFinite { matrix: "fixed", row: 1, col: 3, .. })));
    }
}
