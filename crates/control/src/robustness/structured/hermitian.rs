//! Products and factors of complex Hermitian matrices.

use crate::Error;
use crate::blocks::ComplexMatrix;
use nalgebra::{Complex, SymmetricEigen};

/// A pivot counts as positive above this fraction of its entry in `scale`.
const POSITIVE: f64 = 1e-13;
const EIGEN_ITERATIONS: usize = 1000;

/// The Cholesky factor L of H = L L*; None unless every pivot is above the rounding errors of a diagonal of the size
/// `scale`.
///
/// The Cholesky decomposition of nalgebra does not fail: it takes complex roots of negative pivots.
pub(super) fn factor(h: &ComplexMatrix, scale: &[f64]) -> Option<ComplexMatrix> {
    let n = h.nrows();
    let mut lower = ComplexMatrix::zeros(n, n);
    for j in 0..n {
        let mut column: Vec<Complex<f64>> = (j..n).map(|i| h[(i, j)]).collect();
        for k in 0..j {
            let factor = lower[(j, k)].conj();
            for (entry, i) in column.iter_mut().zip(j..n) {
                *entry -= lower[(i, k)] * factor;
            }
        }
        let pivot = column[0].re;
        // NaN is not positive either.
        if pivot.is_nan() || pivot <= POSITIVE * scale[j] {
            return None;
        }
        let root = pivot.sqrt();
        for (entry, i) in column.iter().zip(j..n) {
            lower[(i, j)] = entry / root;
        }
        lower[(j, j)] = Complex::new(root, 0.0);
    }
    Some(lower)
}

/// L^-1 M for a lower triangular L.
pub(super) fn forward(lower: &ComplexMatrix, m: &ComplexMatrix) -> ComplexMatrix {
    let mut solution = m.clone();
    for mut column in solution.column_iter_mut() {
        for i in 0..lower.nrows() {
            let value = column[i] / lower[(i, i)].re;
            column[i] = value;
            for k in i + 1..lower.nrows() {
                column[k] -= lower[(k, i)] * value;
            }
        }
    }
    solution
}

/// A B from four real products, for which nalgebra has fast kernels.
pub(super) fn times(a: &ComplexMatrix, b: &ComplexMatrix) -> ComplexMatrix {
    let [a_re, a_im, b_re, b_im] =
        [a.map(|x| x.re), a.map(|x| x.im), b.map(|x| x.re), b.map(|x| x.im)];
    let re = &a_re * &b_re - &a_im * &b_im;
    let im = a_re * b_im + a_im * b_re;
    re.zip_map(&im, Complex::new)
}

pub(super) fn largest_eigenvalue(h: &ComplexMatrix) -> Result<f64, Error> {
    let h = (h + h.adjoint()).scale(0.5);
    let decomposition = SymmetricEigen::try_new(h, f64::EPSILON, EIGEN_ITERATIONS);
    let what = "the largest eigenvalue";
    let decomposition =
        decomposition.ok_or(Error::NotConverged { what, iterations: EIGEN_ITERATIONS })?;
    Ok(decomposition.eigenvalues.max())
}
