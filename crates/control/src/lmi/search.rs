//! The search for an observer gain in the solver's coordinates.

use super::affine::Affine;
use super::coordinates::{Coordinates, mean_eigenvalue};
use super::gain::{Levels, Norm, Terms};
use super::region::{Disc, MARGIN, Region};
use super::synthesis::{Performance, Synthesis};
use super::{Outcome, Problem, Solution};
use crate::Error;
use crate::balance::{divide_columns, divide_rows, power_of_two};
use crate::domain::Domain;
use crate::eigen::eigenvalues;
use crate::rank::observability;
use nalgebra::{Complex, DMatrix, DVector};

/// The bound for which a gain is designed, relative to the smallest one.
const RELAXED_BOUND: f64 = 1.05;
/// The norm of P L within which a gain is designed, relative to the smallest one.
const RELAXED_GAIN: f64 = 2.0;
/// How often the coordinates are improved before an answer other than a gain is given.
const REFINEMENTS: usize = 3;
/// P and P L stay below this in the solver's coordinates when only a bound is wanted.
const LARGEST: f64 = 1e6;

const OUT_OF_RANGE: &str = "a gain exists, but not one that double precision shows";
const NOT_FOUND: &str = "P is not positive definite in double precision";

/// A gain and coordinates in which its certificate is about the identity.
pub(super) struct Found {
    pub(super) gain: DMatrix<f64>,
    pub(super) coordinates: Coordinates,
}

/// What is asked for, in the form of an observer.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) a: &'a DMatrix<f64>,
    pub(super) c: &'a DMatrix<f64>,
    pub(super) region: Region,
    pub(super) performance: Option<&'a Performance>,
    pub(super) domain: Domain,
}

impl Wanted<'_> {
    /// Looks for L in one set of coordinates after the other, each such that the P nearest to a
    /// solution in the one before becomes the identity, until a gain passes `proof`.
    pub(super) fn search(
        self,
        proof: impl Fn(Found) -> Result<Outcome<Synthesis>, Error>,
    ) -> Result<Outcome<Synthesis>, Error> {
        let (speed, unit) = speed(self.a, &self.region, self.domain)?;
        let first = Coordinates::of_observation(self.a, self.c, speed, unit)?;
        let mut design = Design::new(self, first);
        for _ in 0..REFINEMENTS {
            let found = design.gain()?.then(&proof)?;
            if matches!(found, Outcome::Optimal(_)) {
                return Ok(found);
            }
            let Some(refined) = design.refined() else { return self.judged(found) };
            design = Design::new(self, refined);
        }
        let found = design.gain()?.then(proof)?;
        self.judged(found)
    }

    /// No conflict of regions that have real numbers in common when all states are seen.
    fn judged(self, found: Outcome<Synthesis>) -> Result<Outcome<Synthesis>, Error> {
        let Outcome::Infeasible { conflict } = &found else { return Ok(found) };
        let of_regions = !conflict.contains(&"gain");
        if of_regions
            && self.region.has_real_numbers(self.domain)
            && observability(self.a, self.c)?.is_full()
        {
            return Ok(Outcome::Trouble(OUT_OF_RANGE));
        }
        Ok(found)
    }
}

/// The search for L in the solver's coordinates.
struct Design<'a> {
    wanted: Wanted<'a>,
    coordinates: Coordinates,
    /// Sizes of the rows of C in the coordinates.
    rows: DVector<f64>,
}

impl<'a> Design<'a> {
    fn new(wanted: Wanted<'a>, coordinates: Coordinates) -> Self {
        let seen = coordinates.output(wanted.c);
        let rows = DVector::from_fn(wanted.c.nrows(), |row, _| {
            let norm = seen.row(row).norm();
            if norm > 0.0 { power_of_two(norm) } else { 1.0 }
        });
        Self { wanted, coordinates, rows }
    }

    /// Coordinates in which the P nearest to a solution is the identity.
    fn refined(&self) -> Option<Coordinates> {
        let (problem, [p, _], _) = self.problem(None);
        self.coordinates.refined(&p.at(&problem.middle()?))
    }

