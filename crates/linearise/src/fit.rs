//! Linear least squares with a rank check.

use nalgebra::DMatrix;

/// The least squares solution of X T = Y.
pub(super) struct Fit {
    /// T, one row per column of X.
    pub(super) solution: DMatrix<f64>,
    /// Standard deviation of each entry of T, from the residual of Y and its rounding error.
    pub(super) deviations: DMatrix<f64>,
}

/// The linear independence of the columns of X, scaled to length one.
pub(super) struct Directions {
    /// The smallest diagonal entry of R over the largest, from the QR decomposition with pivoting.
    pub(super) contrast: f64,
    /// Column indices in pivot order: the last columns are the least independent.
    order: Vec<usize>,
    /// Absolute diagonal entries of R, in pivot order.
    diagonal: Vec<f64>,
}

impl Directions {
    pub(super) fn of(x: &DMatrix<f64>) -> Self {
        let columns = x.ncols();
        let qr = normalise(x).0.col_piv_qr();
        let mut order = DMatrix::from_fn(1, columns, |_, column| column);
        qr.p().permute_columns(&mut order);
        let r = qr.r();
        let diagonal: Vec<f64> = (0..columns).map(|k| r[(k, k)].abs()).collect();
        let largest = diagonal.iter().fold(0.0_f64, |largest, &entry| largest.max(entry));
        let smallest = diagonal.iter().fold(f64::INFINITY, |least, &entry| least.min(entry));
        let contrast = if largest > 0.0 { smallest / largest } else { 0.0 };
        Self { contrast, order: order.iter().copied().collect(), diagonal }
    }

    /// Returns the columns whose independent part is below `tolerance`.
    pub(super) fn weak(&self, tolerance: f64) -> Vec<usize> {
        let weak = self.order.iter().zip(&self.diagonal).filter(|(_, entry)| **entry < tolerance);
        weak.map(|(&column, _)| column).collect()
    }
}

/// Scales the columns to length one; also returns their lengths. A zero column is not changed and has the length 1.
fn normalise(x: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let lengths = x.column_iter().map(|column| column.norm());
    let lengths: Vec<f64> = lengths.map(|length| if length > 0.0 { length } else { 1.0 }).collect();
    (DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)] / lengths[j]), lengths)
}

/// Returns the T with the least norm of X T - Y; `None` if a diagonal entry of R is exactly zero or a result is not
/// finite. Columns that are dependent up to rounding pass; [`Directions`] detects them.
///
/// Method: Householder's QR decomposition of X, its columns scaled to length one. `x`: r x c with at least as many
/// rows as columns; `y`: r x k. About 2 r c^2 multiplications.
///
/// `noise`: the rounding error of each column of Y, which the standard deviations include.
pub(super) fn least_squares(x: &DMatrix<f64>, y: &DMatrix<f64>, noise: &[f64]) -> Option<Fit> {
    let (rows, columns) = x.shape();
    let (scaled, lengths) = normalise(x);
    let qr = scaled.clone().qr();
    let r = qr.r();
    let mut solution = r.solve_upper_triangular(&(qr.q().transpose() * y))?;
    let residual = y - &scaled * &solution;
    let inverse = r.solve_upper_triangular(&DMatrix::identity(columns, columns))?;
    let freedom = f64::from(u32::try_from(rows.saturating_sub(columns).max(1)).ok()?);
    let mut deviations = DMatrix::from_fn(columns, y.ncols(), |i, j| {
        inverse.row(i).norm() * (residual.column(j).norm() / freedom.sqrt() + noise[j])
    });
    for (row, length) in lengths.iter().enumerate() {
        solution.row_mut(row).scale_mut(1.0 / length);
        deviations.row_mut(row).scale_mut(1.0 / length);
    }
    let finite = solution.iter().chain(deviations.iter()).all(|entry| entry.is_finite());
    finite.then_some(Fit { solution, deviations })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_is_the_line_through_scattered_points() {
        // The scatter is orthogonal to both columns of x.
        let x = DMatrix::from_row_slice(4, 2, &[1.0, 0.0, 1.0, 1.0, 1.0, 2.0, 1.0, 3.0]);
        let line = DMatrix::from_column_slice(4, 1, &[0.1, 1.0, 1.9, 2.8]);
        let scatter = DMatrix::from_column_slice(4, 1, &[0.1, -0.1, -0.1, 0.1]);
        let fit = least_squares(&x, &(&line + scatter), &[0.0]).unwrap();
        assert!((fit.solution[(0, 0)] - 0.1).abs() < 1e-15);
        assert!((fit.solution[(1, 0)] - 0.9).abs() < 1e-15);
        // Variance of the slope: 0.04 / 2 / 5.
        assert!((fit.deviations[(1, 0)] - 0.004_f64.sqrt()).abs() < 1e-15);
        assert!(least_squares(&x, &line, &[0.0]).unwrap().deviations.amax() < 1e-14);
    }

    #[test]
    fn dependent_columns_are_named() {
        let x = DMatrix::from_row_slice(3, 3, &[1.0, 2e6, 0.0, 1.0, 2e6, 1.0, 0.0, 0.0, 1e-3]);
        let directions = Directions::of(&x);
        assert!(directions.contrast < 1e-15);
        let weak = directions.weak(1e-9);
        assert!(weak == [0] || weak == [1], "{weak:?}");
        assert!(Directions::of(&DMatrix::identity(3, 3)).weak(1e-9).is_empty());
    }
}
