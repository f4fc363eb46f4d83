//! One certificate, and one state feedback, for all members of a family of systems.

use super::coordinates::{Coordinates, row_units};
use super::observer::{Candidate, Program, REFINEMENTS, RELAXED_GAIN};
use super::region::{NO_P, Region, RegionCertificate, certify_in};
use super::{Outcome, Problem};
use crate::balance::divide_rows;
use crate::check::as_number;
use crate::eigen::eigenvalues;
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, DVector};

/// Bisections of [`largest_scaling`], for an accuracy of 1/128.
const BISECTIONS: u32 = 7;

const NOT_PROVEN: &str = "a gain was found, but it could not be proven for all members";
const UNDECIDED: &str = "the inequalities are met or missed by a rounding error";

/// A member of a family of plants x' = A x + B u.
#[derive(Debug, Clone, PartialEq)]
pub struct Vertex {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
}

/// A state feedback for all members of a family.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CommonFeedback {
    /// K of u = K x, m x n.
    pub gain: DMatrix<f64>,
    /// The proof, with one P for all closed loops `A_i` + `B_i` K.
    pub certificate: RegionCertificate,
}

/// Computes one P that proves for every `A_i` of a family that its eigenvalues are in a region.
///
/// ```text
/// P > 0 and, for each i, the inequalities of certify_region with A = A_i
/// ```
///
/// `vertices`: n x n, at least one. The inequalities are affine in A, so P proves the same for every matrix in the
/// convex hull of the vertices. With P the function V = x' P x decreases along x' = A(t) x, or x+ = `A_k` x, while A
/// varies in the hull with time in any way, arbitrarily fast: V(t) <= exp(-2 alpha t) V(0) for a decay rate alpha. For
/// the disc and the sector P is a proof for each constant matrix of the hull only. One P is sufficient, not necessary.
///
/// Of all P <= I the one farthest inside of all inequalities is computed, in coordinates that suit the first vertex,
/// then up to three times in coordinates in which the most interior P is the identity. P is verified for each vertex in
/// the units of the data, as in [`super::certify_region`]. [`Outcome::Infeasible`] has the indices of vertices whose
/// eigenvalues are outside of the region, or else of vertices that have no common P, each of them necessary for the
/// contradiction.
///
/// Source: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear matrix inequalities in system
/// and control theory (1994), section 5.1; M. Chilali, P. Gahinet, P. Apkarian, Robust pole
/// placement in LMI regions, IEEE Trans. Autom. Control 44 (1999).
///
/// # Example
///
/// Both matrices are stable. Switched between them, the state grows, so that there is no common P:
///
/// ```
/// use control::Domain;
/// use control::lmi::{Outcome, Region, certify_common};
/// use nalgebra::DMatrix;
/// let one = DMatrix::from_row_slice(2, 2, &[-0.1, 1.0, -10.0, -0.1]);
/// let other = DMatrix::from_row_slice(2, 2, &[-0.1, 10.0, -1.0, -0.1]);
/// let outcome = certify_common(&[one, other], &Region::default(), Domain::Continuous)?;
/// let Outcome::Infeasible { conflict } = outcome else { panic!() };
/// assert_eq!(conflict, [0, 1]);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for bad or missing vertices;
/// [`Error::OutOfRange`] for a bad region; [`Error::NotConverged`].
pub fn certify_common(
    vertices: &[DMatrix<f64>],
    region: &Region,
    domain: Domain,
) -> Result<Outcome<RegionCertificate, usize>, Error> {
    let n = order(vertices.first())?;
    for a in vertices {
        check::square("A", a)?;
        check::shape("A", a, (n, n))?;
    }
    region.check(domain)?;
    let mut outside = Vec::new();
    for (at, a) in vertices.iter().enumerate() {
        if !region.violated(&eigenvalues(a)?, domain).is_empty() {
            outside.push(at);
        }
    }
    if !outside.is_empty() {
        return Ok(Outcome::Infeasible { conflict: outside });
    }
    let Some(mut coordinates) = Coordinates::of_dynamics(&vertices[0])? else {
        return Ok(Outcome::Inconclusive(NO_P));
    };
    // P >= I and the inequalities of some vertices.
    let decision = |coordinates: &Coordinates, members: &[usize]| {
        let mut problem = Problem::new();
        let p = problem.symmetric(n);
        problem.constrain(&p, 1.0);
        for &at in members {
            let product = &p * &coordinates.dynamics(&vertices[at]);
            region.constrain(&mut problem, &p, &product, domain, coordinates.unit);
        }
        (problem, p)
    };
    let all: Vec<_> = (0..vertices.len()).collect();
    for refinement in 0..=REFINEMENTS {
        if let Some(certificate) = certify_in(&coordinates, vertices, region, domain)?.optimal() {
            return Ok(Outcome::Optimal(certificate));
        }
        if refinement == REFINEMENTS {
            break;
        }
        let (problem, p) = decision(&coordinates, &all);
        let Some(refined) = coordinates.refined_by(&problem, &p) else { break };
        coordinates = refined;
    }
    contradiction(all, |members| decision(&coordinates, members).0)
}

