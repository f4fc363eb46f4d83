//! The longest time over which the signals between plant and controller may be held.

use super::crossing::stability_limit;
use super::delay::period_of;
use super::held::mean;
use super::{Loop, beside, held_plant};
use crate::balance::Balance;
use crate::blocks::{block_2x2, stacked};
use crate::eigen::eigenvalues;
use crate::stability::instability;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;
use std::iter::successors;

/// The longest hold is searched from `SHORTEST` times the shortest time constant to `LONGEST` times the longest one.
const SHORTEST: f64 = 1e-9;
const LONGEST: f64 = 100.0;
/// Ratios of successive tested times: up to `SHORT` times the shortest time constant, where the hold hardly changes
/// the loop, and above.
const FACTORS: [f64; 2] = [8.0, 1.25];
const SHORT: f64 = 1e-2;

/// Computes the longest hold time of a continuous loop: plant and controller exchange their signals
/// every h and hold them in between, as in co-simulation or with a discretised controller.
///
/// Returns the h below which the loop is stable: zero if the loop is unstable already at 1e-9 of its shortest time
/// constant, infinite if it is stable at all tested h up to 100 times its longest time constant.
/// Method: stability at h in ratios of 1.25 (of 8 below 1e-2 of the shortest time constant), then regula
/// falsi. The eigenvalues of (Phi - I) / h decide, Phi the dynamics from sample to sample; they are precise at a
/// short h. An unstable interval between two tested h is missed.
///
/// # Errors
///
/// [`Error::OutOfRange`] for a sampled loop; [`Error::NotHurwitz`] for a loop that is not stable;
/// [`Error::NotConverged`], [`Error::Overflow`].
pub fn longest_hold(closed: &Loop) -> Result<f64, Error> {
    let (plant, controller) = (closed.plant(), closed.controller());
    let is_continuous = plant.domain == Domain::Continuous;
    check::that(is_continuous, "the domain", f64::NAN, "that of a continuous loop")?;
    let balanced = [&plant.a, &controller.a].map(Balance::new);
    let value = |h: f64| {
        let (of_plant, of_controller) = (mean(&balanced[0], h)?, mean(&balanced[1], h)?);
        let (a, b) = (&plant.a * &of_plant, of_plant * &plant.b);
        let (a_k, b_k) = (&controller.a * &of_controller, of_controller * &controller.b);
        let mut rate = block_2x2(
            [&(a + &b * &controller.d * &plant.c), &(b * &controller.c)],
            [&(&b_k * &plant.c), &a_k],
        );
        if plant.d.amax() > 0.0 {
            // The previous commands v are further states: y = C x + D v.
            let (n, m) = plant.b.shape();
            let of_held = stacked(&DMatrix::zeros(n, m), &(b_k * &plant.d));
            let of_states = beside(&DMatrix::zeros(m, n), &(&controller.c / h));
            let decay = DMatrix::from_diagonal_element(m, m, -h.recip());
            rate = block_2x2([&rate, &of_held], [&of_states, &decay]);
        }
        // |1 + h r| < 1 for the eigenvalues r.
        let excess = |r: &nalgebra::Complex<f64>| 2.0 * r.re + h * r.norm_sqr();
        Ok(eigenvalues(&rate)?.iter().map(excess).fold(f64::NEG_INFINITY, f64::max))
    };
    let modes = closed.sensitivity(super::Point::Input).stable_eigenvalues()?;
    let fastest = modes.iter().map(|mode| mode.norm()).fold(0.0, f64::max);
    let slowest = modes.iter().map(|mode| mode.norm()).fold(f64::INFINITY, f64::min);
    search(value, [SHORTEST / fastest, SHORT / fastest, LONGEST / slowest])
}

/// Computes the longest sample time at which the loop of the continuous `plant` and the sampled `controller` is
/// stable. The matrices of the controller do not change: the effect of a clock that is too slow.
///
/// The search starts at the period of the controller and ends at 1000 times the period. The result is zero if
/// the loop is unstable at the period, and infinite if it is stable to the end. Method: stability at sample times
/// in ratios of 1.25, then regula falsi.
///
/// # Errors
///
/// Same as [`held_plant`], [`Loop::new`]; [`Error::OutOfRange`] for a continuous controller or a sampled plant.
pub fn longest_period(plant: &StateSpace, controller: &StateSpace) -> Result<f64, Error> {
    let period = period_of(controller)?;
    check::that(
        plant.domain == Domain::Continuous,
        "the domain",
        f64::NAN,
        "that of a continuous plant",
    )?;
    let value = |h: f64| {
        let sampled = StateSpace { domain: controller.domain, ..held_plant(plant, h)? };
        let closed = Loop::new(sampled, controller.clone())?;
        instability(&closed.dynamics(), controller.domain)
    };
    search(value, [period, period, 1000.0 * period])
}

/// The first time between `from` and `to` at which the value is at least zero: zero if it is so at `from`, infinite if
/// the value is negative at all tested times. Below `short` fewer times are tested.
fn search(
    value: impl Fn(f64) -> Result<f64, Error>,
    [from, short, to]: [f64; 3],
) -> Result<f64, Error> {
    let end = to.min(f64::MAX);
    let is_stable_at_start = from > end || value(from)? < 0.0;
    if !is_stable_at_start {
        return Ok(0.0);
    }
    let next = |h: &f64| Some(h * FACTORS[usize::from(*h >= short)]);
    let times = successors(Some(from), next).take_while(|h| *h <= end);
    Ok(stability_limit(0.0, times, value)?.unwrap_or(f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a mode slower than 1e-306 the search would end above the range of double precision.
    #[test]
    fn a_search_ends_with_the_largest_double() {
        let value = |h: f64| Ok(if h.is_finite() { -1.0 } else { f64::NAN });
        assert_eq!(search(value, [1e300, 1e300, f64::INFINITY]), Ok(f64::INFINITY));
        assert_eq!(search(value, [f64::INFINITY; 3]), Ok(f64::INFINITY));
    }

    #[test]
    fn a_sampled_loop_has_no_hold_time() {
        let one = |value| DMatrix::from_element(1, 1, value);
        let domain = Domain::Sampled { period: 1.0 };
        let plant = StateSpace { a: one(0.5), b: one(1.0), c: one(1.0), d: one(0.0), domain };
        let controller = StateSpace { a: one(0.0), b: one(0.0), c: one(0.0), d: one(-0.1), domain };
        let closed = Loop::new(plant, controller).unwrap();
        assert!(matches!(longest_hold(&closed), Err(Error::OutOfRange { .. })));
    }
}
