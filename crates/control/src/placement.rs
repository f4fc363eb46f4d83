//! Pole placement: state feedback that assigns the eigenvalues of A + B K.

mod alternatives;
mod compromise;
mod deflation;
mod descent;
mod eigenvectors;
mod figures;
mod pole_block;
mod pole_error;
mod standard;
mod subspace;
mod update_order;

pub use alternatives::{Alternatives, alternatives, alternatives_balanced, alternatives_discrete};

use crate::balance::{Balance, column_lengths, divide_columns, divide_rows, similar};
use crate::rank::require_controllable;
use crate::svd::Svd;
use crate::{Error, check};
use compromise::Search;
use eigenvectors::{
    Directions, LARGEST_DESCENT, best_conditioned, condition, more_directions, widest_directions,
};
use figures::FeedbackLoop;
use nalgebra::{Complex, DMatrix, DVector};
use pole_block::pole_blocks;
use pole_error::Eigenvectors;
use standard::standard_directions;
use subspace::AssignableSubspaces;

/// Inputs count as dependent when a singular value of B, its columns scaled to length one, is below
/// this fraction of the largest.
const DEPENDENT_INPUTS: f64 = 1e-13;
/// An alternative is accepted if its eigenvalue error is at most `LESS_EXACT` times the error of the chosen gain, or at
/// most `EXACT`.
const LESS_EXACT: f64 = 10.0;
const EXACT: f64 = 1e-9;
/// Largest number of alternatives for a plant of an order above [`LARGEST_DESCENT`].
const MOST_OF_LARGE: usize = 2;

/// A state feedback u = K x with assigned eigenvalues.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// The feedback gain K, m x n.
    pub gain: DMatrix<f64>,
    /// The quality of the assignment.
    pub quality: Quality,
}

/// The quality of an assignment of the eigenvalues of A + B K.
///
/// The condition numbers are those of the matrix of eigenvectors of length one, in the 2-norm: a
/// change of A + B K moves an eigenvalue by at most the condition number times the norm of the
/// change, both in the same coordinates (Bauer and Fike).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Quality {
    /// Condition number in the coordinates of A.
    pub condition: f64,
    /// Condition number in coordinates that balance A + B K for the eigenvectors of least condition
    /// number. It hardly depends on the units of the states.
    pub balanced_condition: f64,
    /// Largest distance of an eigenvalue of A + B K from the requested one, relative to the modulus
    /// of the latter (to the largest modulus for a requested eigenvalue of zero, to the norm of A
    /// if all are zero). In discrete time A - I and the eigenvalues less one take their places.
    pub pole_error: f64,
}

/// Converts real eigenvalues to the complex numbers that [`place`] takes.
#[must_use]
pub fn real_poles(poles: &[f64]) -> Vec<Complex<f64>> {
    poles.iter().map(|&pole| Complex::new(pole, 0.0)).collect()
}

