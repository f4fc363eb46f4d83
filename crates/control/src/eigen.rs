//! Eigenvalues of a real square matrix.

mod complex;
mod francis;
mod hamiltonian;
mod rank_one;

use crate::balance::Balance;
use crate::check::as_number;
use crate::{Error, check};
pub(crate) use complex::complex_eigenvalues;
pub(crate) use hamiltonian::Hamiltonian;
use nalgebra::{Complex, ComplexField, DMatrix, DVector, Dyn, Schur};
pub(crate) use rank_one::RankOne;

const QR_ALGORITHM: &str = "the QR algorithm for eigenvalues";

/// Largest number of QR iterations per row of the matrix; two or three are usual.
const ITERATIONS_PER_ROW: usize = 100;

/// Fractions of the neighbours on the diagonal below which an entry below the diagonal counts as zero. The second one
/// is used if the QR algorithm does not converge with the first one: between equal eigenvalues the rounding errors are
/// relative to the norm of the matrix.
const ZERO: [f64; 2] = [f64::EPSILON, 256.0 * f64::EPSILON];

/// From this order on eigenvalues are computed without the Schur form.
const LARGE: usize = 48;

/// The eigenvalues of A, ordered by real part, then by imaginary part.
///
/// `a`: n x n, finite. Method: eigenvalues that a permutation of the states isolates on the diagonal, then diagonal
/// balancing (both Parlett and Reinsch 1969) and the QR algorithm with a bounded number of iterations: with the Schur
/// form, about 25 n^3 operations, or without it, 10 n^3, from order 48 on. If one form of the algorithm fails, the other
/// is tried, then the Schur form of a reflected A. The result is exact for a matrix that differs from the balanced A by a
/// few units of rounding of its norm. Complex eigenvalues are exact conjugates.
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let oscillator = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -25.0, -6.0]);
/// let eigenvalues = control::eigen::eigenvalues(&oscillator)?;
/// assert!((eigenvalues[0].re + 3.0).abs() < 1e-14);
/// assert!((eigenvalues[0].im + 4.0).abs() < 1e-14);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad `a`; [`Error::NotConverged`]
/// when no form of the QR algorithm converges within its limit, for the Schur form 100 iterations per
/// row.
pub fn eigenvalues(a: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    check::square("A", a)?;
    let (mut eigenvalues, rest) = isolated(a);
    if !rest.is_empty() {
        eigenvalues.extend(by_qr(&rest)?);
    }
    eigenvalues.sort_by(|x, y| x.re.total_cmp(&y.re).then(x.im.total_cmp(&y.im)));
    Ok(eigenvalues)
}

/// Returns the eigenvalues that stand on the diagonal, and the rest of A without their rows and columns: one after the
/// other, states that act on no other state or on which no other state acts. Those of a chain of integrators are exactly
/// zero; the QR algorithm would give the root of a rounding error.
fn isolated(a: &DMatrix<f64>) -> (Vec<Complex<f64>>, DMatrix<f64>) {
    let mut rest: Vec<usize> = (0..a.nrows()).collect();
    let mut eigenvalues = Vec::new();
    let is_isolated = |state: usize, rest: &[usize]| {
        let are_zero = |entry: &dyn Fn(usize) -> f64| {
            rest.iter().all(|other| *other == state || entry(*other) == 0.0)
        };
        are_zero(&|other| a[(state, other)]) || are_zero(&|other| a[(other, state)])
    };
    while let Some(position) = rest.iter().position(|state| is_isolated(*state, &rest)) {
        let state = rest.remove(position);
        eigenvalues.push(Complex::new(a[(state, state)], 0.0));
    }
    (eigenvalues, a.select_rows(&rest).select_columns(&rest))
}

/// The eigenvalues of A by balancing and the QR algorithm.
fn by_qr(a: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    let balanced = Balance::new(a).matrix;
    let without_form = || francis::eigenvalues(balanced.clone().hessenberg().unpack_h());
    let of_form = |m: &DMatrix<f64>| schur(m).map(|form| diagonal_blocks(&form.unpack().1));
    match (a.nrows() >= LARGE).then(without_form).flatten() {
        Some(eigenvalues) => Ok(eigenvalues),
        None => of_form(&balanced).or_else(|error| without_form().ok_or(error)).or_else(|_| {
            let h = reflection(balanced.nrows());
            of_form(&(&h * &balanced * &h))
        }),
    }
}

/// Computes the Schur form within 100 iterations per row.
///
/// # Errors
///
/// [`Error::NotConverged`].
pub(crate) fn schur<T>(m: &DMatrix<T>) -> Result<Schur<T, Dyn>, Error>
where
    T: ComplexField<RealField = f64>,
{
    let iterations = ITERATIONS_PER_ROW * m.nrows();
    let form = ZERO.iter().find_map(|&zero| Schur::try_new(m.clone(), zero, iterations));
    form.ok_or(Error::NotConverged { what: QR_ALGORITHM, iterations })
}

/// The reflection H = I - 2 v v' / (v'v), v = (1, 1/2, 1/3, ...), as a similarity H M H.
///
/// The shifts of the QR algorithm do not converge on some matrices with many symmetries, permutations and delays for
/// example. The reflection breaks the symmetry and preserves the eigenvalues.
pub(crate) fn reflection(order: usize) -> DMatrix<f64> {
    let v = DVector::from_fn(order, |i, _| 1.0 / as_number(i + 1));
    DMatrix::identity(order, order) - &v * v.transpose() * (2.0 / v.norm_squared())
}

/// Eigenvalues of a real block triangular matrix with blocks of order one and two.
fn diagonal_blocks(t: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let n = t.nrows();
    let mut eigenvalues = Vec::with_capacity(n);
    let mut row = 0;
    while row < n {
        if row + 1 < n && t[(row + 1, row)] != 0.0 {
            eigenvalues.extend(pair(t, row));
            row += 2;
        } else {
            eigenvalues.push(Complex::new(t[(row, row)], 0.0));
            row += 1;
        }
    }
    eigenvalues
}

/// Eigenvalues of the block [a, b; c, d] on the diagonal of M from row `at` on, without cancellation.
fn pair(m: &DMatrix<f64>, at: usize) -> [Complex<f64>; 2] {
    let (a, b) = (m[(at, at)], m[(at, at + 1)]);
    let (c, d) = (m[(at + 1, at)], m[(at + 1, at + 1)]);
    let half = 0.5 * (a - d);
    let discriminant = half * half + b * c;
    if discriminant < 0.0 {
        let imaginary = (-discriminant).sqrt();
        return [Complex::new(d + half, -imaginary), Complex::new(d + half, imaginary)];
    }
    let z = half + discriminant.sqrt().copysign(half);
    let other = if z == 0.0 { d } else { d - b * c / z };
    [Complex::new(d + z, 0.0), Complex::new(other, 0.0)]
}
