//! Bounds of the gain from a disturbance to an output.

use super::affine::Affine;
use super::coordinates::Coordinates;
use super::definite::{Product, margin};
use super::region::MARGIN;
use super::{Outcome, Problem};
use crate::balance::power_of_two;
use crate::domain::Domain;
use crate::eigen::eigenvalues;
use crate::{Error, check};
use nalgebra::DMatrix;

/// Levels that are tried, relative to the smallest, when P of the smallest is lost in rounding errors.
const RELAXED: [f64; 4] = [1.0 + 1e-6, 1.0 + 1e-5, 1.0 + 1e-4, 1.0 + 1e-3];

const NO_P: &str = "no P shows in double precision that the gain is bounded";

/// How large an output may become.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Norm {
    /// H-infinity: energy of the output over energy of the disturbance, the largest singular value
    /// of the transfer matrix over all frequencies.
    HInfinity,
    /// Generalised H2: peak of the Euclidean norm of the output over the root of the energy of the
    /// disturbance. In continuous time for D = 0 only.
    EnergyToPeak,
    /// Root of the energy of the output after an impulse over the size of the impulse: what
    /// [`Norm::EnergyToPeak`] becomes for the transposed system.
    ImpulseToEnergy,
}

/// x' = A x + B w, z = C x + D w, or the same from sample to sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x k, from the disturbance.
    pub b: DMatrix<f64>,
    /// C, r x n, to the output.
    pub c: DMatrix<f64>,
    /// D, r x k.
    pub d: DMatrix<f64>,
}

/// A proof that a gain is below a bound.
#[derive(Debug, Clone, PartialEq)]
pub struct GainBound {
    /// The bound, in the unit of the norm.
    pub gamma: f64,
    /// P, n x n, symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Smallest eigenvalue of all the inequalities, each scaled to a diagonal of about one; above
    /// the rounding errors.
    pub margin: f64,
}

/// What the inequalities of a bound are made of: P, P A, P B, C, D and the level, gamma for
/// H-infinity and its square otherwise.
pub(super) struct Terms {
    pub(super) p: Affine,
    pub(super) dynamics: Affine,
    pub(super) input: Affine,
    pub(super) output: Affine,
    pub(super) feed: Affine,
    pub(super) level: Affine,
}

impl Terms {
    /// The matrices that are positive definite if the gain is below the bound.
    pub(super) fn requirements(&self, norm: Norm, domain: Domain) -> Vec<Affine> {
        let continuous = domain == Domain::Continuous;
        let (inputs, outputs) = (self.input.shape().1, self.output.shape().0);
        let level = |order: usize| self.level.times(&DMatrix::identity(order, order));
        let one = |order: usize| Affine::identity(order, 1.0);
        let (turned, feed) = (self.output.transpose(), self.feed.transpose());
        let Self { p, dynamics, input, .. } = self;
        let decay = || -&dynamics.plus_transpose();
        match (norm, continuous) {
            (Norm::HInfinity, true) => vec![upper(&[
                &[&decay(), &-input, &-&turned],
                &[&level(inputs), &-&feed],
                &[&level(outputs)],
            ])],
            (Norm::HInfinity, false) => {
                let zero = Affine::zeros(p.shape().0, inputs);
                vec![upper(&[
                    &[p, dynamics, input, &Affine::zeros(p.shape().0, outputs)],
                    &[p, &zero, &turned],
                    &[&level(inputs), &feed],
                    &[&level(outputs)],
                ])]
            }
            (Norm::EnergyToPeak, true) => vec![
                upper(&[&[&decay(), &-input], &[&one(inputs)]]),
                upper(&[&[p, &turned], &[&level(outputs)]]),
            ],
            (Norm::EnergyToPeak, false) => {
                let zero = Affine::zeros(p.shape().0, inputs);
                vec![
                    upper(&[&[p, dynamics, input], &[p, &zero], &[&one(inputs)]]),
                    upper(&[&[p, &zero, &turned], &[&one(inputs), &feed], &[&level(outputs)]]),
                ]
            }
            (Norm::ImpulseToEnergy, true) => vec![
                upper(&[&[&decay(), &turned], &[&one(outputs)]]),
                upper(&[&[p, input], &[&level(inputs)]]),
            ],
            (Norm::ImpulseToEnergy, false) => {
                let zero = Affine::zeros(p.shape().0, outputs);
                vec![
                    upper(&[&[p, dynamics, &zero], &[p, &turned], &[&one(outputs)]]),
                    upper(&[&[p, input, &zero], &[&level(inputs), &feed], &[&one(outputs)]]),
                ]
            }
        }
    }
}

