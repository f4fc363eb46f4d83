//! Bounds of the norm of a system, with certificates.

use super::affine::Affine;
use super::coordinates::{Coordinates, time_unit, unit_near};
use super::definite::margin;
use super::region::MARGIN;
use super::{Outcome, Problem};
use crate::product::AccurateProduct;
use crate::stability::instability;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// Levels, relative to the smallest, that are tried in turn when the P of the smallest level cannot be verified.
const RELAXED_LEVELS: [f64; 4] = [1.0 + 1e-6, 1.0 + 1e-5, 1.0 + 1e-4, 1.0 + 1e-3];

/// For a level below `WEAK`, with B and C scaled to about one, the margin of the inequalities is not negligible: the
/// coordinates are refined, up to `REFINEMENTS` times.
const WEAK: f64 = 2e-3;
const REFINEMENTS: usize = 3;

const NO_P: &str = "no bound of the gain could be proven in double precision";

/// A norm of a system from w to z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Norm {
    /// H-infinity: root of the energy of the output over the root of the energy of the disturbance, the
    /// largest singular value of the transfer matrix over all frequencies.
    HInfinity,
    /// Generalised H2: peak of the Euclidean norm of the output over the root of the energy of the
    /// disturbance. In continuous time for D = 0 only.
    EnergyToPeak,
    /// Root of the energy of the output after an impulse over the size of the impulse:
    /// [`Norm::EnergyToPeak`] of the transposed system.
    ImpulseToEnergy,
}

/// A proven bound of a norm.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct GainBound {
    /// The bound, in the unit of the norm.
    pub gamma: f64,
    /// P, n x n, symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Smallest eigenvalue of all inequalities, each scaled to a diagonal of about one; larger than
    /// the rounding errors.
    pub margin: f64,
}

/// The matrices from which the inequalities of a gain bound are built.
pub(super) struct GainInequality {
    /// The matrix P of the Lyapunov function x' P x, n x n.
    pub(super) p: Affine,
    /// P A, n x n, for the dynamics A of the system.
    pub(super) dynamics: Affine,
    /// P B, n x k, for the input matrix B of the system.
    pub(super) input: Affine,
    /// The output matrix C, r x n.
    pub(super) output: Affine,
    /// The direct term D, r x k.
    pub(super) feedthrough: Affine,
    /// The bound in the inequalities: gamma for H-infinity, gamma^2 for the other norms.
    pub(super) level: Affine,
}

impl GainInequality {
    /// The matrices of [`certify_gain`], positive definite if the gain is below the bound.
    pub(super) fn matrices(&self, norm: Norm, domain: Domain) -> Vec<Affine> {
        let continuous = domain == Domain::Continuous;
        let (inputs, outputs) = (self.input.shape().1, self.output.shape().0);
        let level = |order: usize| self.level.times(&DMatrix::identity(order, order));
        let one = |order: usize| Affine::identity(order, 1.0);
        let zero = |cols: usize| Affine::zeros(self.p.shape().0, cols);
        let (output, feedthrough) = (self.output.transpose(), self.feedthrough.transpose());
        let Self { p, dynamics, input, .. } = self;
        let decay = || -&dynamics.plus_transpose();
        match (norm, continuous) {
            (Norm::HInfinity, true) => vec![upper(&[
                &[&decay(), &-input, &-&output],
                &[&level(inputs), &-&feedthrough],
                &[&level(outputs)],
            ])],
            (Norm::HInfinity, false) => vec![upper(&[
                &[p, dynamics, input, &zero(outputs)],
                &[p, &zero(inputs), &output],
                &[&level(inputs), &feedthrough],
                &[&level(outputs)],
            ])],
            (Norm::EnergyToPeak, true) => vec![
                upper(&[&[&decay(), &-input], &[&one(inputs)]]),
                upper(&[&[p, &output], &[&level(outputs)]]),
            ],
            (Norm::EnergyToPeak, false) => vec![
                upper(&[&[p, dynamics, input], &[p, &zero(inputs)], &[&one(inputs)]]),
                upper(&[
                    &[p, &zero(inputs), &output],
                    &[&one(inputs), &feedthrough],
                    &[&level(outputs)],
                ]),
            ],
            (Norm::ImpulseToEnergy, true) => vec![
                upper(&[&[&decay(), &output], &[&one(outputs)]]),
                upper(&[&[p, input], &[&level(inputs)]]),
            ],
            (Norm::ImpulseToEnergy, false) => vec![
                upper(&[&[p, dynamics, &zero(outputs)], &[p, &output], &[&one(outputs)]]),
                upper(&[
                    &[p, input, &zero(outputs)],
                    &[&level(inputs), &feedthrough],
                    &[&one(outputs)],
                ]),
            ],
        }
    }
}

