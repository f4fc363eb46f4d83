//! The singular value decomposition by one-sided Jacobi rotations, with complete bases U and V.

use nalgebra::{DMatrix, DVector};

/// Largest number of sweeps; 5 to 10 are usual.
const SWEEPS: usize = 60;
/// A column shorter than this, relative to the largest entry of the matrix, counts as zero.
const NEGLIGIBLE: f64 = 1e-100;

/// A = U S V', U and V square and orthogonal, S descending.
pub(crate) struct Svd {
    pub(crate) u: DMatrix<f64>,
    /// min(rows, columns) values.
    pub(crate) values: DVector<f64>,
    pub(crate) v: DMatrix<f64>,
}

impl Svd {
    /// Decomposes `a`; None for entries that are not finite or if the sweeps do not converge.
    pub(crate) fn new(a: &DMatrix<f64>) -> Option<Self> {
        if a.nrows() >= a.ncols() {
            return Self::tall(a);
        }
        let transposed = Self::tall(&a.transpose())?;
        Some(Self { u: transposed.v, values: transposed.values, v: transposed.u })
    }

    /// Decomposes a matrix with at least as many rows as columns.
    fn tall(a: &DMatrix<f64>) -> Option<Self> {
        if a.iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        let size = a.amax();
        if size == 0.0 || a.is_empty() {
            let (rows, cols) = a.shape();
            let (u, v) = (DMatrix::identity(rows, rows), DMatrix::identity(cols, cols));
            return Some(Self { u, values: DVector::zeros(cols), v });
        }
        let (images, v) = orthogonal_images(a / size)?;
        let norms: Vec<f64> = images.column_iter().map(|column| column.norm()).collect();
        let mut order: Vec<usize> = (0..norms.len()).collect();
        order.sort_by(|&i, &j| norms[j].total_cmp(&norms[i]));
        let mut u = DMatrix::zeros(a.nrows(), a.nrows());
        let rank = order.iter().filter(|&&k| norms[k] > NEGLIGIBLE).count();
        for (at, &k) in order.iter().take(rank).enumerate() {
            u.set_column(at, &(images.column(k) / norms[k]));
        }
        complete(&mut u, rank);
        let value = |at: usize| if at < rank { norms[order[at]] * size } else { 0.0 };
        let values = DVector::from_fn(order.len(), |at, _| value(at));
        Some(Self { u, values, v: v.select_columns(&order) })
    }
}

/// A V with orthogonal columns, and V; None if the sweeps do not converge.
fn orthogonal_images(mut images: DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let cols = images.ncols();
    let mut v = DMatrix::identity(cols, cols);
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..cols {
            for q in p + 1..cols {
                if let Some((c, s)) = rotation(&images, p, q) {
                    rotate(&mut images, p, q, c, s);
                    rotate(&mut v, p, q, c, s);
                    rotated = true;
                }
            }
        }
        if !rotated {
            return Some((images, v));
        }
    }
    None
}

/// Cosine and sine of the rotation that makes columns p and q orthogonal; None if they are orthogonal already,
/// or one of them is negligible.
fn rotation(m: &DMatrix<f64>, p: usize, q: usize) -> Option<(f64, f64)> {
    let (a, b) = (m.column(p), m.column(q));
    let (first, second) = (a.norm(), b.norm());
    if first <= NEGLIGIBLE || second <= NEGLIGIBLE {
        return None;
    }
    let cosine = (a / first).dot(&(b / second));
    let rounding = f64::from(u32::try_from(m.nrows().max(4)).unwrap_or(u32::MAX)) * f64::EPSILON;
    if cosine.abs() <= rounding {
        return None;
    }
    let zeta = (second / first - first / second) / (2.0 * cosine);
    let tangent = 1.0_f64.copysign(zeta) / (zeta.abs() + zeta.hypot(1.0));
    let c = 1.0 / tangent.hypot(1.0);
    Some((c, c * tangent))
}

/// Replaces columns p and q, called a and b, by c a - s b and s a + c b.
pub(crate) fn rotate(m: &mut DMatrix<f64>, p: usize, q: usize, c: f64, s: f64) {
    for row in 0..m.nrows() {
        let (a, b) = (m[(row, p)], m[(row, q)]);
        (m[(row, p)], m[(row, q)]) = (c * a - s * b, s * a + c * b);
    }
}

/// Completes the first `done` columns to an orthonormal basis: each new column is the unit vector
/// farthest from the span of the previous columns, made orthogonal to them twice.
fn complete(u: &mut DMatrix<f64>, done: usize) {
    let n = u.nrows();
    for at in done..n {
        let before = u.columns(0, at).into_owned();
        let distance = |k: usize| 1.0 - before.row(k).norm_squared();
        let farthest = (0..n).max_by(|&i, &j| distance(i).total_cmp(&distance(j)));
        let mut column = DVector::zeros(n);
        column[farthest.unwrap_or(0)] = 1.0;
        for _ in 0..2 {
            column -= &before * before.tr_mul(&column);
            column.normalize_mut();
        }
        u.set_column(at, &column);
    }
}