/// The symmetric matrix of which the blocks on and above the diagonal are given.
fn upper(rows: &[&[&Affine]]) -> Affine {
    let whole: Vec<Vec<Affine>> = (0..rows.len())
        .map(|row| {
            let before = (0..row).map(|col| rows[col][row - col].transpose());
            before.chain(rows[row].iter().map(|block| (*block).clone())).collect()
        })
        .collect();
    let lent: Vec<Vec<&Affine>> = whole.iter().map(|row| row.iter().collect()).collect();
    let rows: Vec<&[&Affine]> = lent.iter().map(Vec::as_slice).collect();
    Affine::blocks(&rows)
}

/// Sizes by which disturbance and output are divided for the solver, and what that makes of a bound
/// and of P.
pub(super) struct Levels {
    norm: Norm,
    disturbance: f64,
    output: f64,
    unit: f64,
}

impl Levels {
    /// B and C in the solver's coordinates.
    pub(super) fn of(norm: Norm, b: &DMatrix<f64>, c: &DMatrix<f64>, unit: f64) -> Self {
        let size = |m: &DMatrix<f64>| if m.amax() > 0.0 { power_of_two(m.norm()) } else { 1.0 };
        Self { norm, disturbance: size(b), output: size(c), unit }
    }

    /// Unit of the disturbance.
    pub(super) fn disturbance(&self) -> f64 {
        self.disturbance
    }

    /// Unit of the bound.
    fn gain(&self) -> f64 {
        let time = if self.norm == Norm::HInfinity { 1.0 } else { self.unit.sqrt() };
        self.disturbance * self.output * time
    }

    /// Level of the inequalities for a bound, and back.
    pub(super) fn level(&self, gamma: f64) -> f64 {
        let scaled = gamma / self.gain();
        if self.norm == Norm::HInfinity { scaled } else { scaled * scaled }
    }

    fn gamma(&self, level: f64) -> f64 {
        self.gain() * if self.norm == Norm::HInfinity { level } else { level.sqrt() }
    }

    fn certificate(&self) -> f64 {
        match self.norm {
            Norm::HInfinity => self.output / (self.disturbance * self.unit),
            Norm::EnergyToPeak => 1.0 / (self.disturbance * self.disturbance * self.unit),
            Norm::ImpulseToEnergy => self.output * self.output / self.unit,
        }
    }

    /// B, C and D for the solver.
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

impl Channel {
    /// Shapes and finiteness of the four matrices, and no D where the norm would be infinite.
    fn check(&self, norm: Norm, domain: Domain) -> Result<(), Error> {
        let n = check::square("A", &self.a)?;
        check::shape("B", &self.b, (n, self.b.ncols()))?;
        check::shape("C", &self.c, (self.c.nrows(), n))?;
        check::shape("D", &self.d, (self.c.nrows(), self.b.ncols()))?;
        if domain == Domain::Continuous && norm != Norm::HInfinity && self.d.amax() > 0.0 {
            let rule = "zero: an impulse would reach the output";
            return Err(Error::OutOfRange { name: "D", value: self.d.amax(), rule });
        }
        Ok(())
    }

