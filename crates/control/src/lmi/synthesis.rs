//! Observer and feedback gains from linear matrix inequalities.

use super::gain::{GainBound, certify_gain};
use super::observer::{Candidate, ObserverRequirements};
use super::region::{Region, certify_region};
use super::requirement::{Performance, Synthesis};
use super::{Outcome, gain, region};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;
use std::slice::from_ref;

const NOT_PROVEN: &str = "a gain was found, but the requirements could not be proven for it";

/// Computes an observer gain L that places the eigenvalues of A - L C in a region and bounds the norm from w to z.
///
/// ```text
/// error dynamics x' = (A - L C) x + (B - L D_y) w, z = E x;  Z = P L
/// inequalities of certify_region and certify_gain with P (A - L C) = P A - Z C and
/// P (B - L D_y) = P B - Z D_y, one P for all of them
/// ```
///
/// `a`: n x n; `c`: p x n; `performance`: B = `disturbance`, E = `output`, `D_y` = `feedthrough`.
/// For an observer augmented by the fault, with (`A_0`, `C_0`): B = [0; -I] from the fault rate to the errors [e;
/// eps] of state and fault, or B = `-F_0` from the fault to [e; `f_hat`], `f_hat` its estimate.
///
/// Region only: L exists if (A, C) is observable and the parts of the region have a real interval in common. P >= I,
/// and Z of a norm up to twice the smallest possible, are chosen as far inside of all inequalities as possible. With a
/// performance, one P for all inequalities is sufficient, not necessary. For a given bound the gain is as far inside of
/// the inequalities as possible. Without one, the smallest bound is computed, and the gain is designed for a bound 5 %
/// larger, as far inside as possible, because gains often grow without limit towards the smallest bound. If w does not
/// act on the measurement, faster eigenvalues always lower the norm: give a disc to limit the gain.
///
/// The program is solved in coordinates in which all states are equally observable at the speed
/// that the region requires; if no gain is found, up to three times more in coordinates in which
/// the most interior P becomes the identity. With a performance, P and Z are bounded by 1e6 in these
/// coordinates; a conflict that names "gain" means that no gain exists within these bounds.
///
/// Then [`certify_region`] and [`certify_gain`] prove region and bound for A - L C itself, each with a P of its own.
/// Conflicts name the requirements "decay", "disc", "sector" ("stability" when no region is given) and "gain".
///
/// Source: M. Chilali and P. Gahinet (1996, see [`certify_region`]), section IV, for the dual problem of state
/// feedback; M. Chilali, P. Gahinet, P. Apkarian, Robust pole placement in LMI regions, IEEE Trans. Autom. Control 44
/// (1999).
///
/// # Example
///
/// A constant force on a mass, estimated from its position, with all eigenvalues in a disc:
///
/// ```
/// use control::Domain;
/// use control::lmi::{Disc, Region, observer_gain};
/// use nalgebra::DMatrix;
/// let a_0 = DMatrix::from_row_slice(3, 3, &[0., 1., 0., 0., 0., 1., 0., 0., 0.]);
/// let c_0 = DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 0.0]);
/// let disc = Some(Disc { center: -20.0, radius: 5.0 });
/// let region = Region { disc, ..Region::default() };
/// let observer = observer_gain(&a_0, &c_0, &region, None, Domain::Continuous)?.optimal().unwrap();
/// let error_dynamics = a_0 - observer.gain * c_0;
/// for value in control::eigen::eigenvalues(&error_dynamics)? {
///     assert!((value + 20.0).norm() < 5.0);
/// }
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`]
/// for a bad region or bound; [`Error::NotConverged`].
pub fn observer_gain(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    region: &Region,
    performance: Option<&Performance>,
    domain: Domain,
) -> Result<Outcome<Synthesis>, Error> {
    let n = check::with_outputs(a, c)?;
    region.check(domain)?;
    if let Some(performance) = performance {
        performance.check(n, (c.nrows(), performance.disturbance.ncols()))?;
    }
    let requirements =
        ObserverRequirements { a, c, region: *region, performance, domain, weighted: None };
    requirements.search(|candidate| {
        let dynamics = a - &candidate.gain * c;
        let bound = performance.map(|performance| Bound {
            performance,
            input: &performance.disturbance - &candidate.gain * &performance.feedthrough,
            output: performance.output.clone(),
        });
        prove(candidate, &dynamics, region, bound, domain)
    })
}

/// Computes a state feedback u = K x that places the eigenvalues of A + B K in a region and bounds the norm from w to
/// z.
///
/// ```text
/// x' = (A + B K) x + B_1 w, z = (C_1 + D_12 K) x
/// ```
///
/// `a`: n x n; `b`: n x m; `performance`: `B_1` = `disturbance`, `C_1` = `output`, `D_12` =
/// `feedthrough`. K = -L' with L the [`observer_gain`] for A' and B' from `C_1`', `D_12`' to
/// `B_1`': transposing a system changes neither eigenvalues nor the H-infinity norm, and exchanges
/// energy to peak with impulse to energy. The certificates are for A + B K itself. Existence,
/// method and names of the requirements: same as [`observer_gain`].
///
/// # Errors
///
/// Same as [`observer_gain`].
pub fn state_feedback(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    region: &Region,
    performance: Option<&Performance>,
    domain: Domain,
) -> Result<Outcome<Synthesis>, Error> {
    let n = check::with_inputs(a, b)?;
    region.check(domain)?;
    if let Some(performance) = performance {
        performance.check(n, (performance.output.nrows(), b.ncols()))?;
    }
    let dual = performance.map(Performance::transposed);
    let requirements = ObserverRequirements {
        a: &a.transpose(),
        c: &b.transpose(),
        region: *region,
        performance: dual.as_ref(),
        domain,
        weighted: None,
    };
    requirements.search(|candidate| {
        let candidate = candidate.transposed();
        let dynamics = a + b * &candidate.gain;
        let bound = performance.map(|performance| Bound {
            performance,
            input: performance.disturbance.clone(),
            output: &performance.output + &performance.feedthrough * &candidate.gain,
        });
        prove(candidate, &dynamics, region, bound, domain)
    })
}

