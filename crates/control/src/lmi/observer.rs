//! The semidefinite program for an observer gain, and the coordinates in which it is solved.
//!
//! The inequalities of [`super::observer_gain`] contain the product P L of two unknowns; they are linear in P and
//! Z = P L.

use super::affine::Affine;
use super::coordinates::{Coordinates, row_units, unit_near};
use super::gain::{GainInequality, GainScaling, Norm};
use super::region::{MARGIN, Region};
use super::requirement::{Performance, Synthesis};
use super::{Outcome, Problem};
use crate::balance::{divide_columns, divide_rows};
use crate::rank::observability;
use crate::{Domain, Error};
use nalgebra::{DMatrix, DVector};

/// The bound for which a gain is designed, relative to the smallest bound.
const RELAXED_BOUND: f64 = 1.05;
/// The bound of norm(P L) for which a gain is designed, relative to the smallest bound.
pub(super) const RELAXED_GAIN: f64 = 2.0;
/// Largest number of refinements of the coordinates before a search ends without an answer.
pub(super) const REFINEMENTS: usize = 3;
/// Bound of P and of norm(P L) in the solver's coordinates when a performance is required.
const LARGEST: f64 = 1e6;

const OUT_OF_RANGE: &str = "a gain exists, but none could be proven in double precision";

/// A gain that the solver found but that is not proven yet, and coordinates in which the P of the solver is the
/// identity.
pub(super) struct Candidate {
    pub(super) gain: DMatrix<f64>,
    pub(super) coordinates: Coordinates,
}

impl Candidate {
    /// The candidate of the transposed system, K = -L'.
    pub(super) fn transposed(&self) -> Self {
        Self { gain: -self.gain.transpose(), coordinates: self.coordinates.transposed() }
    }
}

/// The requirements on an observer gain L: eigenvalues of A - L C in `region`, and the norm of the
/// system {A - L C, B - L `D_y`, E, 0} of `performance`.
#[derive(Clone, Copy)]
pub(super) struct ObserverRequirements<'a> {
    /// A of the plant, n x n.
    pub(super) a: &'a DMatrix<f64>,
    /// C of the plant, p x n.
    pub(super) c: &'a DMatrix<f64>,
    pub(super) region: Region,
    pub(super) performance: Option<&'a Performance>,
    pub(super) domain: Domain,
    /// The error dynamics for the norm, if it has weights with states.
    pub(super) weighted: Option<WeightedDynamics<'a>>,
}

/// Error dynamics with m states of weights after the n states of A; the gain acts on the n states. P of
/// the norm is block diagonal.
#[derive(Clone, Copy)]
pub(super) struct WeightedDynamics<'a> {
    /// A of plant and weights, (n + m) x (n + m).
    pub(super) a: &'a DMatrix<f64>,
    /// C of plant and weights, p x (n + m).
    pub(super) c: &'a DMatrix<f64>,
    /// Number of states of the weights of the disturbance, the first of the m states.
    pub(super) disturbance_states: usize,
}

impl ObserverRequirements<'_> {
    /// Searches for a gain that passes `proof`; returns the outcome of the last attempt if there is none.
    ///
    /// The program is solved in [`Coordinates::of_observation`] first, then up to three times in
    /// coordinates in which the most interior P of the program before becomes the identity.
    pub(super) fn search(
        self,
        proof: impl Fn(Candidate) -> Result<Outcome<Synthesis>, Error>,
    ) -> Result<Outcome<Synthesis>, Error> {
        let mut coordinates =
            Coordinates::of_observation(self.a, self.c, &self.region, self.domain)?;
        let mut refinements = 0;
        loop {
            let program = ObserverProgram::new(self, coordinates);
            let outcome = program.candidate()?.then(&proof)?;
            if matches!(outcome, Outcome::Optimal(_)) {
                return Ok(outcome);
            }
            let refined = (refinements < REFINEMENTS).then(|| {
                let Program { problem, p, .. } = program.program(None);
                program.coordinates.refined_by(&problem, &p)
            });
            let Some(refined) = refined.flatten() else { return self.check_conflict(outcome) };
            coordinates = refined;
            refinements += 1;
        }
    }

    /// Replaces an impossible conflict between parts of the region by [`Outcome::Inconclusive`]: if all
    /// states are observable and the parts have a real interval in common, all eigenvalues can be
    /// assigned there. Returns any other outcome unchanged.
    fn check_conflict(self, outcome: Outcome<Synthesis>) -> Result<Outcome<Synthesis>, Error> {
        if let Outcome::Infeasible { conflict } = &outcome
            && !conflict.contains(&"gain")
            && self.region.has_real_numbers(self.domain)
            && observability(self.a, self.c)?.is_full()
        {
            return Ok(Outcome::Inconclusive(OUT_OF_RANGE));
        }
        Ok(outcome)
    }
}

