//! The singular value decomposition, by one-sided Jacobi rotations.
//!
//! The decomposition gives ranks, null spaces, least-squares solutions and condition numbers. Small singular values of
//! a matrix with badly scaled columns have full relative precision, and the number of iterations is bounded.

use crate::Error;
use crate::balance::power_of_two_or_one;
use crate::check::as_number;
use nalgebra::{Complex, DMatrix, DVector};

/// Largest number of sweeps; 5 to 10 are usual.
const SWEEPS: usize = 60;
/// A column shorter than this, relative to the Frobenius norm, counts as zero.
const NEGLIGIBLE: f64 = 1e-40;

/// The decomposition M = U S V', V orthogonal, S diagonal and descending.
///
/// M is r x c, of any shape. The columns of U are orthonormal where the singular values are not
/// negligible. Where c > r at least c - r singular values are negligible, below 1e-40 of the norm, and
/// the last columns of V span the null space. Cost: about 10 r c^2 multiplications per sweep.
///
/// Source: M. R. Hestenes, Inversion of matrices by biorthogonalization, J. SIAM 6 (1958); the
/// accuracy: J. Demmel and K. Veselic, Jacobi's method is more accurate than QR, SIAM J. Matrix
/// Anal. Appl. 13 (1992).
pub(crate) struct Svd {
    /// U, r x c, the left singular vectors; a column is zero where its singular value is zero.
    pub(crate) left: DMatrix<f64>,
    /// The c singular values, descending: the diagonal of S.
    pub(crate) values: DVector<f64>,
    /// V, c x c: the right singular vectors.
    pub(crate) right: DMatrix<f64>,
}

impl Svd {
    /// Decomposes `m`; [`Error::NotConverged`] after 60 sweeps, and for entries that are not finite.
    pub(crate) fn new(m: &DMatrix<f64>) -> Result<Self, Error> {
        let cols = m.ncols();
        let unit = power_of_two_or_one(m.amax());
        let mut images = m / unit;
        let mut right = DMatrix::identity(cols, cols);
        let negligible = NEGLIGIBLE * images.norm();
        // A single column needs no rotation: without this check, entries that are not finite would give no error.
        let sweeps = if negligible.is_finite() { SWEEPS } else { 0 };
        for _ in 0..sweeps {
            let mut rotated = false;
            for first in 0..cols {
                for second in first + 1..cols {
                    if let Some((c, s)) = rotation(&images, first, second, negligible) {
                        rotate(&mut images, first, second, c, s);
                        rotate(&mut right, first, second, c, s);
                        rotated = true;
                    }
                }
            }
            if !rotated {
                return Ok(assemble(&images, &right, unit));
            }
        }
        Err(Error::NotConverged { what: "the singular value iteration", iterations: SWEEPS })
    }

    /// Number of singular values above `tolerance` times the largest. M must have a column.
    pub(crate) fn rank(&self, tolerance: f64) -> usize {
        self.rank_above(tolerance * self.values[0])
    }

    /// Number of singular values above `threshold`.
    pub(crate) fn rank_above(&self, threshold: f64) -> usize {
        self.values.iter().filter(|&&value| value > threshold).count()
    }

    /// The condition number of M: its largest singular value over its smallest.
    pub(crate) fn condition(&self) -> f64 {
        self.values[0] / self.values[self.values.len() - 1]
    }

    /// The first `rank` columns of V S^-1. M times this matrix has orthonormal columns.
    pub(crate) fn whitening(&self, rank: usize) -> DMatrix<f64> {
        DMatrix::from_fn(self.right.nrows(), rank, |i, j| self.right[(i, j)] / self.values[j])
    }

    /// The X of least norm that minimises the norm of M X - B, where only the first `rank` singular
    /// values count.
    pub(crate) fn least_squares(&self, b: &DMatrix<f64>, rank: usize) -> DMatrix<f64> {
        self.whitening(rank) * self.left.columns(0, rank).transpose() * b
    }
}

/// The 2-norm of a matrix with at least one column: its largest singular value. The errors are those of [`Svd::new`].
pub(crate) fn norm_2(m: &DMatrix<f64>) -> Result<f64, Error> {
    Ok(Svd::new(m)?.values[0])
}