    fn is_stable(&self, domain: Domain) -> Result<bool, Error> {
        let values = eigenvalues(&self.a)?;
        Ok(match domain {
            Domain::Continuous => values.iter().all(|value| value.re < 0.0),
            Domain::Sampled { .. } => values.iter().all(|value| value.norm() < 1.0),
        })
    }
}

/// The smallest bound gamma of the gain from w to z, with its proof.
///
/// ```text
/// P > 0 and
/// H-infinity:        [A' P + P A, P B, C'; B' P, -gamma I, D'; C, D, -gamma I] < 0
/// energy to peak:    [A' P + P A, P B; B' P, -I] < 0,  [P, C'; C, gamma^2 I] > 0
/// impulse to energy: [A' P + P A, C'; C, -I] < 0,  [P, P B; B' P, gamma^2 I] > 0
/// and from sample to sample
/// H-infinity:        [P, P A, P B, 0; *, P, 0, C'; *, *, gamma I, D'; *, *, *, gamma I] > 0
/// energy to peak:    [P, P A, P B; *, P, 0; *, *, I] > 0,
///                    [P, 0, C'; *, I, D'; *, *, gamma^2 I] > 0
/// impulse to energy: [P, P A, 0; *, P, C'; *, *, I] > 0,
///                    [P, P B, 0; *, gamma^2 I, D'; *, *, I] > 0
/// ```
///
/// All disturbances start from x = 0. A finite bound exists if and only if the part of A between w
/// and z is stable; here all of A has to be, or the answer is a conflict named "stability". The bound
/// found lies above the norm by 1e-6 to 1e-3 of it. It is proven: the
/// inequalities hold for P and gamma in the data as given, the products computed in twice the
/// precision.
///
/// Source: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear matrix inequalities in system and
/// control theory (1994), (2.25); M. A. Rotea, The generalized H2 control problem, Automatica 29
/// (1993); C. Scherer, P. Gahinet, M. Chilali, Multiobjective output-feedback control via LMI
/// optimization, IEEE Trans. Autom. Control 42 (1997), section II.
///
/// # Example
///
/// The gain of 2 / (s + 4) is 1/2, and its peak per energy 2 / sqrt(8):
///
/// ```
/// use control::Domain;
/// use control::lmi::{Channel, Norm, certify_gain};
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let channel = Channel { a: one(-4.0), b: one(2.0), c: one(1.0), d: one(0.0) };
/// let bound = |norm| certify_gain(&channel, norm, Domain::Continuous).map(|found| found.optimal());
/// let (first, second) = (bound(Norm::HInfinity)?.unwrap(), bound(Norm::EnergyToPeak)?.unwrap());
/// assert!(first.gamma > 0.5 && first.gamma < 0.5001);
/// assert!(second.gamma > 0.5_f64.sqrt() && second.gamma < 0.7072);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`]
/// for a D other than zero where the norm is infinite; [`Error::NotConverged`].
pub fn certify_gain(
    channel: &Channel,
    norm: Norm,
    domain: Domain,
) -> Result<Outcome<GainBound>, Error> {
    channel.check(norm, domain)?;
    if !channel.is_stable(domain)? {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    match Coordinates::of_dynamics(&channel.a)? {
        Some(coordinates) => certify_in(coordinates, channel, norm, domain),
        None => Ok(Outcome::Trouble(NO_P)),
    }
}

/// The same by a solution in given coordinates.
pub(super) fn certify_in(
    coordinates: Coordinates,
    channel: &Channel,
    norm: Norm,
    domain: Domain,
) -> Result<Outcome<GainBound>, Error> {
    let search = Search::new(coordinates, channel, norm, domain);
    let (problem, p, level) = search.problem(None);
    let Some((smallest, unknowns)) = problem.smallest() else {
        return Ok(Outcome::Trouble(NO_P));
    };
    if let Some(bound) = search.verified(level.at(&unknowns)[(0, 0)], &p.at(&unknowns))? {
        return Ok(Outcome::Optimal(bound));
    }
    for more in RELAXED {
        let (problem, p, _) = search.problem(Some(smallest * more));
        if let Outcome::Optimal(solution) = problem.solve()?
            && let Some(bound) = search.verified(smallest * more, &solution.value(&p))?
        {
            return Ok(Outcome::Optimal(bound));
        }
    }
    Ok(Outcome::Trouble(NO_P))
}

/// The search for P and the level in the solver's coordinates.
struct Search<'a> {
    channel: &'a Channel,
    norm: Norm,
    domain: Domain,
    coordinates: Coordinates,
    levels: Levels,
}

impl<'a> Search<'a> {
    fn new(mut coordinates: Coordinates, channel: &'a Channel, norm: Norm, domain: Domain) -> Self {
        if domain != Domain::Continuous {
            coordinates.unit = 1.0;
        }
        let (b, c) = (coordinates.input(&channel.b), coordinates.output(&channel.c));
        let levels = Levels::of(norm, &b, &c, coordinates.unit);
        Self { channel, norm, domain, coordinates, levels }
    }