/// The semidefinite program for L in given coordinates.
struct ObserverProgram<'a> {
    requirements: ObserverRequirements<'a>,
    coordinates: Coordinates,
    /// The coordinates of plant states and weight states together; None without weights.
    extended: Option<Coordinates>,
    /// Units of the measurements: powers of two near the lengths of the rows of C in the coordinates.
    units: DVector<f64>,
}

/// A semidefinite program and its unknowns P (n x n) and Z (n x p).
pub(super) struct Program {
    pub(super) problem: Problem,
    pub(super) p: Affine,
    pub(super) z: Affine,
}

impl Program {
    /// Requires that the norm of Z is at most `level`; for None minimises this norm.
    pub(super) fn with_norm(mut self, level: Option<f64>) -> Self {
        let level = self.problem.level(level);
        self.problem.constrain(&norm_below(&self.z, &level), MARGIN);
        self
    }

    /// Solves the program, which is in `coordinates` with measurements in `units`; returns L = P^-1 Z in the units of
    /// the data.
    pub(super) fn solve(
        &self,
        coordinates: &Coordinates,
        units: &DVector<f64>,
    ) -> Result<Outcome<Candidate>, Error> {
        self.problem.solve()?.then(|solution| {
            let (p, z) = (solution.value(&self.p), solution.value(&self.z));
            let parts = p.clone().cholesky().zip(coordinates.refined(&p));
            let Some((factor, refined)) = parts else {
                return Ok(Outcome::Inconclusive("P is not positive definite in double precision"));
            };
            let gain = coordinates.gain(&divide_columns(&factor.solve(&z), units));
            Ok(Outcome::Optimal(Candidate { gain, coordinates: refined }))
        })
    }
}

impl<'a> ObserverProgram<'a> {
    fn new(requirements: ObserverRequirements<'a>, coordinates: Coordinates) -> Self {
        let units = row_units(&coordinates.output(requirements.c));
        let extended = requirements.weighted.zip(requirements.performance);
        let extended = extended.map(|(weighted, performance)| {
            let WeightedDynamics { a, disturbance_states, .. } = weighted;
            let order = coordinates.order();
            let output = performance.output.columns(0, order).into_owned();
            let size = unit_near(coordinates.output(&output).norm());
            coordinates.extended(&DVector::from_fn(a.nrows() - order, |at, _| {
                if at < disturbance_states { 1.0 } else { size }
            }))
        });
        Self { requirements, coordinates, extended, units }
    }

    /// The coordinates of the inequalities of the norm, including the states of the weights.
    fn norm_coordinates(&self) -> &Coordinates {
        self.extended.as_ref().unwrap_or(&self.coordinates)
    }

    /// Computes a gain that meets the given bound.
    ///
    /// Without a bound, the level t of [`Self::program`] is minimised, which bounds the norm, or without a performance
    /// the norm of Z. Then the gain with the largest margin of all inequalities is computed at a larger level; if that
    /// fails, the gain of the smallest level is returned.
    fn candidate(&self) -> Result<Outcome<Candidate>, Error> {
        let performance = self.requirements.performance;
        let solve = |program: &Program| program.solve(&self.coordinates, &self.units);
        if let Some(performance) = performance
            && let Some(gamma) = performance.gamma
        {
            return solve(&self.program(Some(self.scaling(performance).level(gamma))));
        }
        let relaxation = match performance {
            None => RELAXED_GAIN,
            Some(performance) if performance.norm == Norm::HInfinity => RELAXED_BOUND,
            Some(_) => RELAXED_BOUND * RELAXED_BOUND,
        };
        let program = self.program(None);
        if let Some((smallest, _)) = program.problem.minimum()
            && let Some(candidate) = solve(&self.program(Some(smallest * relaxation)))?.optimal()
        {
            return Ok(Outcome::Optimal(candidate));
        }
        solve(&program)
    }