    /// L of the given coordinates: the smallest level first, then the middle of what is within
    /// reach of it.
    fn gain(&self) -> Result<Outcome<Found>, Error> {
        let given = self.wanted.performance.and_then(|wanted| Some((wanted, wanted.gamma?)));
        if let Some((wanted, gamma)) = given {
            return self.solve(self.levels(wanted).level(gamma));
        }
        let relaxed = match self.wanted.performance {
            None => RELAXED_GAIN,
            Some(wanted) if wanted.norm == Norm::HInfinity => RELAXED_BOUND,
            Some(_) => RELAXED_BOUND * RELAXED_BOUND,
        };
        let (problem, unknowns, _) = self.problem(None);
        if let Some((smallest, _)) = problem.smallest()
            && let Outcome::Optimal(gain) = self.solve(smallest * relaxed)?
        {
            return Ok(Outcome::Optimal(gain));
        }
        problem.solve()?.then(|solution| Ok(self.restored(&solution, &unknowns)))
    }

    fn levels(&self, wanted: &Performance) -> Levels {
        let b = self.coordinates.input(&wanted.disturbance);
        let e = self.coordinates.output(&wanted.output);
        Levels::of(wanted.norm, &b, &e, self.coordinates.unit)
    }

    fn solve(&self, level: f64) -> Result<Outcome<Found>, Error> {
        let (problem, unknowns, _) = self.problem(Some(level));
        problem.solve()?.then(|solution| Ok(self.restored(&solution, &unknowns)))
    }

    /// L = P^-1 Z in the given coordinates.
    fn restored(&self, solution: &Solution, [p, z]: &[Affine; 2]) -> Outcome<Found> {
        let (p, z) = (solution.value(p), solution.value(z));
        let parts = p.clone().cholesky().zip(self.coordinates.refined(&p));
        let Some((factor, coordinates)) = parts else { return Outcome::Trouble(NOT_FOUND) };
        let scaled = divide_columns(&factor.solve(&z), &self.rows);
        Outcome::Optimal(Found { gain: self.coordinates.gain(&scaled), coordinates })
    }

    /// The problem, its P and Z, and the level: given, or to be minimised.
    fn problem(&self, level: Option<f64>) -> (Problem, [Affine; 2], Affine) {
        let (n, outputs) = (self.wanted.a.nrows(), self.wanted.c.nrows());
        let unit = self.coordinates.unit;
        let c = divide_rows(&self.coordinates.output(self.wanted.c), &self.rows);
        let mut problem = Problem::new();
        let (p, z) = (problem.symmetric(n), problem.rectangular(n, outputs));
        let dynamics = &(&p * &self.coordinates.dynamics(self.wanted.a)) - &(&z * &c);
        for (name, matrix) in
            self.wanted.region.requirements(&p, &dynamics, self.wanted.domain, unit)
        {
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
        let Some(wanted) = self.wanted.performance else {
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
        for matrix in terms.requirements(wanted.norm, self.wanted.domain) {
            problem.require("gain", &matrix, MARGIN);
        }
        (problem, [p, z], value)
    }
}

/// How far the eigenvalues have to be moved, at least how far they lie apart, and the unit of time.
fn speed(a: &DMatrix<f64>, region: &Region, domain: Domain) -> Result<(f64, f64), Error> {
    let center = mean_eigenvalue(a);
    let distance = |value: &Complex<f64>| (value - Complex::new(center, 0.0)).norm();
    let apart = eigenvalues(a)?.iter().map(distance).fold(0.0, f64::max);
    let decayed = |alpha: f64| match domain {
        Domain::Continuous => -alpha,
        Domain::Sampled { period } => (-alpha * period).exp(),
    };
    let disc = region.disc.map(|Disc { center, .. }| center);
    let wanted = disc.or(region.decay.map(decayed)).unwrap_or(center);
    let speed = apart.max((wanted - center).abs());
    let speed = if speed > 0.0 { power_of_two(speed) } else { 1.0 };
    let unit = if domain == Domain::Continuous { speed } else { 1.0 };
    Ok((speed, unit))
}
