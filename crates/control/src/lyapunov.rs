//! The Lyapunov equations of continuous and of sampled time.

mod doubling;
mod triangular;

use crate::balance::{Balance, divide_columns, divide_rows, multiplied};
use crate::blocks::symmetric_part;
use crate::svd::Svd;
use crate::{Domain, Error, check, stability};
use doubling::solve_by_doubling;
use nalgebra::DMatrix;
use triangular::Triangular;

/// Largest residual of a solution that is returned, see [`Solution::residual`].
const ALLOWED_RESIDUAL: f64 = 1e-9;
const REFINEMENTS: usize = 2;
/// From this order on the equations are solved by doubling first.
const LARGE: usize = 48;
/// A solution with a residual above this is compared with the solution of a second method.
const GOOD_RESIDUAL: f64 = 1e-12;

/// The solution P of A' P + P A = -Q or A' P A - P = -Q.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Solution {
    /// P, n x n, symmetric.
    pub p: DMatrix<f64>,
    /// The largest entry of |A' P + P A + Q| relative to the same entry of |A'| |P| + |P| |A| +
    /// |Q|; in sampled time of |A' P A - P + Q| relative to |A'| |P| |A| + |P| + |Q|. Here
    /// `|P|[i,j]` is at least the root of `P[i,i] P[j,j]`.
    pub residual: f64,
    /// Norm of the left side plus Q relative to the norm of Q (Frobenius); for Q = 0 the norm itself. For a badly
    /// scaled A, rounding of P alone makes the defect much larger than eps. With Q = I and a positive definite P, a
    /// defect below 1 / sqrt(n) proves A stable.
    pub defect: f64,
}

/// Solves A' P + P A = -Q.
///
/// `a`: n x n, Hurwitz; `q`: n x n, symmetric. The solution exists and is unique, and is symmetric
/// positive definite when Q is. Method: balancing of A, complex Schur form, substitution (Bartels
/// and Stewart), refinement; about 100 n^3 multiplications. From 48 states on, doubling after a Cayley transform (R. A.
/// Smith, SIAM J. Appl. Math. 16, 1968) is tried first: about 15 doublings of 3 n^3 multiplications each. If the
/// residual is above 1e-12, the other method is used, too, and the result with the smaller residual is returned. Every
/// entry of the residual is at most 1e-9 of the sum of its absolute terms.
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
    CONTINUOUS.solve_checked(a, q)
}

/// Solves A' P A - P = -Q.
///
/// `a`: n x n, Schur stable (every eigenvalue inside of the unit circle); `q`: n x n, symmetric. The solution exists
/// and is unique, and is symmetric positive definite when Q is: the sum of A'^k Q A^k over k from 0 on. Method:
/// balancing of A, complex Schur form, substitution, refinement; about 100 n^3 multiplications; from 48 states on
/// doubling first, as in [`lyapunov`]. Every entry of the residual is at most 1e-9 of the sum of its absolute terms.
///
/// Source: G. Kitagawa, An algorithm for solving the matrix equation X = F X F' + S, Int. J. Control 25 (1977).
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let half = DMatrix::from_element(1, 1, 0.5);
/// let solution = control::lyapunov::discrete_lyapunov(&half, &DMatrix::identity(1, 1))?;
/// assert!((solution.p[(0, 0)] - 4.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], [`Error::NotSymmetric`] for a bad
/// matrix; [`Error::NotSchur`]; [`Error::NotConverged`] when the Schur form is not found;
/// [`Error::Overflow`]; [`Error::ResidualTooLarge`].
pub fn discrete_lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<Solution, Error> {
    DISCRETE.solve_checked(a, q)
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
    let values = Svd::new(&factor.transpose())?.values;
    Ok((values[values.len() - 1].powi(2), values[0].powi(2)))
}