/// Computes K such that the eigenvalues of A + B K are `poles`.
///
/// `a`: n x n; `b`: n x m; `poles`: n numbers, in the unit of A, in any order; complex ones with
/// their exact conjugates; none more often than rank B. K exists for every such choice when (A, B)
/// is controllable. With one independent input it is unique. With more, the eigenvectors are chosen
/// by three figures, all in the given units: the condition number of their matrix, the 2-norm of K
/// and the peak of S = (I - K (s I - A)^-1 B)^-1 over all frequencies (1 for eigenvalues that are
/// not stable).
///
/// 1. From several fixed starts, sweeps over the eigenvectors enlarge the determinant, as the
///    methods of Kautsky, Nichols and Van Dooren and of Tits and Yang do. The least condition number
///    and the least gain of the results, or up to 10 % less where step 2 reaches it, are references.
/// 2. For up to 24 states a descent reduces the condition number itself. The result is returned if
///    its condition number and gain are within 11 % of the references and its peak of S within 2 %
///    of a third reference: the least peak that descents find with condition number and gain within
///    5 % of their references.
/// 3. Otherwise descents minimise the largest of the three figures, each relative to its reference.
///
/// On the systems of the tests each figure is at most 10 % above the better of scipy's two methods.
/// [`alternatives`] returns more gains to choose from, for example for a loop with an observer.
/// With dependent inputs K has the least norm, in units of the inputs for which the columns of B
/// have length one. The result is deterministic.
///
/// The gain follows from the eigenvectors by orthogonal deflation, so that clustered eigenvalues
/// are as accurate as well separated ones. Cost: some thousand evaluations of about 50 n^3
/// multiplications. The eigenvalues are verified: [`Quality::pole_error`] states the error, up to
/// 1e-2; a larger one is refused.
///
/// Sources: J. Kautsky, N. K. Nichols and P. Van Dooren, Robust pole assignment in linear state
/// feedback, Int. J. Control 41 (1985), method 0, for real eigenvalues; A. L. Tits and Y. Yang,
/// Globally convergent algorithms for robust pole assignment by state feedback, IEEE Trans. Autom.
/// Control 41 (1996), for pairs; G. S. Miminis and C. C. Paige, A direct algorithm for pole
/// assignment of time-invariant multi-input linear systems using state feedback, Automatica 24
/// (1988), for the gain; A. S. Lewis and M. L. Overton, Nonsmooth optimization via quasi-Newton
/// methods, Math. Program. 141 (2013), for the descents.
///
/// # Example
///
/// ```
/// use control::placement::{place, real_poles};
/// use nalgebra::{Complex, DMatrix};
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
/// let placement = place(&a, &b, &real_poles(&[-1.0, -2.0]))?;
/// assert!((placement.gain - DMatrix::from_row_slice(1, 2, &[-2.0, -3.0])).amax() < 1e-13);
/// let pair = [Complex::new(-3.0, 4.0), Complex::new(-3.0, -4.0)];
/// let placement = place(&a, &b, &pair)?;
/// assert!((placement.gain - DMatrix::from_row_slice(1, 2, &[-25.0, -6.0])).amax() < 1e-13);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::PoleCount`],
/// [`Error::UnpairedPole`], [`Error::RepeatedPole`] for bad arguments; [`Error::NotControllable`];
/// [`Error::PolesMissed`] when rounding spoils the result; [`Error::NotConverged`],
/// [`Error::Overflow`] when an inner computation fails.
pub fn place(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    PlacementProblem { a, b, poles, sampled: false }.place(&Coordinates::Given)
}

/// Like [`place`], but prefers eigenvectors that are well conditioned in balanced coordinates.
///
/// In step 2 the states are scaled by powers of two such that A + B K for the eigenvectors of least
/// condition number is balanced (Parlett and Reinsch 1969), and the condition number is minimised
/// in these coordinates; the result is returned if its three figures, in the given coordinates, are
/// within the limits of [`place`]. Arguments, existence, tolerance and sources: same as [`place`].
///
/// # Errors
///
/// Same as [`place`].
pub fn place_balanced(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    PlacementProblem { a, b, poles, sampled: false }.place(&Coordinates::Balanced)
}

/// Like [`place_balanced`], for the sampled plant `x[k+1] = A x[k] + B u[k]`.
///
/// The gain is computed as in [`place_balanced`], with the peak of S over the unit circle; only the
/// tolerance differs. `poles`: n eigenvalues in the z plane, zero allowed, with the same rules.
/// Tolerance: the distance of each eigenvalue from the requested p is at most 1e-2 |p - 1|, verified
/// (p = 1: see [`Quality::pole_error`]). So the decay rate of a slow eigenvalue is accurate to 1 % and a
/// fast eigenvalue to about 1e-2. The tolerance cannot be much smaller: k eigenvalues near zero
/// for each input move by the k-th root of a rounding error of A + B K, which hardly changes the
/// samples.
///
/// # Example
///
/// A mass, its position and velocity sampled every 0.1 s, pushed by a force held in between:
///
/// ```
/// use control::placement::{place_discrete, real_poles};
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 1.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[0.005, 0.1]);
/// let gain = place_discrete(&a, &b, &real_poles(&[0.0, 0.1]))?.gain;
/// assert!((&gain - DMatrix::from_row_slice(1, 2, &[-90.0, -14.5])).amax() < 1e-11);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`place`].
pub fn place_discrete(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    PlacementProblem { a, b, poles, sampled: true }.place(&Coordinates::Balanced)
}