/// The symmetric matrix with the given blocks on and above its diagonal, row by row from the diagonal on.
fn upper(rows: &[&[&Affine]]) -> Affine {
    let whole: Vec<Vec<Affine>> = (0..rows.len())
        .map(|row| {
            let before = (0..row).map(|col| rows[col][row - col].transpose());
            before.chain(rows[row].iter().map(|block| (*block).clone())).collect()
        })
        .collect();
    let references: Vec<Vec<&Affine>> = whole.iter().map(|row| row.iter().collect()).collect();
    let rows: Vec<&[&Affine]> = references.iter().map(Vec::as_slice).collect();
    Affine::blocks(&rows)
}

/// Units of disturbance, output and time for the solver, and the conversion of bounds and of P.
pub(super) struct GainScaling {
    norm: Norm,
    pub(super) disturbance: f64,
    output: f64,
    unit: f64,
}

impl GainScaling {
    /// The units for `norm`, from B and C in the solver's coordinates.
    pub(super) fn new(norm: Norm, b: &DMatrix<f64>, c: &DMatrix<f64>, unit: f64) -> Self {
        Self { norm, disturbance: unit_near(b.norm()), output: unit_near(c.norm()), unit }
    }

    /// The unit of the bound gamma.
    fn gain(&self) -> f64 {
        let time = if self.norm == Norm::HInfinity { 1.0 } else { self.unit.sqrt() };
        self.disturbance * self.output * time
    }

    /// The level of the inequalities for a bound gamma.
    pub(super) fn level(&self, gamma: f64) -> f64 {
        let scaled = gamma / self.gain();
        if self.norm == Norm::HInfinity { scaled } else { scaled * scaled }
    }

    /// The bound gamma for a level of the inequalities.
    fn gamma(&self, level: f64) -> f64 {
        self.gain() * if self.norm == Norm::HInfinity { level } else { level.sqrt() }
    }

    /// Factor that converts P from the units of the solver to the units of the data.
    fn certificate(&self) -> f64 {
        match self.norm {
            Norm::HInfinity => self.output / (self.disturbance * self.unit),
            Norm::EnergyToPeak => 1.0 / (self.disturbance * self.disturbance * self.unit),
            Norm::ImpulseToEnergy => self.output * self.output / self.unit,
        }
    }

    /// B, C and D in the units of the solver.
    pub(super) fn scale(
        &self,
        b: &DMatrix<f64>,
        c: &DMatrix<f64>,
        d: &DMatrix<f64>,
    ) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
        let (w, z) = (self.disturbance, self.output);
        (b / w, c / z, d / (w * z))
    }
}

