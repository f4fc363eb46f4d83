//! Pole placement: state feedback that assigns the eigenvalues of A + B K.

mod deflation;
mod descent;
mod eigenvectors;
mod pole_block;
mod pole_error;
mod subspace;

use crate::balance::{Balance, divide_columns, divide_rows, multiply_columns};
use crate::rank::require_controllable;
use crate::svd::Svd;
use crate::{Error, check};
use eigenvectors::{best_directions, condition};
use nalgebra::{Complex, DMatrix, DVector};
use pole_block::pole_blocks;
use pole_error::{CONTINUOUS, DISCRETE, PoleTolerance};
use subspace::AssignableSubspaces;

/// Inputs count as dependent when a singular value of B, its columns scaled to length one, is below
/// this.
const DEPENDENT_INPUTS: f64 = 1e-13;

/// A state feedback u = K x with assigned eigenvalues.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// K, m x n.
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
    /// Condition number in the coordinates of A. [`place`] minimises this one.
    pub condition: f64,
    /// Condition number in coordinates that balance the A + B K of [`place`], which does not depend
    /// on the units of the states. [`place_balanced`] and [`place_discrete`] minimise this one.
    pub balanced_condition: f64,
    /// Largest distance of an eigenvalue of A + B K from the requested one, relative to the modulus
    /// of the latter (to the largest modulus for a requested eigenvalue of zero, to the norm of A
    /// if all are zero). In discrete time the same for A - I and the eigenvalues less one.
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
/// to minimise the condition number of their matrix, in the given coordinates: from several fixed
/// starts, sweeps over the eigenvectors enlarge the determinant, then a descent reduces the
/// condition number itself. With dependent inputs K has the least norm, in units of the inputs for
/// which the columns of B have length one. The result is deterministic.
///
/// The gain follows from the eigenvectors by orthogonal deflation, so that clustered eigenvalues
/// are as accurate as well separated ones. Cost: about a hundred singular value decompositions per
/// start, in all about 1e4 n^3 multiplications. Tolerance: 1e-6 relative to each eigenvalue,
/// verified.
///
/// Sources: J. Kautsky, N. K. Nichols and P. Van Dooren, Robust pole assignment in linear state
/// feedback, Int. J. Control 41 (1985), method 0, for real eigenvalues; A. L. Tits and Y. Yang,
/// Globally convergent algorithms for robust pole assignment by state feedback, IEEE Trans. Autom.
/// Control 41 (1996), for pairs; G. S. Miminis and C. C. Paige, A direct algorithm for pole
/// assignment of time-invariant multi-input linear systems using state feedback, Automatica 24
/// (1988), for the gain.
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
    as_given(a, b, poles, &CONTINUOUS)
}

/// Like [`place`], with eigenvectors that are well conditioned in balanced coordinates.
///
/// The states are first scaled by powers of two such that A + B K of [`place`] is balanced (Parlett
/// and Reinsch 1969); the eigenvectors are chosen in these coordinates and the gain is transformed
/// back. The choice then hardly depends on the units of the states. Arguments, existence, tolerance
/// and sources: same as [`place`]; the cost is twice as high.
///
/// # Errors
///
/// Same as [`place`].
pub fn place_balanced(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    balanced(a, b, poles, &CONTINUOUS)
}

/// Like [`place_balanced`], for the sampled plant `x[k+1] = A x[k] + B u[k]`.
///
/// The gain is computed as in [`place_balanced`]; only the tolerance differs. `poles`: n
/// eigenvalues in the z plane, zero allowed, with the same rules. Tolerance: the distance of each
/// eigenvalue from the requested p is at most 1e-2 |p - 1|, verified. The decay of a slow
/// eigenvalue is then accurate to 1e-2 of itself, a fast one to about 1e-2. The tolerance cannot be
/// much smaller: k eigenvalues near zero for each input move by the k-th root of a rounding error
/// of A + B K, which hardly changes the samples.
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
    balanced(a, b, poles, &DISCRETE)
}

