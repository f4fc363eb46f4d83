//! Gains from inequalities.

use super::affine::Affine;
use super::coordinates::Coordinates;
use super::gain::{Channel, GainBound, Levels, Norm, Terms, certify_gain};
use super::region::{Disc, MARGIN, Region, RegionCertificate, certify_region};
use super::{Outcome, Problem};
use crate::balance::{divide_columns, divide_rows, power_of_two};
use crate::domain::Domain;
use crate::eigen::eigenvalues;
use crate::{Error, check};
use nalgebra::{DMatrix, DVector};

/// The bound for which a gain is designed, relative to the smallest one.
const RELAXED_BOUND: f64 = 1.05;
/// The norm of P L within which a gain is designed, relative to the smallest one.
const RELAXED_GAIN: f64 = 2.0;
/// P and P L stay below this in the solver's coordinates when only a bound is wanted.
const LARGEST: f64 = 1e6;

const NOT_FOUND: &str = "the smallest bound is not found";
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
/// Without a performance, and for a given bound, L exists if the region can be reached; with one P
/// for all parts this is sufficient, for one part alone also necessary. Of all solutions the one
/// with the smallest norm of Z (P >= I) is taken, in coordinates in which all states are seen equally
/// well at the speed that the region wants. With a performance the smallest bound is sought and
/// then kept within 5 %, as far inside of all inequalities as possible: at the smallest bound itself
/// gains often grow without limit. Where faster is always better, that is without disturbance
/// on the measurement, give a disc.
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
    let design = Design::new(a, c, *region, performance, domain)?;
    design.gain()?.then(|gain| design.proven(gain))
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
    let design = Design::new(&a_turned, &b_turned, *region, turned.as_ref(), domain)?;
    design.gain()?.then(|l| {
        let gain = -l.transpose();
        let dynamics = a + b * &gain;
        let channel = performance.map(|wanted| Channel {
            a: dynamics.clone(),
            b: wanted.disturbance.clone(),
            c: &wanted.output + &wanted.feed * &gain,
            d: DMatrix::zeros(wanted.output.nrows(), wanted.disturbance.ncols()),
        });
        let wish = channel.zip(performance.map(|wanted| (wanted.norm, wanted.gamma)));
        prove(gain, &dynamics, region, wish, domain)
    })
}

/// The search for L in the solver's coordinates.
struct Design<'a> {
    a: &'a DMatrix<f64>,
    c: &'a DMatrix<f64>,
    region: Region,
    performance: Option<&'a Performance>,
    domain: Domain,
    coordinates: Coordinates,
    /// Sizes of the rows of C in the coordinates.
    rows: DVector<f64>,
}

impl<'a> Design<'a> {
    fn new(
        a: &'a DMatrix<f64>,
        c: &'a DMatrix<f64>,
        region: Region,
        performance: Option<&'a Performance>,
        domain: Domain,
    ) -> Result<Self, Error> {
        let coordinates = Coordinates::of_observation(a, c, speed(a, &region, domain)?)?;
        let seen = coordinates.output(c);
        let rows = DVector::from_fn(c.nrows(), |row, _| {
            let norm = seen.row(row).norm();
            if norm > 0.0 { power_of_two(norm) } else { 1.0 }
        });
        Ok(Self { a, c, region, performance, domain, coordinates, rows })
    }

    /// L of the given coordinates: the smallest level first, then the middle of what is within
    /// reach of it.
    fn gain(&self) -> Result<Outcome<DMatrix<f64>>, Error> {
        let given = self.performance.and_then(|wanted| Some((wanted, wanted.gamma?)));
        if let Some((wanted, gamma)) = given {
            return self.solve(self.levels(wanted).level(gamma));
        }
        let relaxed = match self.performance {
            None => RELAXED_GAIN,
            Some(wanted) if wanted.norm == Norm::HInfinity => RELAXED_BOUND,
            Some(_) => RELAXED_BOUND * RELAXED_BOUND,
        };
        let (problem, ..) = self.problem(None);
        match problem.smallest() {
            Some((smallest, _)) => self.solve(smallest * relaxed),
            None => problem.solve()?.then(|_| Ok(Outcome::Trouble(NOT_FOUND))),
        }
    }

    fn levels(&self, wanted: &Performance) -> Levels {
        let b = self.coordinates.input(&wanted.disturbance);
        let e = self.coordinates.output(&wanted.output);
        Levels::of(wanted.norm, &b, &e, self.coordinates.unit)
    }

    fn solve(&self, level: f64) -> Result<Outcome<DMatrix<f64>>, Error> {
        let (problem, [p, z], _) = self.problem(Some(level));
        problem.solve()?.then(|solution| {
            let (p, z) = (solution.value(&p), solution.value(&z));
            let Some(factor) = p.cholesky() else {
                return Ok(Outcome::Trouble("P is not positive definite in double precision"));
            };
            let scaled = divide_columns(&factor.solve(&z), &self.rows);
            Ok(Outcome::Optimal(self.coordinates.gain(&scaled)))
        })
    }

