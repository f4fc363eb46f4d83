//! Cholesky and LU factors, and solutions with them.

use nalgebra::DMatrix;

/// Computes the lower triangular L with L L' = A, A given by its lower triangle.
///
/// The error is the order, from 1, of the first leading minor that is NaN or not positive.
pub(crate) fn cholesky(a: &DMatrix<f64>) -> Result<DMatrix<f64>, usize> {
    let n = a.nrows();
    let mut l = DMatrix::zeros(n, n);
    for col in 0..n {
        for row in col..n {
            let known: f64 = (0..col).map(|k| l[(row, k)] * l[(col, k)]).sum();
            let rest = a[(row, col)] - known;
            if row > col {
                l[(row, col)] = rest / l[(col, col)];
            } else if rest > 0.0 {
                l[(col, col)] = rest.sqrt();
            } else {
                return Err(col + 1);
            }
        }
    }
    Ok(l)
}

/// Solves L X = B by forward substitution.
pub(crate) fn forward(l: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut x = b.clone();
    for col in 0..x.ncols() {
        for row in 0..x.nrows() {
            let known: f64 = (0..row).map(|k| l[(row, k)] * x[(k, col)]).sum();
            x[(row, col)] = (x[(row, col)] - known) / l[(row, row)];
        }
    }
    x
}

/// Solves U X = B by back substitution.
pub(crate) fn backward(u: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut x = b.clone();
    for col in 0..x.ncols() {
        for row in (0..x.nrows()).rev() {
            let known: f64 = (row + 1..x.nrows()).map(|k| u[(row, k)] * x[(k, col)]).sum();
            x[(row, col)] = (x[(row, col)] - known) / u[(row, row)];
        }
    }
    x
}

/// P A = L U with partial pivoting.
pub(crate) struct Elimination {
    /// L below the diagonal (its diagonal is one), U on and above the diagonal.
    pub(crate) factors: DMatrix<f64>,
    /// For each step k the row, from 0, that was swapped with row k.
    pub(crate) swaps: Vec<usize>,
    /// The number, from 1, of the first pivot that is zero; None for a regular A.
    pub(crate) singular: Option<usize>,
}

impl Elimination {
    /// Factors a square A; continues after a pivot of zero.
    pub(crate) fn new(a: &DMatrix<f64>) -> Self {
        let n = a.nrows();
        let mut lu = Self { factors: a.clone(), swaps: Vec::with_capacity(n), singular: None };
        let m = &mut lu.factors;
        for step in 0..n {
            let pivot =
                (step..n).rev().max_by(|&i, &j| m[(i, step)].abs().total_cmp(&m[(j, step)].abs()));
            let pivot = pivot.unwrap_or(step);
            lu.swaps.push(pivot);
            m.swap_rows(step, pivot);
            if m[(step, step)] == 0.0 {
                lu.singular = lu.singular.or(Some(step + 1));
                continue;
            }
            for row in step + 1..n {
                let factor = m[(row, step)] / m[(step, step)];
                m[(row, step)] = factor;
                for col in step + 1..n {
                    m[(row, col)] -= factor * m[(step, col)];
                }
            }
        }
        lu
    }

    /// Solves A X = B for an A that is not singular.
    pub(crate) fn solve(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let mut right = b.clone();
        for (step, &pivot) in self.swaps.iter().enumerate() {
            right.swap_rows(step, pivot);
        }
        let mut l = self.factors.clone();
        l.fill_diagonal(1.0);
        backward(&self.factors, &forward(&l, &right))
    }
}
