//! A linear-quadratic regulator that is as fast as a given feedback.

use crate::balance::Balance;
use crate::eigen::eigenvalues;
use crate::riccati::{Weights, lqr};
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

const STEPS: usize = 60;
/// Relative difference of the speeds at which the search ends.
const CLOSE: f64 = 1e-3;
/// Range of the weight of the states, as exponents of ten.
const POWERS: [f64; 2] = [-12.0, 16.0];

/// An end of the interval in which the weight is searched.
struct End {
    /// The decimal logarithm of the weight.
    power: f64,
    /// ln(speed / required speed); NaN if the speed is not known.
    excess: f64,
}

/// Computes the linear-quadratic regulator of the same speed as the feedback u = K x: the
/// eigenvalues of both closed loops have the same sum of decay rates.
///
/// ```text
/// trace(A + B K_lq) = trace(A + B K)               continuous
/// det(A + B K_lq)   = det(A + B K) in modulus      sampled
/// ```
///
/// `a`: n x n; `b`: n x m; `gain`: K, m x n. The weight of the states is q, in units that balance A; the
/// weight of the inputs is 1, in units in which the columns of the balanced B have length one.
/// The speed grows with q. Regula falsi between logarithms of q and speed, with a bisection in every
/// third step, finds q. Returns None if no q from 1e-12 to 1e16 gives this speed to 1e-3.
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
    let n = check::with_inputs(a, b)?;
    check::shape("K", gain, (b.ncols(), n))?;
    let required = speed(&(a + b * gain), domain)?;
    let scale = Balance::new(a).scale;
    let q = DMatrix::from_diagonal(&scale.map(|unit| 1.0 / (unit * unit)));
    let balanced = DMatrix::from_fn(n, b.ncols(), |i, j| b[(i, j)] / scale[i]);
    let squares = balanced.column_iter().map(|column| column.norm_squared());
    let squares: Vec<f64> = squares.map(|size| if size > 0.0 { size } else { 1.0 }).collect();
    let r = DMatrix::from_diagonal(&squares.into());
    let solve = |power: f64| {
        let weights = Weights { q: &q * 10_f64.powf(power), r: r.clone(), n: None };
        lqr(a, b, &weights, domain).ok().map(|regulator| regulator.gain)
    };
    let [mut slow, mut fast] = POWERS.map(|power| End { power, excess: f64::NAN });
    for step in 1..=STEPS {
        // Regula falsi, with a bisection in every third step and while a speed is not known.
        let fraction = slow.excess / (slow.excess - fast.excess);
        let fraction = if fraction.is_finite() && step % 3 != 0 { fraction } else { 0.5 };
        let power = slow.power + fraction * (fast.power - slow.power);
        let Some(gain) = solve(power) else {
            // Extreme weights have no verified solution.
            *(if power < 0.0 { &mut slow } else { &mut fast }) = End { power, excess: f64::NAN };
            continue;
        };
        let reached = speed(&(a + b * &gain), domain)?;
        if (reached - required).abs() <= CLOSE * required.abs() {
            return Ok(Some(gain));
        }
        let end = End { power, excess: (reached / required).ln() };
        *(if reached < required { &mut slow } else { &mut fast }) = end;
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