/// Like [`certify_common`], but searches only in the coordinates of the mean of the vertices and of the first one, and
/// searches no contradiction. None if a vertex has an eigenvalue outside of the region, or if neither search succeeds,
/// although a P may exist. There must be a vertex; the arguments are not checked.
pub(crate) fn find_common(
    vertices: &[DMatrix<f64>],
    region: &Region,
    domain: Domain,
) -> Result<Option<RegionCertificate>, Error> {
    for a in vertices {
        if !region.violated(&eigenvalues(a)?, domain).is_empty() {
            return Ok(None);
        }
    }
    let mean = vertices.iter().sum::<DMatrix<f64>>() / as_number(vertices.len());
    for a in [&mean, &vertices[0]] {
        let Some(coordinates) = Coordinates::of_dynamics(a)? else { continue };
        let certificate = certify_in(&coordinates, vertices, region, domain)?.optimal();
        if certificate.is_some() {
            return Ok(certificate);
        }
    }
    Ok(None)
}

/// The order of the first matrix of a family, which must be square; [`Error::Empty`] if there is none.
pub(super) fn order(first: Option<&DMatrix<f64>>) -> Result<usize, Error> {
    check::square("A", first.ok_or(Error::Empty { matrix: "A", actual: (0, 0) })?)
}

/// The members that contradict each other: each is necessary for the contradiction, and early members are preferred.
/// Inconclusive if the program of all members is not infeasible.
fn contradiction<T>(
    all: Vec<usize>,
    program: impl Fn(&[usize]) -> Problem,
) -> Result<Outcome<T, usize>, Error> {
    match program(&all).solve()? {
        Outcome::Infeasible { .. } => {}
        Outcome::Optimal(_) => return Ok(Outcome::Inconclusive(NO_P)),
        Outcome::Inconclusive(_) => return Ok(Outcome::Inconclusive(UNDECIDED)),
    }
    let mut conflict = all.clone();
    for candidate in all.into_iter().rev() {
        let rest: Vec<_> = conflict.iter().copied().filter(|at| *at != candidate).collect();
        if !rest.is_empty() && matches!(program(&rest).solve()?, Outcome::Infeasible { .. }) {
            conflict = rest;
        }
    }
    Ok(Outcome::Infeasible { conflict })
}

