//! A linear-quadratic regulator that is as fast as a given feedback.

use crate::balance::Balance;
use crate::eigen::eigenvalues;
use crate::riccati::{Weights, lqr};
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

const BISECTIONS: usize = 40;
/// Relative difference of the speeds at which the search ends.
const CLOSE: f64 = 1e-3;
/// Range of the weight of the states, as powers of ten.
const POWERS: [f64; 2] = [-12.0, 16.0];

/// Computes the linear-quadratic regulator of the same speed as the feedback u = K x: its
/// eigenvalues have the same sum of decay rates.
///
/// ```text
/// trace(A + B K_lq) = trace(A + B K)               continuous
/// det(A + B K_lq)   = det(A + B K) in modulus      sampled
/// ```
///
/// `a`: n x n; `b`: n x m; `gain`: K, m x n. The regulator weighs the states, in units that balance
/// A, by q and the inputs, in units for which the columns of B in these coordinates have length one,
/// by 1. The speed grows with q, which bisection finds. Returns None if no q is as slow or as fast.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix;
/// [`Error::NotConverged`] for eigenvalues.
pub fn regulator_of_same_speed(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    gain: &DMatrix<f64>,
    domain: Domain,
) -> Result<Option<DMatrix<f64>>, Error> {
    let n = check::square("A", a)?;
    check::shape("B", b, (n, b.ncols()))?;
    check::shape("K", gain, (b.ncols(), n))?;
    let required = speed(&(a + b * gain), domain)?;
    let scale = Balance::new(a).scale;
    let q = DMatrix::from_diagonal(&scale.map(|unit| 1.0 / (unit * unit)));
    let lengths = DMatrix::from_fn(n, b.ncols(), |i, j| b[(i, j)] / scale[i]);
    let lengths = lengths.column_iter().map(|column| column.norm_squared());
    let lengths: Vec<f64> = lengths.map(|size| if size > 0.0 { size } else { 1.0 }).collect();
    let r = DMatrix::from_diagonal(&lengths.into());
    let solve = |power: f64| {
        let weights = Weights { q: &q * 10_f64.powf(power), r: r.clone(), n: None };
        lqr(a, b, &weights, domain).ok().map(|found| found.gain)
    };
    let [mut slow, mut fast] = POWERS;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (slow + fast);
        let Some(found) = solve(middle) else {
            // Extreme weights have no verified solution.
            *(if middle < 0.0 { &mut slow } else { &mut fast }) = middle;
            continue;
        };
        let reached = speed(&(a + b * &found), domain)?;
        if (reached - required).abs() <= CLOSE * required.abs() {
            return Ok(Some(found));
        }
        *(if reached < required { &mut slow } else { &mut fast }) = middle;
    }
    Ok(None)
}

/// The sum of the decay rates; in sampled time per sample.
fn speed(closed: &DMatrix<f64>, domain: Domain) -> Result<f64, Error> {
    Ok(match domain {
        Domain::Continuous => -closed.trace(),
        Domain::Sampled { .. } => {
            -eigenvalues(closed)?.iter().map(|z| z.norm().max(f64::MIN_POSITIVE).ln()).sum::<f64>()
        }
    })
}
