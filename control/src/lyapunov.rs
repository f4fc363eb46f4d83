//! The continuous Lyapunov equation.

use crate::balance::{Balance, multiply_columns, multiply_rows};
use crate::eigen::{schur, spectral_abscissa};
use crate::singular::Singular;
use crate::{Error, check};
use nalgebra::{Complex, DMatrix};

/// Largest residual of a solution that is returned, see [`Solution::residual`].
const ALLOWED_RESIDUAL: f64 = 1e-10;
const REFINEMENTS: usize = 2;

/// P with A' P + P A = -Q.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// P, n x n, symmetric.
    pub p: DMatrix<f64>,
    /// Largest entry of |A' P + P A + Q| relative to the same entry of |A'| |P| + |P| |A| + |Q|.
    pub residual: f64,
    /// Norm of A' P + P A + Q relative to the norm of Q (Frobenius). For a badly scaled A the
    /// rounding of P alone keeps it far above the rounding error; below 1 / sqrt(n) with Q = I it
    /// still shows A Hurwitz.
    pub defect: f64,
}

/// Solves A' P + P A = -Q.
///
/// `a`: n x n, Hurwitz; `q`: n x n, symmetric. The solution exists and is unique, and is symmetric
/// positive definite when Q is. Method: balancing of A, complex Schur form, substitution (Bartels
/// and Stewart), refinement; about 100 n^3 multiplications. Every entry of the residual is at most
/// 1e-10 of the sum of the absolute terms it is made of.
///
/// Source: R. H. Bartels and G. W. Stewart, Solution of the matrix equation A X + X B = C, Comm.
/// ACM 15 (1972), algorithm 432.
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[-1.0, 1.0, 0.0, -2.0]);
/// let solution = control::lyapunov::lyapunov(&a, &DMatrix::identity(2, 2))?;
/// let expected = DMatrix::from_row_slice(2, 2, &[6.0, 2.0, 2.0, 4.0]) / 12.0;
/// assert!((solution.p - expected).amax() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::NotSymmetric`] for a bad
/// matrix; [`Error::NotHurwitz`]; [`Error::NotConverged`] when the Schur form is not found;
/// [`Error::Overflow`]; [`Error::ResidualTooLarge`].
pub fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<Solution, Error> {
    let n = check::square("A", a)?;
    check::shape("Q", q, (n, n))?;
    symmetric("Q", q)?;
    let abscissa = spectral_abscissa(a)?;
    if abscissa >= 0.0 {
        return Err(Error::NotHurwitz { matrix: "A", abscissa });
    }
    let Balance { matrix, scale } = Balance::of(a);
    let scaled_q = multiply_rows(&multiply_columns(q, &scale), &scale);
    let triangular = Triangular::of(&matrix)?;
    let mut p = triangular.solve(&scaled_q);
    for _ in 0..REFINEMENTS {
        p += triangular.solve(&left_side(&matrix, &p, &scaled_q));
    }
    p = (&p + p.transpose()) * 0.5;
    let p = DMatrix::from_fn(n, n, |i, j| p[(i, j)] / scale[i] / scale[j]);
    verified(a, check::in_range("P", p)?, q)
}

/// The smallest and the largest eigenvalue of a symmetric positive definite matrix.
///
/// `p`: n x n, symmetric. Method: Cholesky factor, squares of its singular values; about 50 n^3
/// multiplications. A matrix whose smallest eigenvalue is within the rounding error of its scaled
/// entries may be refused.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::NotSymmetric`] for a bad
/// matrix; [`Error::NotPositiveDefinite`]; [`Error::NotConverged`].
pub fn definite_range(p: &DMatrix<f64>) -> Result<(f64, f64), Error> {
    check::square("P", p)?;
    symmetric("P", p)?;
    let factor = p.clone().cholesky().ok_or(Error::NotPositiveDefinite { matrix: "P" })?.l();
    let values = Singular::of(&factor.transpose())?.values;
    Ok((values[values.len() - 1].powi(2), values[0].powi(2)))
}

fn symmetric(matrix: &'static str, m: &DMatrix<f64>) -> Result<(), Error> {
    let allowed = f64::EPSILON * m.amax();
    for col in 0..m.ncols() {
        for row in 0..col {
            if (m[(row, col)] - m[(col, row)]).abs() > allowed {
                return Err(Error::NotSymmetric { matrix, row: row + 1, col: col + 1 });
            }
        }
    }
    Ok(())
}

/// A' P + P A + Q.
fn left_side(a: &DMatrix<f64>, p: &DMatrix<f64>, q: &DMatrix<f64>) -> DMatrix<f64> {
    a.tr_mul(p) + p * a + q
}

fn verified(a: &DMatrix<f64>, p: DMatrix<f64>, q: &DMatrix<f64>) -> Result<Solution, Error> {
    let remainder = left_side(a, &p, q);
    let terms = left_side(&a.abs(), &p.abs(), &q.abs());
    let relative = remainder.zip_map(&terms, |r, t| if t > 0.0 { r.abs() / t } else { 0.0 });
    let residual = relative.amax();
    if residual > ALLOWED_RESIDUAL {
        let equation = "A' P + P A = -Q";
        return Err(Error::ResidualTooLarge { equation, residual, allowed: ALLOWED_RESIDUAL });
    }
    let size = q.norm();
    let defect = if size > 0.0 { remainder.norm() / size } else { remainder.norm() };
    Ok(Solution { p, residual, defect })
}

/// A = U T U*, T upper triangular.
struct Triangular {
    u: DMatrix<Complex<f64>>,
    t: DMatrix<Complex<f64>>,
}

impl Triangular {
    fn of(a: &DMatrix<f64>) -> Result<Self, Error> {
        let (u, t) = schur(&a.map(|entry| Complex::new(entry, 0.0)))?.unpack();
        Ok(Self { u, t })
    }

    /// T* Y + Y T = -U* Q U column by column, forward in the rows; P = Re(U Y U*).
    fn solve(&self, q: &DMatrix<f64>) -> DMatrix<f64> {
        let (u, t) = (&self.u, &self.t);
        let n = t.nrows();
        let mut y = -(u.adjoint() * q.map(|entry| Complex::new(entry, 0.0)) * u);
        for col in 0..n {
            for row in 0..n {
                let mut sum = y[(row, col)];
                for k in 0..col {
                    sum -= y[(row, k)] * t[(k, col)];
                }
                for k in 0..row {
                    sum -= t[(k, row)].conj() * y[(k, col)];
                }
                y[(row, col)] = sum / (t[(row, row)].conj() + t[(col, col)]);
            }
        }
        (u * y * u.adjoint()).map(|entry| entry.re)
    }
}