/// Computes one state feedback u = K x that places the eigenvalues of all members of a family in a region.
///
/// ```text
/// A_i + B_i K with P = X^-1, Y = K X:
/// X > 0 and, for each i, the inequalities of certify_region for (A_i + B_i K)' with the product
/// X (A_i + B_i K)' = X A_i' + Y' B_i'
/// ```
///
/// `plants`: at least one; the first one is the nominal plant, which selects the coordinates. P
/// certifies the family as described at [`certify_common`]: the convex hull of the members (A, B),
/// also while they vary arbitrarily fast. A gain exists for the inequalities if and only if the
/// program is feasible; a gain with another P for each member may exist when it is not.
///
/// X >= I, and Y of a norm up to twice the smallest possible, are chosen as far inside of all inequalities as possible,
/// in coordinates in which all states are equally controllable; up to three times more in coordinates in which the most
/// interior X is the identity. The region is then proven for the closed loops by [`certify_common`] with a P of its
/// own. [`Outcome::Infeasible`] has the indices of members that have no common gain, each of them necessary for the
/// contradiction.
///
/// Source: J. Bernussou, P. L. D. Peres, J. C. Geromel, A linear programming oriented procedure
/// for quadratic stabilization of uncertain systems, Systems & Control Letters 13 (1989); Boyd et
/// al. (1994), section 7.2.1; Chilali, Gahinet, Apkarian (1999).
///
/// # Example
///
/// A mass of 1 kg to 4 kg, moved by a force:
///
/// ```
/// use control::Domain;
/// use control::lmi::{Region, Vertex, common_feedback};
/// use nalgebra::DMatrix;
/// let plant = |mass: f64| Vertex {
///     a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]),
///     b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0 / mass]),
/// };
/// let region = Region { decay: Some(1.0), ..Region::default() };
/// let plants = [plant(1.0), plant(4.0)];
/// let feedback = common_feedback(&plants, &region, Domain::Continuous)?.optimal().unwrap();
/// for Vertex { a, b } in plants {
///     for value in control::eigen::eigenvalues(&(a + b * &feedback.gain))? {
///         assert!(value.re < -1.0);
///     }
/// }
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for bad or missing plants;
/// [`Error::OutOfRange`] for a bad region; [`Error::NotConverged`].
pub fn common_feedback(
    plants: &[Vertex],
    region: &Region,
    domain: Domain,
) -> Result<Outcome<CommonFeedback, usize>, Error> {
    check_plants(plants)?;
    region.check(domain)?;
    let (a, c) = (plants[0].a.transpose(), plants[0].b.transpose());
    let mut coordinates = Coordinates::of_observation(&a, &c, region, domain)?;
    let search = CommonSearch { plants, region, domain };
    let all: Vec<_> = (0..plants.len()).collect();
    let mut has_candidate = false;
    for refinement in 0..=REFINEMENTS {
        let program = search.program(&coordinates, &all).with_norm(None);
        for Candidate { gain, coordinates } in search.candidates(&program, &coordinates, &all)? {
            has_candidate = true;
            if let Some(certificate) = search.proof(&gain, &coordinates)? {
                return Ok(Outcome::Optimal(CommonFeedback { gain, certificate }));
            }
        }
        if refinement == REFINEMENTS {
            break;
        }
        let Some(refined) = coordinates.refined_by(&program.problem, &program.p) else { break };
        coordinates = refined;
    }
    if has_candidate {
        return Ok(Outcome::Inconclusive(NOT_PROVEN));
    }
    contradiction(all, |members| search.program(&coordinates, members).problem)
}

