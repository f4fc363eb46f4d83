//! The longest time over which the signals between plant and controller may be held.

use super::Loop;
use crate::blocks::block_2x2;
use crate::eigen::eigenvalues;
use crate::hold::zero_order_hold;
use crate::stability::instability;
use crate::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

/// The search begins at this part of the shortest time constant of the loop and ends at `LONGEST`
/// times the longest one.
const SHORTEST: f64 = 1e-9;
const LONGEST: f64 = 100.0;
const FACTOR: f64 = 1.25;
const BISECTIONS: usize = 40;

/// Computes the longest hold time of a continuous loop: plant and controller exchange their signals
/// every h and hold them in between, as in co-simulation or with a sampled controller that is the
/// discretised continuous one.
///
/// Returns the h below which the loop is stable: zero if it diverges with a hold of 1e-9 of its
/// shortest time constant already, infinite if it is stable at 100 times its longest one. Method:
/// stability at h in ratios of 1.25, then bisection; the eigenvalues of the difference of two samples
/// decide, which are precise at a short h. An unstable interval between two steps is missed.
///
/// # Errors
///
/// [`Error::NotHurwitz`] for a loop that is not stable, or sampled; same as [`zero_order_hold`].
pub fn longest_hold(closed: &Loop) -> Result<f64, Error> {
    let (plant, own) = (closed.plant(), closed.controller());
    let increments = |system: &StateSpace, h: f64| {
        let n = system.a.nrows();
        let (_, integral) = zero_order_hold(&system.a, &DMatrix::identity(n, n), h)?;
        Ok::<_, Error>((&system.a * &integral / h, integral * &system.b / h))
    };
    let stable = |h: f64| {
        let ((a, b), (own_a, own_b)) = (increments(plant, h)?, increments(own, h)?);
        let rate = block_2x2(
            [&(a + &b * &own.d * &plant.c), &(b * &own.c)],
            [&(own_b * &plant.c), &own_a],
        );
        // |1 + h r| < 1 for the eigenvalues r.
        let inside = |r: &nalgebra::Complex<f64>| 2.0 * r.re + h * r.norm_sqr() < 0.0;
        Ok(eigenvalues(&rate)?.iter().all(inside))
    };
    let modes = closed.sensitivity(super::Point::Input).stable_eigenvalues()?;
    let fastest = modes.iter().map(|mode| mode.norm()).fold(0.0, f64::max);
    let slowest = modes.iter().map(|mode| mode.norm()).fold(f64::INFINITY, f64::min);
    search(stable, SHORTEST / fastest, LONGEST / slowest)
}

/// Computes the longest sample time at which the loop of the continuous `plant` and the sampled
/// `controller` is stable, the matrices of the controller unchanged: a clock that is too slow.
///
/// The search begins at the period of the controller and ends at 1000 times of it, with the result
/// infinite; the result is zero if the loop is unstable at its period. Method: see [`longest_hold`].
///
/// # Errors
///
/// Same as [`zero_order_hold`]; [`Error::OutOfRange`] when the controller is continuous.
pub fn longest_period(plant: &StateSpace, controller: &StateSpace) -> Result<f64, Error> {
    let Domain::Sampled { period } = controller.domain else {
        let rule = "that of a sampled controller";
        return Err(Error::OutOfRange { name: "the domain", value: f64::NAN, rule });
    };
    let stable = |h: f64| {
        let (a, b) = zero_order_hold(&plant.a, &plant.b, h)?;
        let sampled = StateSpace { a, b, domain: controller.domain, ..plant.clone() };
        let closed = Loop::new(sampled, controller.clone())?;
        Ok(instability(&closed.dynamics(), controller.domain)? < 0.0)
    };
    search(stable, period, 1000.0 * period)
}

/// The first loss of stability between `from` and `to`.
fn search(stable: impl Fn(f64) -> Result<bool, Error>, from: f64, to: f64) -> Result<f64, Error> {
    let (mut good, mut h) = (0.0, from);
    while h <= to {
        if stable(h)? {
            (good, h) = (h, FACTOR * h);
            continue;
        }
        if good <= 0.0 {
            return Ok(0.0);
        }
        let mut bad = h;
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (good + bad);
            *(if stable(middle)? { &mut good } else { &mut bad }) = middle;
        }
        return Ok(good);
    }
    Ok(f64::INFINITY)
}