/// Singular values and right singular vectors of a complex matrix.
///
/// M = R + i J is decomposed as the real matrix [R, -J; J, R], which has each singular value of M twice;
/// a matrix with J = 0 as R.
pub(crate) struct ComplexSvd {
    real: Svd,
    /// How often each singular value of M occurs in `real`: 1 or 2.
    repeats: usize,
    cols: usize,
}

impl ComplexSvd {
    /// Decomposes `m`, with the errors of [`Svd::new`].
    pub(crate) fn new(m: &DMatrix<Complex<f64>>) -> Result<Self, Error> {
        let (rows, cols) = m.shape();
        if m.iter().all(|entry| entry.im.abs() <= 0.0) {
            let real = Svd::new(&m.map(|entry| entry.re))?;
            return Ok(Self { real, repeats: 1, cols });
        }
        let real = DMatrix::from_fn(2 * rows, 2 * cols, |i, j| {
            let entry = m[(i % rows, j % cols)];
            match (i < rows, j < cols) {
                (true, true) | (false, false) => entry.re,
                (true, false) => -entry.im,
                (false, true) => entry.im,
            }
        });
        Ok(Self { real: Svd::new(&real)?, repeats: 2, cols })
    }

    /// The singular values, descending, one per column of M.
    pub(crate) fn values(&self) -> Vec<f64> {
        self.real.values.iter().step_by(self.repeats).copied().collect()
    }

    /// Number of singular values above `tolerance` times the largest. The real form of a complex M repeats each value;
    /// one copy above the limit suffices.
    pub(crate) fn rank(&self, tolerance: f64) -> usize {
        self.real.rank(tolerance).div_ceil(self.repeats)
    }

    /// A singular value and its right singular vector, counted from the smallest: index 0 is the
    /// smallest. Vectors of a repeated singular value need not be orthogonal.
    pub(crate) fn nth_smallest(&self, index: usize) -> (f64, DVector<Complex<f64>>) {
        let at = self.repeats * (self.cols - 1 - index);
        let column = self.real.right.column(at);
        let imaginary = |i: usize| if self.repeats == 2 { column[i + self.cols] } else { 0.0 };
        let vector = DVector::from_fn(self.cols, |i, _| Complex::new(column[i], imaginary(i)));
        (self.real.values[at], vector)
    }

    /// Columns of V from `first` on, for a matrix without imaginary parts; None otherwise.
    pub(crate) fn real_right(&self, first: usize) -> Option<DMatrix<f64>> {
        let count = self.cols - first;
        (self.repeats == 1).then(|| self.real.right.columns(first, count).into_owned())
    }
}

/// Returns cosine and sine of a rotation that makes two columns orthogonal, or exchanges orthogonal columns if the
/// second one is longer; None if there is nothing to do. A column of at most `negligible` length counts as zero.
fn rotation(m: &DMatrix<f64>, first: usize, second: usize, negligible: f64) -> Option<(f64, f64)> {
    let (a, b) = (m.column(first), m.column(second));
    let (length_a, length_b) = (a.norm(), b.norm());
    if length_b <= negligible && length_a >= length_b {
        return None;
    }
    if length_a <= negligible {
        return Some((0.0, -1.0));
    }
    let cosine = a.dot(&b) / (length_a * length_b);
    // The rounding error of a dot product grows with its length.
    if cosine.abs() <= f64::EPSILON * as_number(m.nrows().max(4)) {
        return (length_b > length_a).then_some((0.0, -1.0));
    }
    let zeta = (length_b / length_a - length_a / length_b) / (2.0 * cosine);
    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let c = 1.0 / tangent.hypot(1.0);
    Some((c, c * tangent))
}

/// Replaces columns a and b by c a - s b and s a + c b.
fn rotate(m: &mut DMatrix<f64>, first: usize, second: usize, c: f64, s: f64) {
    for row in 0..m.nrows() {
        let (a, b) = (m[(row, first)], m[(row, second)]);
        m[(row, first)] = c * a - s * b;
        m[(row, second)] = s * a + c * b;
    }
}