/// Computes the smallest bound gamma of the norm of a system from w to z, with its certificate.
///
/// ```text
/// P > 0 and
/// H-infinity:        [A' P + P A, P B, C'; B' P, -gamma I, D'; C, D, -gamma I] < 0
/// energy to peak:    [A' P + P A, P B; B' P, -I] < 0,  [P, C'; C, gamma^2 I] > 0
/// impulse to energy: [A' P + P A, C'; C, -I] < 0,  [P, P B; B' P, gamma^2 I] > 0
/// and in sampled time
/// H-infinity:        [P, P A, P B, 0; *, P, 0, C'; *, *, gamma I, D'; *, *, *, gamma I] > 0
/// energy to peak:    [P, P A, P B; *, P, 0; *, *, I] > 0,
///                    [P, 0, C'; *, I, D'; *, *, gamma^2 I] > 0
/// impulse to energy: [P, P A, 0; *, P, C'; *, *, I] > 0,
///                    [P, P B, 0; *, gamma^2 I, D'; *, *, I] > 0
/// ```
///
/// The initial state is zero. The norm is finite if and only if the controllable and observable part of the system is
/// stable; here all of A must be stable, otherwise the outcome is [`Outcome::Infeasible`] with the conflict
/// "stability". The bound exceeds the norm by 1e-6 to 1e-3 of it. It is proven: the inequalities are verified for P and
/// gamma in the units of the data, with products in twice the precision.
///
/// Source: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear matrix inequalities in system
/// and control theory (1994), (2.25); M. A. Rotea, The generalized H2 control problem, Automatica
/// 29 (1993); C. Scherer, P. Gahinet, M. Chilali, Multiobjective output-feedback control via LMI
/// optimization, IEEE Trans. Autom. Control 42 (1997), section II.
///
/// # Example
///
/// The H-infinity norm of 2 / (s + 4) is 1/2, its energy-to-peak norm 2 / sqrt(8):
///
/// ```
/// use control::lmi::{Norm, certify_gain};
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let (a, b, c, d) = (one(-4.0), one(2.0), one(1.0), one(0.0));
/// let system = StateSpace { a, b, c, d, domain: Domain::Continuous };
/// let bound = |norm| certify_gain(&system, norm).map(|outcome| outcome.optimal());
/// let (first, second) = (bound(Norm::HInfinity)?.unwrap(), bound(Norm::EnergyToPeak)?.unwrap());
/// assert!(first.gamma > 0.5 && first.gamma < 0.5001);
/// assert!(second.gamma > 0.5_f64.sqrt() && second.gamma < 0.7072);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`]
/// for a D other than zero where the norm is infinite, and for a bad period; [`Error::NotConverged`].
pub fn certify_gain(system: &StateSpace, norm: Norm) -> Result<Outcome<GainBound>, Error> {
    system.check()?;
    let direct = system.d.amax();
    let is_finite = system.domain != Domain::Continuous || norm == Norm::HInfinity || direct <= 0.0;
    check::that(is_finite, "D", direct, "zero: the norm is infinite otherwise")?;
    if instability(&system.a, system.domain)? >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    match Coordinates::of_dynamics(&system.a)? {
        Some(coordinates) => certify_in(coordinates, system, norm),
        None => Ok(Outcome::Inconclusive(NO_P)),
    }
}

/// Same as [`certify_gain`], with the program solved in `coordinates`; if the level is below [`WEAK`], also in
/// coordinates in which P is the identity.
pub(super) fn certify_in(
    coordinates: Coordinates,
    system: &StateSpace,
    norm: Norm,
) -> Result<Outcome<GainBound>, Error> {
    let first = BoundProblem::new(coordinates, system, norm);
    let Some(minimum) = first.minimum() else {
        return Ok(Outcome::Inconclusive(NO_P));
    };
    let mut searches = vec![(first, minimum)];
    while let Some((search, (smallest, p))) = searches.last()
        && *smallest < WEAK
        && searches.len() <= REFINEMENTS
    {
        let Some(refined) = search.coordinates.refined(p) else { break };
        let next = BoundProblem::new(refined, system, norm);
        let Some((level, p)) = next.minimum() else { break };
        let is_smaller = next.scaling.gamma(level) < search.scaling.gamma(*smallest);
        if !is_smaller {
            break;
        }
        searches.push((next, (level, p)));
    }
    // Rounding errors may hide the proof in strongly stretched coordinates.
    for (search, (smallest, p)) in searches.iter().rev() {
        if let Some(bound) = search.verified(*smallest, p)? {
            return Ok(Outcome::Optimal(bound));
        }
        for relaxation in RELAXED_LEVELS {
            let (problem, p) = search.problem(Some(smallest * relaxation));
            if let Outcome::Optimal(solution) = problem.solve()?
                && let Some(bound) = search.verified(smallest * relaxation, &solution.value(&p))?
            {
                return Ok(Outcome::Optimal(bound));
            }
        }
    }
    Ok(Outcome::Inconclusive(NO_P))
}

