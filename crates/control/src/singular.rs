//! Singular values by one-sided rotations.
//!
//! One decomposition serves ranks, null spaces, least squares and condition numbers. It finds the
//! small singular values of a matrix with badly scaled columns to full relative precision, and it
//! always ends.

use crate::Error;
use crate::balance::power_of_two;
use nalgebra::{Complex, DMatrix, DVector};

const SWEEPS: usize = 60;
/// Columns below this part of the largest are zero.
const NOTHING: f64 = 1e-40;

/// M V = U S with V square and orthogonal, U S with orthogonal columns, S descending.
///
/// M may have any shape. With more columns than rows the last values are zero and the last columns
/// of V span the null space. Hestenes (1958); accuracy: Demmel and Veselic (1992). Cost: about
/// 10 rows columns^2 multiplications per sweep, 5 to 10 sweeps.
pub(crate) struct Singular {
    /// Orthonormal columns u of U; zero where the singular value is zero.
    pub(crate) left: DMatrix<f64>,
    /// One value per column of M, descending.
    pub(crate) values: DVector<f64>,
    /// Columns v of V.
    pub(crate) right: DMatrix<f64>,
}

impl Singular {
    pub(crate) fn of(m: &DMatrix<f64>) -> Result<Self, Error> {
        let cols = m.ncols();
        let unit = power_of_two(m.amax());
        let unit = if unit.is_normal() { unit } else { 1.0 };
        let mut images = m / unit;
        let mut right = DMatrix::identity(cols, cols);
        let nothing = NOTHING * images.norm();
        for _ in 0..SWEEPS {
            let mut rotated = false;
            for first in 0..cols {
                for second in first + 1..cols {
                    if let Some((c, s)) = rotation(&images, first, second, nothing) {
                        rotate(&mut images, first, second, c, s);
                        rotate(&mut right, first, second, c, s);
                        rotated = true;
                    }
                }
            }
            if !rotated {
                return Ok(sorted(&images, &right, unit));
            }
        }
        Err(Error::NotConverged { what: "the singular value iteration", iterations: SWEEPS })
    }

    /// Number of singular values above `tolerance` times the largest.
    pub(crate) fn rank(&self, tolerance: f64) -> usize {
        self.values.iter().filter(|&&value| value > tolerance * self.values[0]).count()
    }

    /// Largest over smallest singular value.
    pub(crate) fn condition(&self) -> f64 {
        self.values[0] / self.values[self.values.len() - 1]
    }

    /// V1 S1^-1 of the leading `rank` singular values: M times it has orthonormal columns.
    pub(crate) fn whitening(&self, rank: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.right.nrows(), rank, |i, j| self.right[(i, j)] / self.values[j])
    }

    /// The shortest X with the least norm of M X - B, singular values from `rank` on taken as zero.
    pub(crate) fn least_squares(&self, b: &DMatrix<f64>, rank: usize) -> DMatrix<f64> {
        self.whitening(rank) * self.left.columns(0, rank).transpose() * b
    }
}

/// One of the smallest singular values of a complex matrix and its right singular vector.
///
/// `index` 0 is the smallest, 1 the one before it, and so on. A matrix M = R + i J is decomposed as
/// the real [R, -J; J, R], which has each singular value twice.
pub(crate) fn smallest(
    m: &DMatrix<Complex<f64>>,
    index: usize,
) -> Result<(f64, DVector<Complex<f64>>), Error> {
    let (rows, cols) = m.shape();
    if m.iter().all(|entry| entry.im.abs() <= 0.0) {
        let real = Singular::of(&m.map(|entry| entry.re))?;
        let at = cols - 1 - index;
        return Ok((real.values[at], real.right.column(at).map(|x| Complex::new(x, 0.0))));
    }
    let real = DMatrix::from_fn(2 * rows, 2 * cols, |i, j| {
        let entry = m[(i % rows, j % cols)];
        match (i < rows, j < cols) {
            (true, true) | (false, false) => entry.re,
            (true, false) => -entry.im,
            (false, true) => entry.im,
        }
    });
    let both = Singular::of(&real)?;
    let at = 2 * (cols - 1 - index);
    let vector = DVector::from_fn(cols, |i, _| {
        Complex::new(both.right[(i, at)], both.right[(i + cols, at)])
    });
    Ok((both.values[at], vector))
}