/// The largest scaling, from 0 to 1, of a family around its first member for which [`common_feedback`] finds a gain, to
/// 1/128; None if there is no gain for the first member alone.
///
/// ```text
/// A_0 + s (A_i - A_0), B_0 + s (B_i - B_0)
/// ```
///
/// The hull of a family contains that of its scaling, so feasibility is monotonic in s.
///
/// # Errors
///
/// Same as [`common_feedback`].
pub fn largest_scaling(
    plants: &[Vertex],
    region: &Region,
    domain: Domain,
) -> Result<Option<f64>, Error> {
    check_plants(plants)?;
    let feasible = |s: f64| {
        let scaled = |to: &Vertex| {
            let from = &plants[0];
            Vertex { a: &from.a + (&to.a - &from.a) * s, b: &from.b + (&to.b - &from.b) * s }
        };
        let scaled: Vec<_> = plants.iter().map(scaled).collect();
        common_feedback(&scaled, region, domain).map(|outcome| outcome.optimal().is_some())
    };
    if feasible(1.0)? {
        return Ok(Some(1.0));
    }
    if common_feedback(&plants[..1], region, domain)?.optimal().is_none() {
        return Ok(None);
    }
    let (mut good, mut bad) = (0.0, 1.0);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (good + bad);
        *(if feasible(middle)? { &mut good } else { &mut bad }) = middle;
    }
    Ok(Some(good))
}

/// Checks the members of a family: at least one, all with the same numbers of states and inputs.
fn check_plants(plants: &[Vertex]) -> Result<(), Error> {
    let n = order(plants.first().map(|plant| &plant.a))?;
    let m = plants[0].b.ncols();
    for Vertex { a, b } in plants {
        check::square("A", a)?;
        check::shape("A", a, (n, n))?;
        check::shape("B", b, (n, m))?;
    }
    Ok(())
}

/// The search for a common gain, as an observer gain L = -K' of the transposed members.
struct CommonSearch<'a> {
    plants: &'a [Vertex],
    region: &'a Region,
    domain: Domain,
}

impl CommonSearch<'_> {
    /// One P for the closed loops, searched in the coordinates of the gain, then as by [`certify_common`]; None if
    /// neither search finds one.
    fn proof(
        &self,
        gain: &DMatrix<f64>,
        coordinates: &Coordinates,
    ) -> Result<Option<RegionCertificate>, Error> {
        let closed: Vec<_> = self.plants.iter().map(|Vertex { a, b }| a + b * gain).collect();
        match certify_in(coordinates, &closed, self.region, self.domain)?.optimal() {
            None => Ok(certify_common(&closed, self.region, self.domain)?.optimal()),
            certificate => Ok(certificate),
        }
    }

    /// Candidate gains K, each with coordinates in which its P is the identity: first the most interior gain for a norm
    /// of Z up to twice the smallest, then the gain of the smallest norm of Z.
    fn candidates(
        &self,
        program: &Program,
        coordinates: &Coordinates,
        members: &[usize],
    ) -> Result<Vec<Candidate>, Error> {
        let units = self.units(coordinates);
        let Some((smallest, _)) = program.problem.minimum() else { return Ok(Vec::new()) };
        let relaxed = self.program(coordinates, members).with_norm(Some(smallest * RELAXED_GAIN));
        let mut candidates = Vec::new();
        for program in [&relaxed, program] {
            let candidate = program.solve(coordinates, &units)?.optimal();
            candidates.extend(candidate.map(|candidate| candidate.transposed()));
        }
        Ok(candidates)
    }

    /// Units of the commands: powers of two near the lengths of the columns of B in the coordinates.
    fn units(&self, coordinates: &Coordinates) -> DVector<f64> {
        row_units(&coordinates.output(&self.plants[0].b.transpose()))
    }

    /// The program for X >= I and Z with the inequalities of `members`.
    fn program(&self, coordinates: &Coordinates, members: &[usize]) -> Program {
        let units = self.units(coordinates);
        let (n, m) = self.plants[0].b.shape();
        let mut problem = Problem::new();
        let (x, z) = (problem.symmetric(n), problem.rectangular(n, m));
        problem.constrain(&x, 1.0);
        for &at in members {
            let Vertex { a, b } = &self.plants[at];
            let c = divide_rows(&coordinates.output(&b.transpose()), &units);
            let product = &(&x * &coordinates.dynamics(&a.transpose())) - &(&z * &c);
            self.region.constrain(&mut problem, &x, &product, self.domain, coordinates.unit);
        }
        Program { problem, p: x, z }
    }
}