/// The coordinates of the states in which the condition number of the eigenvectors is minimised.
pub(crate) enum Coordinates<'a> {
    /// The coordinates of A.
    Given,
    /// Coordinates that balance A + B K, with the K found in the coordinates of A.
    Balanced,
    /// The coordinates z of x = S z, with the given diagonal of S.
    Scaled(&'a DVector<f64>),
}

/// Which placements are computed.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Extent {
    /// Only the chosen placement.
    Chosen,
    /// The chosen placement and alternatives to it.
    Alternatives,
}

/// Eigenvalues to be assigned to A + B K, see [`place`].
pub(crate) struct PlacementProblem<'a> {
    /// A, n x n.
    pub(crate) a: &'a DMatrix<f64>,
    /// B, n x m.
    pub(crate) b: &'a DMatrix<f64>,
    /// n eigenvalues.
    pub(crate) poles: &'a [Complex<f64>],
    /// Whether A and the eigenvalues are of sampled time.
    pub(crate) sampled: bool,
}

impl PlacementProblem<'_> {
    fn place(&self, coordinates: &Coordinates<'_>) -> Result<Placement, Error> {
        Ok(self.alternatives(coordinates, Extent::Chosen)?.chosen)
    }

    /// Assigns the eigenvalues by the chosen eigenvectors, by the eigenvectors of the standard methods and, with
    /// [`Extent::Alternatives`], by further eigenvectors; errors are the same as of [`place`].
    pub(crate) fn alternatives(
        &self,
        coordinates: &Coordinates<'_>,
        extent: Extent,
    ) -> Result<Alternatives, Error> {
        let Self { a, b, poles, sampled } = *self;
        let n = check::with_inputs(a, b)?;
        check_poles(poles, n)?;
        require_controllable(a, b)?;
        let ones = DVector::from_element(n, 1.0);
        let (best, starts) = Assignment::in_units(self, &ones)?;
        let balance = |gain: &DMatrix<f64>| Balance::new(&(a + b * gain)).scale;
        let mut scale = balance(&best.gain);
        let other = match coordinates {
            Coordinates::Given => None,
            Coordinates::Balanced => Some(Assignment::in_units(self, &scale)?.0),
            Coordinates::Scaled(units) => Some(Assignment::in_units(self, units)?.0),
        };
        if let (Coordinates::Scaled(_), Some(other)) = (coordinates, &other) {
            scale = balance(&other.gain);
        }
        let Assignable { problem, basis, .. } = &best.assignable;
        let independent = if problem.inputs() == b.ncols() { b } else { &best.assignable.b };
        let standard = standard_directions(a, independent, problem)?;
        let (mut choice, mut others) = (None, vec![]);
        if problem.inputs() > 1 {
            let feedback = FeedbackLoop::new(problem, basis, b, sampled);
            let other = other.iter().map(|other| {
                problem.directions_of(&other.assignable.eigenvectors(&other.directions, &ones))
            });
            let candidates: Vec<_> = other.chain([best.directions.clone()]).collect();
            let mut search = Search::new(&feedback);
            choice = search.choose(&candidates, &starts)?;
            if let (Some(chosen), Extent::Alternatives) =
                (choice.as_ref().or(candidates.first()), extent)
            {
                others = search.others(chosen, &more_directions(problem)?)?;
            }
        }
        let placement = |assignable: &Assignable, directions: &[DVector<f64>], gain| {
            let v = assignable.eigenvectors(directions, &scale);
            let balanced_condition = condition(&v)?;
            let vectors = Eigenvectors { v, units: &scale, condition: balanced_condition };
            let blocks = assignable.problem.spaces.iter().map(|space| space.poles);
            let quality = Quality {
                condition: condition(&assignable.eigenvectors(directions, &ones))?,
                balanced_condition,
                pole_error: self.pole_error(&gain, &vectors, blocks)?,
            };
            Ok::<_, Error>(Placement { gain, quality })
        };
        let Assignment { assignable, directions, gain } = best;
        let is_unique = assignable.problem.inputs() == 1;
        let chosen = match (choice, other) {
            (Some(best), _) => placement(&assignable, &best, assignable.gain(&best)?)?,
            (None, Some(other)) => placement(&other.assignable, &other.directions, other.gain)?,
            (None, None) => placement(&assignable, &directions, gain)?,
        };
        let allowed = (LESS_EXACT * chosen.quality.pole_error).max(EXACT);
        let most = if n <= LARGEST_DESCENT { usize::MAX } else { MOST_OF_LARGE };
        let others = others.iter().take(most).filter_map(|directions| {
            let gain = assignable.gain(directions).ok()?;
            let other = placement(&assignable, directions, gain).ok()?;
            (other.quality.pole_error <= allowed).then_some(other)
        });
        let others = others.collect();
        let alone = is_unique.then(|| chosen.clone());
        let standard = standard.map(|directions| match directions {
            Some(directions) => {
                placement(&assignable, &directions, assignable.gain(&directions).ok()?).ok()
            }
            None => alone.clone(),
        });
        Ok(Alternatives { chosen, others, standard })
    }
}