/// Cosine and sine that make two columns orthogonal and put the longer one first; None if they are.
fn rotation(m: &DMatrix<f64>, first: usize, second: usize, nothing: f64) -> Option<(f64, f64)> {
    let (a, b) = (m.column(first), m.column(second));
    let (long, short) = (a.norm(), b.norm());
    if short <= nothing && long >= short {
        return None;
    }
    if long <= nothing {
        return Some((0.0, -1.0));
    }
    let cosine = a.dot(&b) / (long * short);
    if cosine.abs() <= f64::EPSILON * rounding_growth(m.nrows()) {
        return if short > long { Some((0.0, -1.0)) } else { None };
    }
    let zeta = (short / long - long / short) / (2.0 * cosine);
    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let c = 1.0 / tangent.hypot(1.0);
    Some((c, c * tangent))
}

/// The rounding error of a dot product grows with its length.
fn rounding_growth(length: usize) -> f64 {
    f64::from(u32::try_from(length.max(4)).unwrap_or(u32::MAX))
}

/// Columns a, b become c a - s b, s a + c b.
fn rotate(m: &mut DMatrix<f64>, first: usize, second: usize, c: f64, s: f64) {
    for row in 0..m.nrows() {
        let (a, b) = (m[(row, first)], m[(row, second)]);
        m[(row, first)] = c * a - s * b;
        m[(row, second)] = s * a + c * b;
    }
}

fn sorted(images: &DMatrix<f64>, right: &DMatrix<f64>, unit: f64) -> Singular {
    let norms: Vec<f64> = images.column_iter().map(|column| column.norm()).collect();
    let mut order: Vec<usize> = (0..norms.len()).collect();
    order.sort_by(|&i, &j| norms[j].total_cmp(&norms[i]));
    let left = DMatrix::from_fn(images.nrows(), norms.len(), |i, j| {
        let norm = norms[order[j]];
        if norm > 0.0 { images[(i, order[j])] / norm } else { 0.0 }
    });
    Singular {
        left,
        values: DVector::from_fn(norms.len(), |j, _| norms[order[j]] * unit),
        right: right.select_columns(&order),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rebuilt(s: &Singular) -> DMatrix<f64> {
        &s.left * DMatrix::from_diagonal(&s.values) * s.right.transpose()
    }

    #[test]
    fn tall_wide_and_rank_deficient_integer_matrices_are_rebuilt() {
        let tall = DMatrix::from_row_slice(4, 3, &[1., 2., 3., 2., 4., 6., 1., 0., 1., 0., 2., 2.]);
        for m in [tall.clone(), tall.transpose(), DMatrix::zeros(2, 3)] {
            let s = Singular::of(&m).unwrap();
            let size = m.norm().max(1.0);
            assert!((rebuilt(&s) - &m).norm() < 1e-14 * size);
            let identity = DMatrix::identity(m.ncols(), m.ncols());
            assert!((s.right.transpose() * &s.right - identity).norm() < 1e-14);
        }
        assert_eq!(Singular::of(&tall).unwrap().rank(1e-12), 2);
    }

    /// Singular values of diag(1, 1e-9, 1e-18) times a rotation are those of the diagonal.
    #[test]
    fn tiny_singular_values_of_badly_scaled_columns_keep_their_relative_precision() {
        let (c, s) = (0.6, 0.8);
        let q = DMatrix::from_row_slice(3, 3, &[c, -s, 0., s, c, 0., 0., 0., 1.])
            * DMatrix::from_row_slice(3, 3, &[1., 0., 0., 0., c, -s, 0., s, c]);
        let d = [1.0, 1e-9, 1e-18];
        let m = DMatrix::from_fn(3, 3, |i, j| q[(i, j)] * d[j]);
        let values = Singular::of(&m).unwrap().values;
        for (value, exact) in values.iter().zip(d) {
            assert!((value / exact - 1.0).abs() < 1e-14, "{value} {exact}");
        }
    }

    #[test]
    fn least_squares_solves_the_normal_equations_with_the_shortest_solution() {
        let m = DMatrix::from_row_slice(3, 2, &[1., 2., 2., 4., 0., 0.]);
        let b = DMatrix::from_row_slice(3, 1, &[1., 2., 5.]);
        let x = Singular::of(&m).unwrap().least_squares(&b, 1);
        assert!((x - DMatrix::from_row_slice(2, 1, &[0.2, 0.4])).norm() < 1e-15);
    }
}
