//! Controllability and observability: the rank decision, the uncontrollable and the unobservable modes.
//!
//! [`crate::distance`] measures the distance of a pair from the nearest uncontrollable or unobservable pair.

mod part;
mod staircase;

pub use part::{ControllablePart, controllable_part};
pub(crate) use staircase::Staircase;

use crate::blocks::to_complex;
use crate::eigen::eigenvalues;
use crate::svd::ComplexSvd;
use crate::{Error, check};
use nalgebra::{Complex, DMatrix, DVector};

/// A state is dominant in a mode if its entry in the eigenvector is above this fraction of the largest entry.
const DOMINANT: f64 = 0.5;

/// The result of a rank decision.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Rank {
    /// Rank of the controllability or observability matrix.
    pub rank: usize,
    /// Number of states n; the pair is controllable or observable when `rank` equals n.
    pub n: usize,
    /// Singular values relative to the scaled matrix that are at most this count as zero.
    pub tolerance: f64,
    /// The smallest relative singular value that counted as nonzero. The nearer it is to
    /// `tolerance`, the less certain the rank. Zero when the rank is zero.
    pub margin: f64,
}

/// An uncontrollable or unobservable mode of x' = A x.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Mode {
    /// The eigenvalue of the mode.
    pub eigenvalue: Complex<f64>,
    /// An eigenvector of length one in the given coordinates, its largest entry real and positive. For an unobservable
    /// mode v with A v = s v, C v = 0: the measurements do not show a motion along v. For an uncontrollable mode w with
    /// w' A = s w', w' B = 0: no input moves w' x.
    pub vector: DVector<Complex<f64>>,
    /// Indices, from zero, of the states whose entries of the vector, in balanced coordinates, are
    /// at least half of the largest one; largest first.
    pub dominant: Vec<usize>,
}

impl Rank {
    /// Whether the rank is full.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.rank == self.n
    }
}