/// Checks that a square matrix differs from its transpose by at most one unit of rounding of its largest entry;
/// otherwise [`Error::NotSymmetric`].
pub(crate) fn symmetric(matrix: &'static str, m: &DMatrix<f64>) -> Result<(), Error> {
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

type LeftSide = fn(&DMatrix<f64>, &DMatrix<f64>, &DMatrix<f64>) -> DMatrix<f64>;

/// A Lyapunov equation of continuous or sampled time, written as remainder = 0.
pub(crate) struct Equation {
    name: &'static str,
    /// Computes A' P + P A + Q, or A' P A - P + Q, from A, P and Q.
    remainder: LeftSide,
    /// Computes the sum of the absolute terms from |A|, |P| and |Q|.
    terms: LeftSide,
    substitute: fn(&Triangular, &DMatrix<f64>) -> DMatrix<f64>,
    domain: Domain,
}

pub(crate) const CONTINUOUS: Equation = Equation {
    name: "A' P + P A = -Q",
    remainder: |a, p, q| a.tr_mul(p) + p * a + q,
    terms: |a, p, q| a.tr_mul(p) + p * a + q,
    substitute: Triangular::continuous,
    domain: Domain::Continuous,
};

pub(crate) const DISCRETE: Equation = Equation {
    name: "A' P A - P = -Q",
    remainder: |a, p, q| a.tr_mul(p) * a - p + q,
    terms: |a, p, q| a.tr_mul(p) * a + p + q,
    substitute: Triangular::discrete,
    domain: Domain::Sampled { period: 1.0 },
};

impl Equation {
    fn solve_checked(&self, a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<Solution, Error> {
        let n = check::square("A", a)?;
        check::shape("Q", q, (n, n))?;
        symmetric("Q", q)?;
        stability::require_stable("A", a, self.domain)?;
        let p = self.solve(a, q)?;
        let residual = self.residual(a, &p, q);
        if residual > ALLOWED_RESIDUAL {
            let (equation, allowed) = (self.name, ALLOWED_RESIDUAL);
            return Err(Error::ResidualTooLarge { equation, residual, allowed });
        }
        let (remainder, size) = ((self.remainder)(a, &p, q).norm(), q.norm());
        let defect = if size > 0.0 { remainder / size } else { remainder };
        Ok(Solution { p, residual, defect })
    }

    /// Computes P for a stable A and a symmetric Q, without a check of the arguments or of the residual;
    /// [`Error::NotConverged`] when the Schur form is not found, [`Error::Overflow`].
    pub(crate) fn solve(&self, a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
        let Balance { matrix, scale } = Balance::new(a);
        let scaled_q = multiplied(q, &scale);
        let by_doubling = || solve_by_doubling(&matrix, &scaled_q, self.domain, self.remainder);
        let by_schur_form = || self.by_schur_form(&matrix, &scaled_q);
        let residual = |p: &DMatrix<f64>| self.residual(&matrix, p, &scaled_q);
        let fast = (matrix.nrows() >= LARGE).then(by_doubling).flatten();
        let p = match fast {
            Some(p) if residual(&p) <= GOOD_RESIDUAL => p,
            _ => by_schur_form()?,
        };
        // Doubling adds terms of one sign, so that small entries beside large ones keep their precision.
        let p = match (residual(&p) > GOOD_RESIDUAL).then(by_doubling).flatten() {
            Some(other) if residual(&other) < residual(&p) => other,
            _ => p,
        };
        check::in_range("P", divide_columns(&divide_rows(&p, &scale), &scale))
    }

    fn by_schur_form(&self, a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
        let triangular = Triangular::new(a)?;
        let mut p = (self.substitute)(&triangular, q);
        for _ in 0..REFINEMENTS {
            p += (self.substitute)(&triangular, &(self.remainder)(a, &p, q));
        }
        Ok(symmetric_part(&p))
    }

    /// Computes [`Solution::residual`].
    fn residual(&self, a: &DMatrix<f64>, p: &DMatrix<f64>, q: &DMatrix<f64>) -> f64 {
        relative(&(self.remainder)(a, p, q), &(self.terms)(&a.abs(), &sizes(p), &q.abs()))
    }
}

/// |P| with entries of at least the root of `P[i,i] P[j,j]`, so that an entry that is zero in theory counts
/// with the size of its rounding error.
pub(crate) fn sizes(p: &DMatrix<f64>) -> DMatrix<f64> {
    let root = p.map_diagonal(|entry| entry.abs().sqrt());
    let size = |i: usize, j: usize| (root[i] * root[j]).max(p[(i, j)].abs());
    DMatrix::from_fn(p.nrows(), p.ncols(), size)
}

/// The largest `|remainder[i,j]| / terms[i,j]` with `terms[i,j]` > 0; infinite if an entry of either is not finite.
pub(crate) fn relative(remainder: &DMatrix<f64>, terms: &DMatrix<f64>) -> f64 {
    if !remainder.iter().chain(terms).all(|entry| entry.is_finite()) {
        return f64::INFINITY;
    }
    remainder.zip_map(terms, |r, t| if t > 0.0 { r.abs() / t } else { 0.0 }).amax()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_that_is_not_a_number_is_infinite_wherever_it_is() {
        let good = DMatrix::from_element(2, 2, 1.0);
        for at in 0..good.len() {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut bad = good.clone();
                bad[at] = value;
                assert!(relative(&bad, &good).is_infinite() && relative(&good, &bad).is_infinite());
            }
        }
    }

    #[test]
    fn sizes_of_large_entries_are_their_geometric_means() {
        let p = DMatrix::from_row_slice(2, 2, &[1e200, 0.0, 0.0, 1e300]);
        let mean = sizes(&p)[(0, 1)];
        assert!((mean - 1e250).abs() < 1e236, "{mean}");
    }
}