/// The semidefinite program for P and the level, in the solver's coordinates.
struct BoundProblem<'a> {
    system: &'a StateSpace,
    norm: Norm,
    coordinates: Coordinates,
    scaling: GainScaling,
}

impl<'a> BoundProblem<'a> {
    fn new(mut coordinates: Coordinates, system: &'a StateSpace, norm: Norm) -> Self {
        coordinates.unit = time_unit(system.domain, coordinates.unit);
        let (b, c) = (coordinates.input(&system.b), coordinates.output(&system.c));
        let scaling = GainScaling::new(norm, &b, &c, coordinates.unit);
        Self { system, norm, coordinates, scaling }
    }

    /// The semidefinite program and its unknown P, for a given level or with the level minimised.
    fn problem(&self, level: Option<f64>) -> (Problem, Affine) {
        let (system, coordinates) = (self.system, &self.coordinates);
        let mut problem = Problem::new();
        let p = problem.symmetric(system.a.nrows());
        let (b, c) = (coordinates.input(&system.b), coordinates.output(&system.c));
        let (b, c, d) = self.scaling.scale(&b, &c, &system.d);
        let terms = GainInequality {
            dynamics: &p * &coordinates.dynamics(&system.a),
            input: &p * &b,
            output: Affine::constant(&c),
            feedthrough: Affine::constant(&d),
            level: problem.level(level),
            p: p.clone(),
        };
        problem.constrain(&p, MARGIN);
        for matrix in terms.matrices(self.norm, self.system.domain) {
            problem.constrain(&matrix, MARGIN);
        }
        (problem, p)
    }

    /// The smallest level and the P that proves it; None if the solver fails.
    fn minimum(&self) -> Option<(f64, DMatrix<f64>)> {
        let (problem, p) = self.problem(None);
        let (smallest, unknowns) = problem.minimum()?;
        Some((smallest, p.evaluate(&unknowns)))
    }

    /// The bound at `level`; None if P does not prove it in the units of the data.
    ///
    /// P A and P B have twice the precision, as sums `high` + `low`. The inequality is evaluated for `high`, where the
    /// large terms cancel, then for `low`, and both matrices are added. The blocks of the level are in both matrices
    /// and are therefore subtracted once.
    fn verified(&self, level: f64, p: &DMatrix<f64>) -> Result<Option<GainBound>, Error> {
        let (system, gamma) = (self.system, self.scaling.gamma(level));
        let p = self.coordinates.certificate(p) * self.scaling.certificate();
        let (dynamics, input) =
            (AccurateProduct::new(&p, &system.a), AccurateProduct::new(&p, &system.b));
        let matrices =
            |part: f64, p: &DMatrix<f64>, dynamics: &DMatrix<f64>, input: &DMatrix<f64>| {
                let level = if self.norm == Norm::HInfinity { gamma } else { gamma * gamma };
                GainInequality {
                    p: Affine::constant(p),
                    dynamics: Affine::constant(dynamics),
                    input: Affine::constant(input),
                    output: Affine::constant(&(&system.c * part)),
                    feedthrough: Affine::constant(&(&system.d * part)),
                    level: Affine::identity(1, level * part),
                }
                .matrices(self.norm, system.domain)
            };
        let zero = DMatrix::zeros(p.nrows(), p.nrows());
        let rounded = matrices(1.0, &p, &dynamics.high, &input.high);
        let corrections = matrices(0.0, &zero, &dynamics.low, &input.low);
        let constants = matrices(0.0, &zero, &zero, &(&input.low * 0.0));
        let mut smallest = margin(&p)?;
        for ((matrix, correction), constant) in rounded.iter().zip(&corrections).zip(&constants) {
            let exact = &matrix.constant + (&correction.constant - &constant.constant);
            smallest = smallest.min(margin(&exact)?);
        }
        Ok((smallest > 0.0).then_some(GainBound { gamma, p, margin: smallest }))
    }
}