/// [`place_discrete`] with the eigenvectors chosen in the given coordinates.
pub(crate) fn place_discrete_as_given(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    as_given(a, b, poles, &DISCRETE)
}

fn as_given(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
    tolerance: &PoleTolerance,
) -> Result<Placement, Error> {
    let assignment = Assignment::given(a, b, poles)?;
    let scale = assignment.balance(a, b);
    assignment.placement(a, b, poles, &scale, tolerance)
}

fn balanced(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
    tolerance: &PoleTolerance,
) -> Result<Placement, Error> {
    let scale = Assignment::given(a, b, poles)?.balance(a, b);
    Assignment::new(a, b, poles, &scale)?.placement(a, b, poles, &scale, tolerance)
}

/// Eigenvectors of least condition number in given coordinates, and their gain.
struct Assignment {
    gain: DMatrix<f64>,
    problem: AssignableSubspaces,
    directions: Vec<DVector<f64>>,
    /// Diagonal S with x = S z, z the coordinates of the problem.
    units: DVector<f64>,
}

impl Assignment {
    fn given(a: &DMatrix<f64>, b: &DMatrix<f64>, poles: &[Complex<f64>]) -> Result<Self, Error> {
        Self::new(a, b, poles, &DVector::from_element(a.nrows(), 1.0))
    }

    fn new(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        poles: &[Complex<f64>],
        units: &DVector<f64>,
    ) -> Result<Self, Error> {
        let n = check::square("A", a)?;
        check::shape("B", b, (n, b.ncols()))?;
        check_poles(poles, n)?;
        require_controllable(a, b)?;
        let a = divide_rows(&multiply_columns(a, units), units);
        let b = divide_rows(b, units);
        let basis = input_basis(&b)?;
        let b = &b * &basis;
        let problem = AssignableSubspaces::new(&a, &b, &pole_blocks(poles, basis.ncols())?)?;
        let directions = best_directions(&problem)?;
        let gain = basis * deflation::gain(&a, &b, &problem, &directions)?;
        let gain = check::in_range("K", divide_columns(&gain, units))?;
        Ok(Self { gain, problem, directions, units: units.clone() })
    }

    /// Units of the states in which A + B K is balanced.
    fn balance(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> DVector<f64> {
        Balance::new(&(a + b * &self.gain)).scale
    }

    /// Verifies the eigenvalues; computes the condition numbers in the coordinates of A and in the
    /// coordinates `scale`.
    fn placement(
        self,
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        poles: &[Complex<f64>],
        scale: &DVector<f64>,
        tolerance: &PoleTolerance,
    ) -> Result<Placement, Error> {
        let condition_in = |coordinates: &DVector<f64>| {
            let units = coordinates.component_div(&self.units);
            condition(&self.problem.unit_eigenvectors(&self.directions, &units))
        };
        let quality = Quality {
            condition: condition_in(&DVector::from_element(a.nrows(), 1.0))?,
            balanced_condition: condition_in(scale)?,
            pole_error: tolerance.pole_error(a, b, &self.gain, poles)?,
        };
        Ok(Placement { gain: self.gain, quality })
    }
}

fn check_poles(poles: &[Complex<f64>], n: usize) -> Result<(), Error> {
    if poles.len() != n {
        return Err(Error::PoleCount { expected: n, found: poles.len() });
    }
    let parts = DMatrix::from_fn(n, 2, |i, j| if j == 0 { poles[i].re } else { poles[i].im });
    check::finite("poles", &parts)
}

/// Columns X such that B X has orthonormal columns that span the range of B.
fn input_basis(b: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let lengths = DVector::from_iterator(b.ncols(), b.column_iter().map(|column| column.norm()));
    let lengths = lengths.map(|length| if length > 0.0 { length } else { 1.0 });
    let unit = Svd::new(&divide_columns(b, &lengths))?;
    Ok(divide_rows(&unit.whitening(unit.rank(DEPENDENT_INPUTS)), &lengths))
}