    /// The problem, its P and Z, and the level: given, or to be minimised.
    fn problem(&self, level: Option<f64>) -> (Problem, [Affine; 2], Affine) {
        let (n, outputs) = (self.a.nrows(), self.c.nrows());
        let unit = self.coordinates.unit;
        let c = divide_rows(&self.coordinates.output(self.c), &self.rows);
        let mut problem = Problem::new();
        let (p, z) = (problem.symmetric(n), problem.rectangular(n, outputs));
        let dynamics = &(&p * &self.coordinates.dynamics(self.a)) - &(&z * &c);
        for (name, matrix) in self.region.requirements(&p, &dynamics, self.domain, unit) {
            problem.require(name, &matrix, MARGIN);
        }
        let size = |bound: &Affine| {
            let square = |order: usize| bound.times(&DMatrix::identity(order, order));
            Affine::blocks(&[&[&square(n), &z], &[&z.transpose(), &square(outputs)]])
        };
        let value = level.map_or_else(|| problem.scalar(), |value| Affine::identity(1, value));
        if level.is_none() {
            problem.minimise(&value);
        }
        let Some(wanted) = self.performance else {
            problem.always(&p, 1.0);
            problem.always(&size(&value), MARGIN);
            return (problem, [p, z], value);
        };
        let largest = Affine::identity(1, LARGEST);
        problem.always(&p, MARGIN);
        problem.always(&(&Affine::identity(n, LARGEST) - &p), MARGIN);
        problem.always(&size(&largest), MARGIN);
        let levels = self.levels(wanted);
        let feed = divide_rows(&wanted.feed, &self.rows);
        let (b, e, _) = levels.scale(
            &self.coordinates.input(&wanted.disturbance),
            &self.coordinates.output(&wanted.output),
            &wanted.feed,
        );
        let input = &(&p * &b) - &(&z * &(feed / levels.disturbance()));
        let feed = Affine::zeros(e.nrows(), b.ncols());
        let output = Affine::constant(&e);
        let terms = Terms { p: p.clone(), dynamics, input, output, feed, level: value.clone() };
        for matrix in terms.requirements(wanted.norm, self.domain) {
            problem.require("gain", &matrix, MARGIN);
        }
        (problem, [p, z], value)
    }

    fn proven(&self, gain: DMatrix<f64>) -> Result<Outcome<Synthesis>, Error> {
        let dynamics = self.a - &gain * self.c;
        let wish = self.performance.map(|wanted| {
            let b = &wanted.disturbance - &gain * &wanted.feed;
            let d = DMatrix::zeros(wanted.output.nrows(), b.ncols());
            let channel = Channel { a: dynamics.clone(), b, c: wanted.output.clone(), d };
            (channel, (wanted.norm, wanted.gamma))
        });
        prove(gain, &dynamics, &self.region, wish, self.domain)
    }
}

/// Radius of the part of the plane that matters: of the region, or of the eigenvalues of A.
fn speed(a: &DMatrix<f64>, region: &Region, domain: Domain) -> Result<f64, Error> {
    if domain != Domain::Continuous {
        return Ok(1.0);
    }
    let own = eigenvalues(a)?.iter().fold(0.0_f64, |size, value| size.max(value.norm()));
    let disc = region.disc.map_or(0.0, |Disc { center, .. }| center.abs());
    let wanted = region.decay.unwrap_or(0.0).max(disc);
    let speed = if wanted > 0.0 { wanted } else { own };
    Ok(if speed > 0.0 { power_of_two(speed) } else { 1.0 })
}

/// The proofs for a gain that was found.
fn prove(
    gain: DMatrix<f64>,
    dynamics: &DMatrix<f64>,
    region: &Region,
    wish: Option<(Channel, (Norm, Option<f64>))>,
    domain: Domain,
) -> Result<Outcome<Synthesis>, Error> {
    let Some(region) = certify_region(dynamics, region, domain)?.optimal() else {
        return Ok(Outcome::Trouble(NOT_PROVEN));
    };
    let Some((channel, (norm, gamma))) = wish else {
        return Ok(Outcome::Optimal(Synthesis { gain, region, bound: None }));
    };
    match certify_gain(&channel, norm, domain)?.optimal() {
        Some(bound) if bound.gamma <= gamma.unwrap_or(f64::INFINITY) => {
            Ok(Outcome::Optimal(Synthesis { gain, region, bound: Some(bound) }))
        }
        _ => Ok(Outcome::Trouble(NOT_PROVEN)),
    }
}
