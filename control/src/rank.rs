//! Controllability and observability.

use crate::balance::{Balance, divide_rows, unit_columns};
use crate::singular::Singular;
use crate::{Error, check};
use nalgebra::DMatrix;

/// What is zero in a rank decision, relative to the norm of the scaled matrix, per state.
const TOLERANCE_PER_STATE: f64 = 100.0 * f64::EPSILON;

/// The answer of a rank decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rank {
    /// Dimension of the controllable subspace or of the observable quotient.
    pub rank: usize,
    /// Number of states; the pair is controllable or observable when `rank` equals it.
    pub n: usize,
    /// Singular values at or below this count as zero, relative to the scaled matrix.
    pub tolerance: f64,
    /// The smallest relative singular value that counted as not zero: how near the rank is to
    /// being lower. Zero when the rank is zero.
    pub margin: f64,
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
/// giving each input unit length. About 20 n^3 multiplications. Tolerance: 100 n eps, relative to
/// the norm of the scaled B in the first step and to that of the balanced A in the others.
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
    let n = check::square("A", a)?;
    check::shape("B", b, (n, b.ncols()))?;
    staircase(a, b)
}

/// Rank of the observability matrix [C; C A; ...; C A^(n-1)] of x' = A x, y = C x.
///
/// `a`: n x n; `c`: p x n. Computed as the controllability of (A', C'), with its method and
/// tolerance.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix,
/// [`Error::NotConverged`] when a singular value iteration does not end.
pub fn observability(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Rank, Error> {
    let n = check::square("A", a)?;
    check::shape("C", c, (c.nrows(), n))?;
    staircase(&a.transpose(), &c.transpose())
}

/// Refuses a pair that is not controllable.
pub(crate) fn require_controllable(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Rank, Error> {
    let found = controllability(a, b)?;
    if found.is_full() {
        return Ok(found);
    }
    Err(Error::NotControllable { rank: found.rank, n: found.n })
}

/// Refuses a pair that is not observable.
pub(crate) fn require_observable(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Rank, Error> {
    let found = observability(a, c)?;
    if found.is_full() {
        return Ok(found);
    }
    Err(Error::NotObservable { rank: found.rank, n: found.n })
}

fn staircase(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Rank, Error> {
    let n = a.nrows();
    let balance = Balance::of(a);
    let mut rest = balance.matrix;
    let mut link = unit_columns(&divide_rows(b, &balance.scale));
    #[expect(clippy::cast_precision_loss, reason = "a matrix order is far below 2^52")]
    let tolerance = TOLERANCE_PER_STATE * n as f64;
    let mut answer = Rank { rank: 0, n, tolerance, margin: f64::INFINITY };
    let size = rest.norm();
    let mut reference = link.norm();
    while !rest.is_empty() {
        let step = Singular::of(&link.transpose())?;
        let kept = step.values.iter().filter(|&&value| value > tolerance * reference).count();
        if kept == 0 {
            break;
        }
        answer.rank += kept;
        answer.margin = answer.margin.min(step.values[kept - 1] / reference);
        let turned = step.right.transpose() * &rest * &step.right;
        let left = turned.nrows() - kept;
        link = turned.view((kept, 0), (left, kept)).into();
        rest = turned.view((kept, kept), (left, left)).into();
        reference = size;
    }
    if answer.rank == 0 {
        answer.margin = 0.0;
    }
    Ok(answer)
}
