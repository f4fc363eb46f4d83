//! Products with the same bits on every processor.

use nalgebra::DMatrix;

/// The matrix product A B, summed in a fixed order: for each column of B the columns of A times its
/// entries.
///
/// `a`: n x k; `b`: k x m. The result has the same bits on every processor. nalgebra's `*` does
/// not: it multiplies matrices larger than 5 x 5 by kernels that depend on the features of the
/// processor. Exported models use this function.
///
/// # Panics
///
/// If the number of columns of A differs from the number of rows of B, as `*` does.
#[must_use]
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut result = DMatrix::zeros(a.nrows(), b.ncols());
    for (mut column, factors) in result.column_iter_mut().zip(b.column_iter()) {
        column.gemv(1.0, a, &factors, 0.0);
    }
    result
}

/// A B in twice the precision: the unevaluated sum `high` + `low` of the rounded product and its
/// rounding error, the latter rounded itself.
///
/// Source: T. Ogita, S. M. Rump, S. Oishi, Accurate sum and dot product, SIAM J. Sci. Comput. 26 (2005), algorithm 5.3.
pub(crate) struct AccurateProduct {
    pub(crate) high: DMatrix<f64>,
    pub(crate) low: DMatrix<f64>,
}

impl AccurateProduct {
    /// `a`: n x k; `b`: k x m.
    pub(crate) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Self {
        let (rows, cols) = (a.nrows(), b.ncols());
        let mut product =
            Self { high: DMatrix::zeros(rows, cols), low: DMatrix::zeros(rows, cols) };
        for row in 0..rows {
            for col in 0..cols {
                let (mut sum, mut error) = (0.0_f64, 0.0_f64);
                for k in 0..a.ncols() {
                    let (x, y) = (a[(row, k)], b[(k, col)]);
                    let term = x * y;
                    let (next, rounding) = two_sum(sum, term);
                    error += x.mul_add(y, -term) + rounding;
                    sum = next;
                }
                (product.high[(row, col)], product.low[(row, col)]) = two_sum(sum, error);
            }
        }
        product
    }

    /// A B + (A B)' + `constant`, rounded after the large terms have cancelled.
    #[cfg(feature = "lmi")]
    pub(crate) fn plus_transpose(&self, constant: &DMatrix<f64>) -> DMatrix<f64> {
        (&self.high + self.high.transpose() + constant) + (&self.low + self.low.transpose())
    }
}

/// The rounded sum of two numbers and its rounding error, which is exact.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_with_cancellation_keeps_its_digits() {
        let row = DMatrix::from_row_slice(1, 3, &[1e16, 1.0, -1e16]);
        let column = DMatrix::from_row_slice(3, 1, &[1.0, 1.0, 1.0]);
        assert_eq!(AccurateProduct::new(&row, &column).high[(0, 0)].to_bits(), 1.0_f64.to_bits());
        let tenth = DMatrix::from_element(1, 1, 0.1);
        let square = AccurateProduct::new(&tenth, &tenth);
        // The double nearest to 0.1 is 0.1 + 5.551115123125783e-18.
        assert!((square.low[(0, 0)] - (0.01 - square.high[(0, 0)] + 1.11e-18)).abs() < 2e-18);
    }
}