/// Assembles the decomposition, singular values descending, from V and M V = U S, which is `images` times `unit`.
fn assemble(images: &DMatrix<f64>, right: &DMatrix<f64>, unit: f64) -> Svd {
    let norms: Vec<f64> = images.column_iter().map(|column| column.norm()).collect();
    let mut order: Vec<usize> = (0..norms.len()).collect();
    order.sort_by(|&i, &j| norms[j].total_cmp(&norms[i]));
    let left = DMatrix::from_fn(images.nrows(), norms.len(), |i, j| {
        let norm = norms[order[j]];
        if norm > 0.0 { images[(i, order[j])] / norm } else { 0.0 }
    });
    Svd {
        left,
        values: DVector::from_fn(norms.len(), |j, _| norms[order[j]] * unit),
        right: right.select_columns(&order),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rebuilt(s: &Svd) -> DMatrix<f64> {
        &s.left * DMatrix::from_diagonal(&s.values) * s.right.transpose()
    }

    #[test]
    fn tall_wide_and_rank_deficient_integer_matrices_are_rebuilt() {
        let tall = DMatrix::from_row_slice(4, 3, &[1., 2., 3., 2., 4., 6., 1., 0., 1., 0., 2., 2.]);
        for m in [tall.clone(), tall.transpose(), DMatrix::zeros(2, 3)] {
            let s = Svd::new(&m).unwrap();
            let size = m.norm().max(1.0);
            assert!((rebuilt(&s) - &m).norm() < 1e-14 * size);
            let identity = DMatrix::identity(m.ncols(), m.ncols());
            assert!((s.right.transpose() * &s.right - identity).norm() < 1e-14);
        }
        assert_eq!(Svd::new(&tall).unwrap().rank(1e-12), 2);
    }

    #[test]
    fn entries_that_are_not_finite_are_an_error_also_in_a_single_column() {
        for value in [f64::NAN, f64::INFINITY] {
            for columns in [1, 2] {
                let refused = Svd::new(&DMatrix::from_element(2, columns, value));
                assert!(matches!(refused, Err(Error::NotConverged { .. })), "{value} {columns}");
            }
        }
    }

    /// A rotation times diag(1, 1e-9, 1e-18) has the singular values of the diagonal.
    #[test]
    fn tiny_singular_values_of_badly_scaled_columns_keep_their_relative_precision() {
        let (c, s) = (0.6, 0.8);
        let q = DMatrix::from_row_slice(3, 3, &[c, -s, 0., s, c, 0., 0., 0., 1.])
            * DMatrix::from_row_slice(3, 3, &[1., 0., 0., 0., c, -s, 0., s, c]);
        let d = [1.0, 1e-9, 1e-18];
        let m = DMatrix::from_fn(3, 3, |i, j| q[(i, j)] * d[j]);
        let values = Svd::new(&m).unwrap().values;
        for (value, exact) in values.iter().zip(d) {
            assert!((value / exact - 1.0).abs() < 1e-14, "{value} {exact}");
        }
    }

    #[test]
    fn least_squares_solves_the_normal_equations_with_the_shortest_solution() {
        let m = DMatrix::from_row_slice(3, 2, &[1., 2., 2., 4., 0., 0.]);
        let b = DMatrix::from_row_slice(3, 1, &[1., 2., 5.]);
        let x = Svd::new(&m).unwrap().least_squares(&b, 1);
        assert!((x - DMatrix::from_row_slice(2, 1, &[0.2, 0.4])).norm() < 1e-15);
    }

    /// M v = 0 and |M v| = s |v|, checked by the product itself.
    #[test]
    fn the_singular_vectors_of_a_complex_matrix_have_images_as_long_as_the_singular_values() {
        let i = Complex::i();
        let one = Complex::new(1.0, 0.0);
        let m = DMatrix::from_row_slice(2, 2, &[one, i, i * 2.0, -one * 2.0]);
        let svd = ComplexSvd::new(&m).unwrap();
        assert_eq!(svd.rank(1e-12), 1);
        for (index, value) in svd.values().into_iter().rev().enumerate() {
            let (smallest, v) = svd.nth_smallest(index);
            assert!((smallest - value).abs() < 1e-15);
            assert!(((&m * &v).norm() - value).abs() < 1e-15);
            assert!((v.norm() - 1.0).abs() < 1e-15);
        }
        assert!((svd.values()[0] - 10.0_f64.sqrt()).abs() < 1e-15);
    }
}
