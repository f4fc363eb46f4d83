//! Gains from inequalities.

use super::gain::{Channel, GainBound, Norm, certify_gain};
use super::region::{Region, RegionCertificate, certify_region};
use super::search::{Found, Wanted};
use super::{Outcome, gain, region};
use crate::domain::Domain;
use crate::{Error, check};
use nalgebra::DMatrix;

const NOT_PROVEN: &str = "the gain that was found does not prove to keep the requirements";

/// What is wanted of the gain from a disturbance w to an output z.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    /// n x k: how w drives the states.
    pub disturbance: DMatrix<f64>,
    /// r x n: z as a function of the states.
    pub output: DMatrix<f64>,
    /// For an observer p x k, how w enters the measurement; for a state feedback r x m, how the
    /// command enters z.
    pub feed: DMatrix<f64>,
    /// The norm.
    pub norm: Norm,
    /// The bound to keep; None: nearly the smallest one.
    pub gamma: Option<f64>,
}

/// A gain and the proofs of what it does.
#[derive(Debug, Clone, PartialEq)]
pub struct Synthesis {
    /// The gain.
    pub gain: DMatrix<f64>,
    /// Eigenvalues in the region.
    pub region: RegionCertificate,
    /// The bound that the gain keeps, if one was wanted; not above the bound that was given.
    pub bound: Option<GainBound>,
}

/// An observer gain L: the eigenvalues of A - L C in a region, the gain from w to z bounded.
///
/// ```text
/// error dynamics x' = (A - L C) x + (B - L D_y) w, z = E x;  Z = P L
/// inequalities of certify_region and certify_gain with P (A - L C) = P A - Z C and
/// P (B - L D_y) = P B - Z D_y, one P for all of them
/// ```
///
/// `a`: n x n; `c`: p x n; `performance`: B = `disturbance`, E = `output`, `D_y` = `feed`. For the
/// augmented observer: (`A_0`, `C_0`), B = [0; -I] from the fault rate to the error [e; eps], or
/// `-F_0` from the fault to [e; `f_hat`].
///
/// Regions alone: L exists if all states are seen and the parts of the region have real numbers
/// in common. P >= I and Z within twice the smallest norm possible are taken as far inside of all
/// inequalities as can be. With a performance one P for all inequalities is sufficient, not
/// necessary; the smallest bound is sought and then kept within 5 %, as far inside as can be, because
/// at the smallest bound itself gains often grow without limit. Where faster is always better, that is
/// without disturbance on the measurement, give a disc.
///
/// Coordinates: all states are seen equally well at the speed that the region wants; if no gain is
/// found, three times those in which the nearest P becomes the identity. With a performance P and Z
/// stay below 1e6 there, and a conflict with "gain" means: not within that.
///
/// What is found is L; its region and its bound are then proven for A - L C as it is, by
/// [`certify_region`] and [`certify_gain`], each with its own P. Requirements are named "decay",
/// "disc", "sector" ("stability" when no region is given) and "gain".
///
/// Source: M. Chilali and P. Gahinet (1996), section IV; M. Chilali, P. Gahinet, P. Apkarian, Robust
/// pole placement in LMI regions, IEEE Trans. Autom. Control 44 (1999).
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
/// let found = observer_gain(&a_0, &c_0, &region, None, Domain::Continuous)?.optimal().unwrap();
/// let error_dynamics = a_0 - found.gain * c_0;
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
    let n = check::square("A", a)?;
    check::shape("C", c, (c.nrows(), n))?;
    region.check(domain)?;
    if let Some(wanted) = performance {
        let k = wanted.disturbance.ncols();
        check::shape("disturbance", &wanted.disturbance, (n, k))?;
        check::shape("output", &wanted.output, (wanted.output.nrows(), n))?;
        check::shape("feed", &wanted.feed, (c.nrows(), k))?;
        check::positive("gamma", wanted.gamma.unwrap_or(1.0))?;
    }
    let wanted = Wanted { a, c, region: *region, performance, domain };
    wanted.search(|found| {
        let dynamics = a - &found.gain * c;
        let channel = performance.map(|wanted| Channel {
            a: dynamics.clone(),
            b: &wanted.disturbance - &found.gain * &wanted.feed,
            c: wanted.output.clone(),
            d: DMatrix::zeros(wanted.output.nrows(), wanted.disturbance.ncols()),
        });
        let wish = channel.zip(performance.map(|wanted| (wanted.norm, wanted.gamma)));
        prove(found, &dynamics, region, wish, domain)
    })
}