/// Rank of the controllability matrix [B, A B, ..., A^(n-1) B] of x' = A x + B u.
///
/// `a`: n x n; `b`: n x m. The powers of A are never formed: the staircase algorithm reduces (A, B)
/// by orthogonal transformations and adds up the ranks of its steps, after balancing the states and
/// giving each input unit length. If this rank is not full, it is also computed without balancing, and with a scale of
/// the states that act on no others, and the largest rank counts. Each computation has about 20 n^3 multiplications.
/// Tolerance: 100 n eps, relative to the norm of the scaled B in the first step and to the norm of the balanced A in the
/// other steps; 4 eps for the only effects on a state that acts on no others.
///
/// Source: C. C. Paige, Properties of numerical algorithms related to computing controllability,
/// IEEE Trans. Autom. Control 26 (1981), section IV.
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
/// let force = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
/// assert!(control::rank::controllability(&a, &force)?.is_full());
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix,
/// [`Error::NotConverged`] when a singular value iteration does not end.
pub fn controllability(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Rank, Error> {
    check::with_inputs(a, b)?;
    Ok(Staircase::new(a, b)?.decision)
}

/// Rank of the observability matrix [C; C A; ...; C A^(n-1)] of x' = A x, y = C x.
///
/// `a`: n x n; `c`: p x n. Method, tolerance: [`controllability`] of (A', C').
///
/// # Errors
///
/// Same as [`controllability`].
pub fn observability(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Rank, Error> {
    check::with_outputs(a, c)?;
    Ok(Staircase::new(&a.transpose(), &c.transpose())?.decision)
}

/// Checks that (A, B) is controllable; otherwise [`Error::NotControllable`], or an error of [`controllability`].
pub(crate) fn require_controllable(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Rank, Error> {
    let rank = controllability(a, b)?;
    if rank.is_full() {
        return Ok(rank);
    }
    Err(Error::NotControllable { rank: rank.rank, n: rank.n })
}

/// Checks that (A, C) is observable; otherwise [`Error::NotObservable`], or an error of [`observability`].
pub(crate) fn require_observable(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<(), Error> {
    let rank = observability(a, c)?;
    if rank.is_full() {
        return Ok(());
    }
    Err(Error::NotObservable { rank: rank.rank, n: rank.n })
}

/// The uncontrollable modes of x' = A x + B u; their number is n minus the rank.
///
/// `a`: n x n; `b`: n x m. They are the eigenvalues of the uncontrollable block of the staircase
/// form, so that their number agrees with [`controllability`]. A multiple eigenvalue with a single
/// eigenvector is returned as often as it occurs, with the same vector. Method and tolerance: see
/// [`controllability`] and [`eigenvalues`].
///
/// # Errors
///
/// Same as [`controllability`].
pub fn uncontrollable_modes(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Vec<Mode>, Error> {
    check::with_inputs(a, b)?;
    modes_of(&Staircase::new(a, b)?)
}

/// The unobservable modes of x' = A x, y = C x; their number is n minus the rank.
///
/// `a`: n x n; `c`: p x n. Method: [`uncontrollable_modes`] of (A', C').
///
/// # Example
///
/// A cart of which only the velocity is measured; its position is unobservable:
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, -3.0]);
/// let velocity = DMatrix::from_row_slice(1, 2, &[0.0, 1.0]);
/// let modes = control::rank::unobservable_modes(&a, &velocity)?;
/// assert_eq!(modes.len(), 1);
/// assert_eq!(modes[0].dominant, [0]);
/// assert!(modes[0].eigenvalue.norm() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`observability`].
pub fn unobservable_modes(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Vec<Mode>, Error> {
    check::with_outputs(a, c)?;
    modes_of(&Staircase::new(&a.transpose(), &c.transpose())?)
}

/// The uncontrollable modes of the pair with this staircase form; none if the pair is controllable.
fn modes_of(staircase: &Staircase) -> Result<Vec<Mode>, Error> {
    if staircase.decision.is_full() {
        return Ok(Vec::new());
    }
    let transposed = to_complex(&staircase.uncontrollable.transpose());
    let values = eigenvalues(&staircase.uncontrollable)?;
    let tolerance = staircase.decision.tolerance.sqrt() * (1.0 + staircase.uncontrollable.norm());
    let mode = |(at, &eigenvalue): (usize, &Complex<f64>)| {
        let is_equal = |other: &&Complex<f64>| (*other - eigenvalue).norm() <= tolerance;
        let earlier = values[..at].iter().filter(is_equal);
        let order = transposed.nrows();
        let shifted = &transposed - DMatrix::identity(order, order) * eigenvalue;
        let svd = ComplexSvd::new(&shifted)?;
        let (value, vector) = svd.nth_smallest(earlier.count());
        let vector = if value <= tolerance { vector } else { svd.nth_smallest(0).1 };
        Ok(mode_in_given_coordinates(eigenvalue, staircase, &vector))
    };
    values.iter().enumerate().map(mode).collect()
}

/// Creates the mode whose left eigenvector has these coordinates in the basis of the uncontrollable states.
fn mode_in_given_coordinates(
    eigenvalue: Complex<f64>,
    staircase: &Staircase,
    coordinates: &DVector<Complex<f64>>,
) -> Mode {
    let balanced = to_complex(&staircase.uncontrollable_basis) * coordinates;
    let size = |state: usize| balanced[state].norm();
    let mut dominant: Vec<usize> = (0..balanced.len()).collect();
    dominant.sort_by(|&i, &j| size(j).total_cmp(&size(i)));
    let largest = size(dominant[0]);
    dominant.retain(|&state| size(state) >= DOMINANT * largest);
    let original = balanced.zip_map(&staircase.scale, |entry, scale| entry / scale);
    Mode { eigenvalue, vector: normalised(&original), dominant }
}

/// Scales a vector to length one with its largest entry real and positive.
fn normalised(v: &DVector<Complex<f64>>) -> DVector<Complex<f64>> {
    let largest = v.iter().fold(Complex::new(0.0, 0.0), |most: Complex<f64>, entry| {
        if entry.norm() > most.norm() { *entry } else { most }
    });
    let factor = largest.conj() / (largest.norm() * v.norm());
    v.map(|entry| entry * factor)
}
