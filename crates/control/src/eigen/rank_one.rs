//! Eigenvalues of A + g b c, the feedback of one channel, for many gains g.

use super::{eigenvalues, francis};
use crate::Error;
use crate::balance::{Balance, divide_rows, multiply_columns};
use nalgebra::{Complex, DMatrix, DVector};

/// A + g b c with a column b, a row c and any gain g, in coordinates in which the sum is a Hessenberg matrix.
///
/// A is balanced; an orthogonal transformation makes b a multiple of the first axis and A a Hessenberg
/// matrix. The feedback changes the first row only, so that each gain needs the QR algorithm alone, 6 n^3
/// operations, and no reduction.
///
/// Source: C. C. Paige, Properties of numerical algorithms related to computing controllability, IEEE
/// Trans. Autom. Control 26 (1981): the controller-Hessenberg form.
pub(crate) struct RankOne {
    /// A in Hessenberg form.
    hessenberg: DMatrix<f64>,
    /// The first row of b c in the coordinates of the Hessenberg form, 1 x n; the other rows are zero.
    row: DMatrix<f64>,
}

impl RankOne {
    /// Transforms A, n x n, b, n x 1, and c, 1 x n. A b of length zero counts as no feedback.
    pub(crate) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> Self {
        let Balance { mut matrix, scale } = Balance::new(a);
        let (b, mut row) = (divide_rows(b, &scale), multiply_columns(c, &scale));
        let mut v: DVector<f64> = b.column(0).into_owned();
        let size = v.norm();
        let mut image = 0.0;
        if size.is_normal() {
            image = -size.copysign(v[0]);
            v[0] -= image;
            let v = v.normalize();
            // P = I - 2 v v': A becomes P A P, c becomes c P.
            let product = matrix.tr_mul(&v);
            matrix.ger(-2.0, &v, &product, 1.0);
            let product = &matrix * &v;
            matrix.ger(-2.0, &product, &v, 1.0);
            let product = &row * &v;
            row.ger(-2.0, &product, &v, 1.0);
        }
        // The reduction to Hessenberg form does not change the first coordinate.
        let (q, hessenberg) = matrix.hessenberg().unpack();
        Self { hessenberg, row: row * q * image }
    }

    /// The eigenvalues of A + g b c, in no particular order, with the errors of [`eigenvalues`].
    pub(crate) fn eigenvalues(&self, gain: f64) -> Result<Vec<Complex<f64>>, Error> {
        let mut matrix = self.hessenberg.clone();
        let added = &self.row * gain;
        let dominates = added.norm() > matrix.norm();
        let mut first = matrix.row_mut(0);
        first += added;
        // A is balanced; only a feedback larger than A needs a new balance.
        let balanced = if dominates { Balance::new(&matrix).matrix } else { matrix.clone() };
        francis::eigenvalues(balanced).map_or_else(|| eigenvalues(&matrix), Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eigen::hamiltonian::tests::{random, remove_nearest};

    #[test]
    fn the_eigenvalues_are_those_of_the_matrix_with_the_feedback() {
        let mut random = random(0.3);
        for n in [1, 2, 3, 8, 60] {
            let a = DMatrix::from_fn(n, n, |i, j| random() * [1.0, 50.0, 0.02][(i + 2 * j) % 3]);
            let b = DMatrix::from_fn(n, 1, |_, _| random());
            let c = DMatrix::from_fn(1, n, |_, _| random());
            for (b, gain) in [(&b, 0.0), (&b, -1.0), (&b, 3.5), (&b, 1e4), (&(&b * 0.0), 1.0)] {
                let family = RankOne::new(&a, b, &c);
                let whole = &a + b * &c * gain;
                // By nalgebra's Schur form.
                let mut expected = whole.complex_eigenvalues().as_slice().to_vec();
                for value in family.eigenvalues(gain).unwrap() {
                    let error = remove_nearest(&mut expected, value);
                    assert!(error < 1e-11 * whole.norm(), "{n}, {gain}: {value} {error}");
                }
            }
        }
    }
}