/// A state feedback K, u = K x: the eigenvalues of A + B K in a region, the gain from w to z bounded.
///
/// ```text
/// x' = (A + B K) x + B_1 w, z = (C_1 + D_12 K) x
/// ```
///
/// `a`: n x n; `b`: n x m; `performance`: `B_1` = `disturbance`, `C_1` = `output`, `D_12` = `feed`.
/// K = -L' with L the [`observer_gain`] for A' and B' from `C_1`', `D_12`' to `B_1`': transposing a
/// system changes neither eigenvalues nor the H-infinity norm and turns energy to peak into
/// impulse to energy. The certificates are for A + B K itself. All else as there.
///
/// # Errors
///
/// Those of [`observer_gain`].
pub fn state_feedback(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    region: &Region,
    performance: Option<&Performance>,
    domain: Domain,
) -> Result<Outcome<Synthesis>, Error> {
    let n = check::square("A", a)?;
    check::shape("B", b, (n, b.ncols()))?;
    region.check(domain)?;
    if let Some(wanted) = performance {
        let r = wanted.output.nrows();
        check::shape("disturbance", &wanted.disturbance, (n, wanted.disturbance.ncols()))?;
        check::shape("output", &wanted.output, (r, n))?;
        check::shape("feed", &wanted.feed, (r, b.ncols()))?;
        check::positive("gamma", wanted.gamma.unwrap_or(1.0))?;
    }
    let turned = performance.map(|wanted| Performance {
        disturbance: wanted.output.transpose(),
        output: wanted.disturbance.transpose(),
        feed: wanted.feed.transpose(),
        norm: match wanted.norm {
            Norm::HInfinity => Norm::HInfinity,
            Norm::EnergyToPeak => Norm::ImpulseToEnergy,
            Norm::ImpulseToEnergy => Norm::EnergyToPeak,
        },
        gamma: wanted.gamma,
    });
    let (a_turned, b_turned) = (a.transpose(), b.transpose());
    let wanted = Wanted {
        a: &a_turned,
        c: &b_turned,
        region: *region,
        performance: turned.as_ref(),
        domain,
    };
    wanted.search(|found| {
        let gain = -found.gain.transpose();
        let dynamics = a + b * &gain;
        let channel = performance.map(|wanted| Channel {
            a: dynamics.clone(),
            b: wanted.disturbance.clone(),
            c: &wanted.output + &wanted.feed * &gain,
            d: DMatrix::zeros(wanted.output.nrows(), wanted.disturbance.ncols()),
        });
        let wish = channel.zip(performance.map(|wanted| (wanted.norm, wanted.gamma)));
        let found = Found { gain, coordinates: found.coordinates.transposed() };
        prove(found, &dynamics, region, wish, domain)
    })
}

/// The proofs for a gain that was found, in the coordinates of its search or in its own.
fn prove(
    found: Found,
    dynamics: &DMatrix<f64>,
    region: &Region,
    wish: Option<(Channel, (Norm, Option<f64>))>,
    domain: Domain,
) -> Result<Outcome<Synthesis>, Error> {
    let Found { gain, coordinates } = found;
    let certificate = match region::certify_in(&coordinates, dynamics, region, domain)?.optimal() {
        None => certify_region(dynamics, region, domain)?.optimal(),
        certificate => certificate,
    };
    let Some(region) = certificate else { return Ok(Outcome::Trouble(NOT_PROVEN)) };
    let Some((channel, (norm, gamma))) = wish else {
        return Ok(Outcome::Optimal(Synthesis { gain, region, bound: None }));
    };
    let kept = |bound: &GainBound| bound.gamma <= gamma.unwrap_or(f64::INFINITY);
    let own = gain::certify_in(coordinates, &channel, norm, domain)?.optimal().filter(kept);
    let bound = match own {
        None => certify_gain(&channel, norm, domain)?.optimal().filter(kept),
        bound => bound,
    };
    Ok(match bound {
        None => Outcome::Trouble(NOT_PROVEN),
        bound => Outcome::Optimal(Synthesis { gain, region, bound }),
    })
}
