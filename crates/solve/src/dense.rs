//! Dense linear equations, solved in place without allocation.

use serde::{Deserialize, Serialize};

/// LU factorisation `P M = L U` of a square matrix, by Gaussian elimination with row pivoting (Golub
/// and Van Loan 2013, algorithm 3.4.1). `2/3 n^3` operations; no allocation after construction.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Factors {
    n: usize,
    /// L below the diagonal, U on and above it, column by column.
    entries: Vec<f64>,
    /// For each column k the row that was swapped with row k.
    pivots: Vec<usize>,
    /// Memory for a column of the inverse.
    unit: Vec<f64>,
}

impl Factors {
    /// Creates the memory for matrices of `n` rows.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self { n, entries: vec![0.0; n * n], pivots: vec![0; n], unit: vec![0.0; n] }
    }

    /// Factorises `matrix` (column by column) and returns `|M^-1|_1`, infinite without a finite inverse.
    pub(super) fn factor(&mut self, matrix: &[f64]) -> f64 {
        if !self.decompose(matrix) {
            return f64::INFINITY;
        }
        let mut inverse = 0.0_f64;
        let mut unit = std::mem::take(&mut self.unit);
        for column in 0..self.n {
            unit.fill(0.0);
            unit[column] = 1.0;
            self.solve(&mut unit);
            let length = unit.iter().map(|entry| entry.abs()).sum::<f64>();
            inverse = if length.is_finite() { inverse.max(length) } else { f64::INFINITY };
        }
        self.unit = unit;
        inverse
    }

    /// Factorises `matrix` (column by column); returns false if a pivot is zero or not finite.
    pub fn decompose(&mut self, matrix: &[f64]) -> bool {
        self.entries.copy_from_slice(matrix);
        (0..self.n).all(|column| self.eliminate(column))
    }

    /// Eliminates the entries below the diagonal of a column; returns false if its pivot is zero or not finite.
    fn eliminate(&mut self, column: usize) -> bool {
        let n = self.n;
        let size = |row: usize| self.entries[column * n + row].abs();
        let pivot =
            (column + 1..n).fold(column, |p, row| if size(row) > size(p) { row } else { p });
        let value = self.entries[column * n + pivot];
        if value == 0.0 || !value.is_finite() {
            return false;
        }
        self.pivots[column] = pivot;
        if pivot != column {
            for other in 0..n {
                self.entries.swap(other * n + column, other * n + pivot);
            }
        }
        for row in column + 1..n {
            self.entries[column * n + row] /= value;
        }
        let (left, right) = self.entries.split_at_mut((column + 1) * n);
        let factors = &left[column * n + column + 1..];
        for other in right.chunks_exact_mut(n) {
            let top = other[column];
            for (entry, factor) in other[column + 1..].iter_mut().zip(factors) {
                *entry -= factor * top;
            }
        }
        true
    }

    /// Replaces `vector` by `M^-1 vector`, after [`Factors::decompose`] returned true.
    pub fn solve(&self, vector: &mut [f64]) {
        let n = self.n;
        for (row, &pivot) in self.pivots.iter().enumerate() {
            vector.swap(row, pivot);
        }
        for column in 0..n {
            let top = vector[column];
            let below = &self.entries[column * n + column + 1..(column + 1) * n];
            for (entry, factor) in vector[column + 1..].iter_mut().zip(below) {
                *entry -= factor * top;
            }
        }
        for column in (0..n).rev() {
            vector[column] /= self.entries[column * n + column];
            let value = vector[column];
            let above = &self.entries[column * n..column * n + column];
            for (entry, factor) in vector[..column].iter_mut().zip(above) {
                *entry -= factor * value;
            }
        }
    }
}

/// Returns `|M|_1` of a matrix of n rows, stored column by column.
pub(super) fn norm_1(matrix: &[f64], n: usize) -> f64 {
    let sums = matrix.chunks_exact(n.max(1)).map(|column| column.iter().map(|x| x.abs()).sum());
    sums.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Deterministic pseudo-random entries between -1 and 1.
    fn scattered(n: usize) -> DMatrix<f64> {
        let mut state = 7_u64;
        DMatrix::from_fn(n, n, |_, _| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            f64::from(u32::try_from(state >> 32).unwrap()) / f64::from(u32::MAX) * 2.0 - 1.0
        })
    }

    #[test]
    fn the_solution_is_that_of_the_library_and_leaves_no_residual() {
        for n in [1, 2, 3, 10, 50] {
            let matrix = scattered(n);
            let right = scattered(n).column(0).into_owned();
            let mut factors = Factors::new(n);
            let condition = factors.factor(matrix.as_slice()) * norm_1(matrix.as_slice(), n);
            let mut actual = right.clone();
            factors.solve(actual.as_mut_slice());
            let expected = matrix.clone().lu().solve(&right).unwrap();
            let bound = 1e-14 * condition;
            assert!((&matrix * &actual - &right).amax() <= bound, "{n}");
            assert!((&actual - &expected).amax() <= bound * expected.amax(), "{n}");
        }
    }

    #[test]
    fn the_norm_is_that_of_the_inverse() {
        // Inverse of [[1, 2], [3, 4]]: [[-2, 1], [1.5, -0.5]].
        assert!((Factors::new(2).factor(&[1.0, 3.0, 2.0, 4.0]) - 3.5).abs() < 1e-13);
        assert!((norm_1(&[1.0, 3.0, 2.0, 4.0], 2) - 6.0).abs() < 1e-15);
        // The inverse of the Hilbert matrix of order 3 is [[9, -36, 30], [-36, 192, -180],
        // [30, -180, 180]].
        let hilbert = [1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0];
        let hilbert = [&hilbert[..3], &hilbert[1..4], &hilbert[2..]].concat();
        assert!((Factors::new(3).factor(&hilbert) / 408.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_inverse_of_singular_and_not_finite_matrices_is_infinite() {
        let (nan, infinity) = (f64::NAN, f64::INFINITY);
        let cases =
            [[1.0, 2.0, 2.0, 4.0], [0.0; 4], [nan, 1.0, 1.0, 0.0], [1.0, 1.0, infinity, 0.0]];
        for matrix in cases {
            assert!(Factors::new(2).factor(&matrix).is_infinite(), "{matrix:?}");
        }
    }
}