/// The bound of `performance` to prove for the closed loop with B = `input`, n x k, and C = `output`, r x n.
pub(super) struct Bound<'a> {
    performance: &'a Performance,
    input: DMatrix<f64>,
    output: DMatrix<f64>,
}

/// Proves region and bound for the closed loop with a candidate gain.
///
/// Each certificate is computed in the coordinates of the candidate and, if that fails, in coordinates that suit the
/// closed-loop dynamics.
pub(super) fn prove(
    candidate: Candidate,
    dynamics: &DMatrix<f64>,
    region: &Region,
    bound: Option<Bound<'_>>,
    domain: Domain,
) -> Result<Outcome<Synthesis>, Error> {
    let Candidate { gain, coordinates } = candidate;
    let outcome = region::certify_in(&coordinates, from_ref(dynamics), region, domain)?;
    let certificate = match outcome.optimal() {
        None => certify_region(dynamics, region, domain)?.optimal(),
        certificate => certificate,
    };
    let Some(region) = certificate else { return Ok(Outcome::Inconclusive(NOT_PROVEN)) };
    let Some(Bound { performance: &Performance { norm, gamma, .. }, input, output }) = bound else {
        return Ok(Outcome::Optimal(Synthesis { gain, region, bound: None }));
    };
    let system = StateSpace::strictly_proper(dynamics.clone(), input, output, domain);
    let is_met = |bound: &GainBound| bound.gamma <= gamma.unwrap_or(f64::INFINITY);
    let bound = match gain::certify_in(coordinates, &system, norm)?.optimal().filter(is_met) {
        None => certify_gain(&system, norm)?.optimal().filter(is_met),
        bound => bound,
    };
    Ok(match bound {
        None => Outcome::Inconclusive(NOT_PROVEN),
        bound => Outcome::Optimal(Synthesis { gain, region, bound }),
    })
}
