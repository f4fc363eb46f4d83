//! State feedback with wanted eigenvalues.

mod assignable;
mod conditioning;
mod deflation;
mod descent;
mod reached;
mod wanted;

use crate::balance::{Balance, divide_columns, divide_rows, multiply_columns};
use crate::rank::require_controllable;
use crate::svd::Svd;
use crate::{Error, check};
use assignable::Assignable;
use conditioning::{best_directions, condition};
use nalgebra::{Complex, DMatrix, DVector};
use reached::{CONTINUOUS, DISCRETE, Demand};
use wanted::wanted;

/// Inputs are dependent when a singular value of B with columns of length one is below this.
const DEPENDENT_INPUTS: f64 = 1e-13;

/// A state feedback u = K x.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// K, m x n.
    pub gain: DMatrix<f64>,
    /// How well the eigenvalues are assigned.
    pub quality: Quality,
}

/// How well the eigenvalues of A + B K are assigned.
///
/// A condition number is that of the matrix of eigenvectors of length one, in the 2-norm: an
/// eigenvalue moves by at most this times the norm of a change of A + B K (Bauer and Fike), both
/// in the same coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Condition number in the coordinates of A. [`place`] makes this one small.
    pub condition: f64,
    /// Condition number in coordinates that balance the A + B K of [`place`], so without the part
    /// that comes from the units of the states. [`place_balanced`] and [`place_discrete`] make
    /// this one small.
    pub balanced_condition: f64,
    /// Largest distance of an eigenvalue of A + B K from the wanted one, relative to the size of
    /// the latter (to the largest size for a wanted eigenvalue of zero, to the norm of A if all
    /// are zero). In discrete time the same for A - I and the eigenvalues less one.
    pub pole_error: f64,
}

/// Real eigenvalues as [`place`] takes them.
#[must_use]
pub fn real_poles(poles: &[f64]) -> Vec<Complex<f64>> {
    poles.iter().map(|&pole| Complex::new(pole, 0.0)).collect()
}

/// Finds K such that the eigenvalues of A + B K are `poles`.
///
/// `a`: n x n; `b`: n x m; `poles`: n numbers, in the unit of A, in any order; complex ones with
/// their exact conjugates; none more often than rank B. K exists for all of them when (A, B) is
/// controllable. With one independent input it is unique. With more, the eigenvectors are chosen
/// so that the condition number of their matrix, in the coordinates given, is as small as found
/// from several fixed starts: sweeps over the eigenvectors that enlarge the determinant, then a
/// descent on the condition number itself. With dependent inputs the smallest K is taken, in units
/// of the inputs that give the columns of B length one. Same arguments, same answer.
///
/// The gain follows from the eigenvectors by orthogonal deflation, so that it is as exact for
/// clustered eigenvalues as for well separated ones. Cost: some hundred iterations of a singular
/// value decomposition per start, so some 1e4 n^3 multiplications. Tolerance: 1e-6, each eigenvalue
/// relative to itself, verified.
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

/// As [`place`], with the eigenvectors well conditioned in balanced coordinates.
///
/// The states are first scaled by powers of two such that A + B K of [`place`] is balanced (Parlett
/// and Reinsch 1969); the eigenvectors are chosen in these coordinates and the gain is brought back.
/// So the units of the states, in which numbers of very different size may stand, have little part
/// in the choice. Arguments, existence, tolerance, sources and errors: those of [`place`]; the cost
/// is twice as high.
///
/// # Errors
///
/// Those of [`place`].
pub fn place_balanced(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    balanced(a, b, poles, &CONTINUOUS)
}

/// As [`place_balanced`], for the sampled plant `x[k+1] = A x[k] + B u[k]`.
///
/// The gain is that of [`place_balanced`]; only what counts as reached differs. `poles`: n
/// eigenvalues in the z plane, zero among them if wanted, with the same rules. Tolerance: 1e-2, the
/// distance of each eigenvalue from the wanted p relative to |p - 1|, verified. So the decay of a
/// slow eigenvalue is right to 1e-2 of itself, and a fast one lies within about 1e-2 of the wanted
/// one. That much must be allowed: k eigenvalues near zero for each input move by the k-th root of
/// a rounding error of A + B K, and the samples hardly tell the difference.
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
/// Those of [`place`].
pub fn place_discrete(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
) -> Result<Placement, Error> {
    balanced(a, b, poles, &DISCRETE)
}

/// [`place_discrete`] with the eigenvectors chosen in the coordinates given.
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
    demand: &Demand,
) -> Result<Placement, Error> {
    let choice = Choice::given(a, b, poles)?;
    let scale = choice.balance(a, b);
    choice.placement(a, b, poles, &scale, demand)
}

fn balanced(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[Complex<f64>],
    demand: &Demand,
) -> Result<Placement, Error> {
    let scale = Choice::given(a, b, poles)?.balance(a, b);
    Choice::new(a, b, poles, &scale)?.placement(a, b, poles, &scale, demand)
}

/// The eigenvectors with the least condition number in some coordinates, and their gain.
struct Choice {
    gain: DMatrix<f64>,
    problem: Assignable,
    directions: Vec<DVector<f64>>,
    /// Diagonal S with x = S z, z the coordinates of the problem.
    units: DVector<f64>,
}

impl Choice {
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
        let problem = Assignable::new(&a, &b, &wanted(poles, basis.ncols())?)?;
        let directions = best_directions(&problem)?;
        let gain = basis * deflation::gain(&a, &b, &problem, &directions)?;
        let gain = check::in_range("K", divide_columns(&gain, units))?;
        Ok(Self { gain, problem, directions, units: units.clone() })
    }

    /// Units of the states in which A + B K is balanced.
    fn balance(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> DVector<f64> {
        Balance::new(&(a + b * &self.gain)).scale
    }

    /// Verified, with condition numbers in the coordinates of A and in those of `scale`.
    fn placement(
        self,
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        poles: &[Complex<f64>],
        scale: &DVector<f64>,
        demand: &Demand,
    ) -> Result<Placement, Error> {
        let condition_in = |coordinates: &DVector<f64>| {
            let units = coordinates.component_div(&self.units);
            condition(&self.problem.unit_eigenvectors(&self.directions, &units))
        };
        let quality = Quality {
            condition: condition_in(&DVector::from_element(a.nrows(), 1.0))?,
            balanced_condition: condition_in(scale)?,
            pole_error: demand.pole_error(a, b, &self.gain, poles)?,
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