    /// The problem, its P, and the level: given, or to be minimised.
    fn problem(&self, level: Option<f64>) -> (Problem, Affine, Affine) {
        let (channel, coordinates) = (self.channel, &self.coordinates);
        let mut problem = Problem::new();
        let p = problem.symmetric(channel.a.nrows());
        let value = level.map_or_else(|| problem.scalar(), |value| Affine::identity(1, value));
        if level.is_none() {
            problem.minimise(&value);
        }
        let (b, c) = (coordinates.input(&channel.b), coordinates.output(&channel.c));
        let (b, c, d) = self.levels.scale(&b, &c, &channel.d);
        let terms = Terms {
            dynamics: &p * &coordinates.dynamics(&channel.a),
            input: &p * &b,
            output: Affine::constant(&c),
            feed: Affine::constant(&d),
            level: value.clone(),
            p: p.clone(),
        };
        problem.always(&p, MARGIN);
        for matrix in terms.requirements(self.norm, self.domain) {
            problem.always(&matrix, MARGIN);
        }
        (problem, p, value)
    }

    fn verified(&self, level: f64, p: &DMatrix<f64>) -> Result<Option<GainBound>, Error> {
        let gamma = self.levels.gamma(level);
        let p = self.coordinates.certificate(p) * self.levels.certificate();
        verify(self.channel, self.norm, self.domain, gamma, p)
    }
}

/// Checks P and gamma in the data as given.
fn verify(
    channel: &Channel,
    norm: Norm,
    domain: Domain,
    gamma: f64,
    p: DMatrix<f64>,
) -> Result<Option<GainBound>, Error> {
    let (dynamics, input) = (Product::of(&p, &channel.a), Product::of(&p, &channel.b));
    let known = |part: f64, p: &DMatrix<f64>, dynamics: &DMatrix<f64>, input: &DMatrix<f64>| {
        let level = if norm == Norm::HInfinity { gamma } else { gamma * gamma };
        Terms {
            p: Affine::constant(p),
            dynamics: Affine::constant(dynamics),
            input: Affine::constant(input),
            output: Affine::constant(&(&channel.c * part)),
            feed: Affine::constant(&(&channel.d * part)),
            level: Affine::identity(1, level * part),
        }
        .requirements(norm, domain)
    };
    let zero = DMatrix::zeros(p.nrows(), p.nrows());
    let rounded = known(1.0, &p, &dynamics.high, &input.high);
    let lost = known(0.0, &zero, &dynamics.low, &input.low);
    let rest = known(0.0, &zero, &zero, &(&input.low * 0.0));
    let mut smallest = margin(&p)?;
    for ((matrix, correction), rest) in rounded.iter().zip(&lost).zip(&rest) {
        let exact = &matrix.constant + (&correction.constant - &rest.constant);
        smallest = smallest.min(margin(&exact)?);
    }
    Ok((smallest > 0.0).then_some(GainBound { gamma, p, margin: smallest }))
}
