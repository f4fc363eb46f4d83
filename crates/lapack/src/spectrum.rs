//! Eigenvalues and eigenvectors of a symmetric matrix by Jacobi rotations.

use crate::svd::rotate;
use nalgebra::{DMatrix, DVector};

/// Largest number of sweeps; 6 to 10 are usual.
const SWEEPS: usize = 60;

/// Eigenvalues, ascending, and orthonormal eigenvectors V of A, A V = V diag(values). A is given by its
/// upper triangle.
///
/// None if the sweeps do not converge. If an entry is not finite, all results are NaN.
pub(crate) fn symmetric_eigen(a: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let n = a.nrows();
    let mut m = DMatrix::from_fn(n, n, |row, col| a[(row.min(col), row.max(col))]);
    if m.iter().any(|entry| !entry.is_finite()) {
        return Some((DVector::repeat(n, f64::NAN), DMatrix::repeat(n, n, f64::NAN)));
    }
    let mut v = DMatrix::identity(n, n);
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                rotated |= annihilate(&mut m, &mut v, p, q);
            }
        }
        if !rotated {
            return Some(ascending(&m, &v));
        }
    }
    None
}

/// Rotates in the plane of p and q so that m[p, q] becomes zero; false if it is negligible, and set to zero
/// without a rotation.
fn annihilate(m: &mut DMatrix<f64>, v: &mut DMatrix<f64>, p: usize, q: usize) -> bool {
    let coupling = m[(p, q)];
    // These forms of the sum and of the difference of diagonal entries do not overflow.
    let negligible = f64::EPSILON * m[(p, p)].abs() + f64::EPSILON * m[(q, q)].abs();
    if coupling.abs() <= negligible {
        (m[(p, q)], m[(q, p)]) = (0.0, 0.0);
        return false;
    }
    let theta = (0.5 * m[(q, q)] - 0.5 * m[(p, p)]) / coupling;
    let tangent = 1.0_f64.copysign(theta) / (theta.abs() + theta.hypot(1.0));
    let c = 1.0 / tangent.hypot(1.0);
    let s = c * tangent;
    rotate(m, p, q, c, s);
    rotate(v, p, q, c, s);
    for k in 0..m.nrows() {
        let (x, y) = (m[(p, k)], m[(q, k)]);
        (m[(p, k)], m[(q, k)]) = (c * x - s * y, s * x + c * y);
    }
    (m[(p, q)], m[(q, p)]) = (0.0, 0.0);
    true
}

/// The diagonal of `m`, ascending, and the columns of `v` in the same order.
fn ascending(m: &DMatrix<f64>, v: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let mut order: Vec<usize> = (0..m.nrows()).collect();
    order.sort_by(|&i, &j| m[(i, i)].total_cmp(&m[(j, j)]));
    (DVector::from_fn(order.len(), |k, _| m[(order[k], order[k])]), v.select_columns(&order))
}