    /// The program at a given level, or with the level minimised.
    ///
    /// ```text
    /// the inequalities of the region for P and P A - Z C
    /// without performance:  P >= I,  [t I, Z; Z', t I] >= 0
    /// with performance:     0 < P <= 1e6 I,  [1e6 I, Z; Z', 1e6 I] >= 0,
    ///                       the inequalities of the norm at level t
    /// ```
    fn program(&self, level: Option<f64>) -> Program {
        let ObserverRequirements { a, c, region, performance, domain, .. } = self.requirements;
        let (n, outputs) = (a.nrows(), c.nrows());
        let c = divide_rows(&self.coordinates.output(c), &self.units);
        let mut problem = Problem::new();
        let (p, z) = (problem.symmetric(n), problem.rectangular(n, outputs));
        let dynamics = &(&p * &self.coordinates.dynamics(a)) - &(&z * &c);
        for (name, matrix) in region.inequalities(&p, &dynamics, domain, self.coordinates.unit) {
            problem.require(name, &matrix, MARGIN);
        }
        let level = problem.level(level);
        if let Some(performance) = performance {
            problem.constrain(&p, MARGIN);
            problem.constrain(&(&Affine::identity(n, LARGEST) - &p), MARGIN);
            problem.constrain(&norm_below(&z, &Affine::identity(1, LARGEST)), MARGIN);
            let (p, z) = self.with_weights(&mut problem, &p, &z);
            for matrix in self.gain_inequalities(performance, p, &z, level) {
                problem.require("gain", &matrix, MARGIN);
            }
        } else {
            problem.constrain(&p, 1.0);
            problem.constrain(&norm_below(&z, &level), MARGIN);
        }
        Program { problem, p, z }
    }

    /// P and Z of the norm: with weights [P, 0; 0, `P_2`] and [Z; 0].
    fn with_weights(&self, problem: &mut Problem, p: &Affine, z: &Affine) -> (Affine, Affine) {
        let Some(WeightedDynamics { a, .. }) = self.requirements.weighted else {
            return (p.clone(), z.clone());
        };
        let (n, outputs) = z.shape();
        let more = a.nrows() - n;
        let p_2 = problem.symmetric(more);
        problem.constrain(&p_2, MARGIN);
        problem.constrain(&(&Affine::identity(more, LARGEST) - &p_2), MARGIN);
        let side = Affine::zeros(n, more);
        let p = Affine::blocks(&[&[p, &side], &[&side.transpose(), &p_2]]);
        (p, Affine::blocks(&[&[z], &[&Affine::zeros(more, outputs)]]))
    }

    /// The inequalities of the norm of {A - L C, B - L `D_y`, E, 0}.
    fn gain_inequalities(
        &self,
        performance: &Performance,
        p: Affine,
        z: &Affine,
        level: Affine,
    ) -> Vec<Affine> {
        let ObserverRequirements { a, c, weighted, domain, .. } = self.requirements;
        let (a, c) = weighted.map_or((a, c), |wide| (wide.a, wide.c));
        let c = divide_rows(&self.norm_coordinates().output(c), &self.units);
        let scaling = self.scaling(performance);
        let (b, e, _) = scaling.scale(
            &self.norm_coordinates().input(&performance.disturbance),
            &self.norm_coordinates().output(&performance.output),
            &performance.feedthrough,
        );
        let d_y = divide_rows(&performance.feedthrough, &self.units) / scaling.disturbance;
        let inequality = GainInequality {
            dynamics: &(&p * &self.norm_coordinates().dynamics(a)) - &(z * &c),
            input: &(&p * &b) - &(z * &d_y),
            p,
            output: Affine::constant(&e),
            feedthrough: Affine::zeros(e.nrows(), b.ncols()),
            level,
        };
        inequality.matrices(performance.norm, domain)
    }

    /// The units of disturbance and output.
    fn scaling(&self, performance: &Performance) -> GainScaling {
        let b = self.norm_coordinates().input(&performance.disturbance);
        let e = self.norm_coordinates().output(&performance.output);
        GainScaling::new(performance.norm, &b, &e, self.coordinates.unit)
    }
}

/// [t I, Z; Z', t I], which is positive semidefinite if and only if the norm of Z is at most t.
pub(crate) fn norm_below(z: &Affine, t: &Affine) -> Affine {
    let (rows, cols) = z.shape();
    let t_identity = |order: usize| t.times(&DMatrix::identity(order, order));
    Affine::blocks(&[&[&t_identity(rows), z], &[&z.transpose(), &t_identity(cols)]])
}