/// The eigenvectors that can be assigned, in coordinates z with x = S z, S diagonal.
struct Assignable {
    /// A in the coordinates z: S^-1 A S.
    a: DMatrix<f64>,
    /// B X in the coordinates z: S^-1 B X, n x r, with orthonormal columns.
    b: DMatrix<f64>,
    /// X, m x r, from [`input_basis`].
    basis: DMatrix<f64>,
    /// The subspaces of the eigenvectors for the scaled A and B.
    problem: AssignableSubspaces,
    /// The units of the states: the diagonal of S.
    units: DVector<f64>,
}

impl Assignable {
    fn new(problem: &PlacementProblem<'_>, units: &DVector<f64>) -> Result<Self, Error> {
        let a = similar(problem.a, units);
        let b = divide_rows(problem.b, units);
        let basis = input_basis(&b)?;
        let b = &b * &basis;
        let poles = pole_blocks(problem.poles, basis.ncols())?;
        let problem = AssignableSubspaces::new(&a, &b, &poles)?;
        Ok(Self { a, b, basis, problem, units: units.clone() })
    }

    /// The gain K, in the coordinates x, for the given directions.
    fn gain(&self, directions: &[DVector<f64>]) -> Result<DMatrix<f64>, Error> {
        let gain = &self.basis * deflation::gain(&self.a, &self.b, &self.problem, directions)?;
        check::in_range("K", divide_columns(&gain, &self.units))
    }

    /// The eigenvectors in the coordinates x divided by `scale`, scaled to length one there.
    fn eigenvectors(&self, directions: &[DVector<f64>], scale: &DVector<f64>) -> DMatrix<f64> {
        self.problem.unit_eigenvectors(directions, &scale.component_div(&self.units))
    }
}

/// Chosen eigenvectors and their gain.
struct Assignment {
    assignable: Assignable,
    directions: Directions,
    gain: DMatrix<f64>,
}

impl Assignment {
    /// Eigenvectors of least condition number with the states in the given units, and the starts of the search for
    /// them.
    fn in_units(
        problem: &PlacementProblem<'_>,
        units: &DVector<f64>,
    ) -> Result<(Self, Vec<Directions>), Error> {
        let assignable = Assignable::new(problem, units)?;
        let starts = widest_directions(&assignable.problem)?;
        let directions = best_conditioned(&assignable.problem, &starts)?;
        let gain = assignable.gain(&directions)?;
        Ok((Self { assignable, directions, gain }, starts))
    }
}

/// Checks the number of the eigenvalues and that they are finite.
fn check_poles(poles: &[Complex<f64>], n: usize) -> Result<(), Error> {
    if poles.len() != n {
        return Err(Error::PoleCount { expected: n, actual: poles.len() });
    }
    let parts = DMatrix::from_fn(n, 2, |i, j| if j == 0 { poles[i].re } else { poles[i].im });
    check::finite("poles", &parts)
}

/// Columns X such that B X has orthonormal columns that span the range of B.
fn input_basis(b: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let lengths = column_lengths(b);
    let unit = Svd::new(&divide_columns(b, &lengths))?;
    Ok(divide_rows(&unit.whitening(unit.rank(DEPENDENT_INPUTS)), &lengths))
}
