//! The matrix logarithm.

use nalgebra::DMatrix;

/// Maximum number of iterations of one square root; about ten are usual.
const ITERATIONS: usize = 50;
/// Maximum number of square roots.
const ROOTS: usize = 60;
/// The quadrature of log(I + X) is exact to double precision up to this 1-norm of X.
const REACH: f64 = 0.25;
/// Largest residual of the logarithm, e^L - (I + E), and of a square root, relative to the norm of the matrix.
const RESIDUAL: f64 = 1e-10;
/// Positive nodes and weights of the Gauss-Legendre rule of order 8 on [-1, 1].
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Returns the principal logarithm L of I + E: e^L = I + E, where the eigenvalues of L have
/// imaginary parts between -pi and pi.
///
/// `e`: n x n. The logarithm exists and is real if I + E has no eigenvalue on the closed negative
/// real axis. The result is `None` otherwise, for entries that are not finite, and if rounding prevents
/// a result that passes the verification.
///
/// Method: inverse scaling and squaring; square roots by the product form of the Denman-Beavers
/// iteration; then log(I + X) = integral of X (I + t X)^-1 over t from 0 to 1 by the Gauss-Legendre
/// rule of order 8, which is the [8/8] Pade approximant. About 2 n^3 multiplications per iteration
/// of a root, then 8 matrix equations. A small E keeps its relative precision. The result is verified:
/// e^L - (I + E) is within 1e-10 of the norm of I + E.
///
/// Sources: S. H. Cheng, N. J. Higham, C. S. Kenney, A. J. Laub, Approximating the logarithm of a
/// matrix to specified accuracy, SIAM J. Matrix Anal. Appl. 22 (2001), (2.2) and section 4; L. Dieci,
/// B. Morini, A. Papini, Computational techniques for real logarithms of matrices, SIAM J. Matrix
/// Anal. Appl. 17 (1996).
#[must_use]
pub fn logarithm_of_one_plus(e: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = e.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    let (mut x, mut factor) = (e.clone(), 1.0);
    for _ in 0..ROOTS {
        if one_norm(&x) <= REACH {
            break;
        }
        x = square_root(&(&x + &identity))? - &identity;
        factor *= 2.0;
    }
    if one_norm(&x) > REACH {
        return None;
    }
    let mut sum = DMatrix::zeros(n, n);
    for (node, weight) in NODES {
        for t in [0.5 - 0.5 * node, 0.5 + 0.5 * node] {
            sum += (&identity + &x * t).lu().solve(&x)? * (0.5 * weight);
        }
    }
    let logarithm = sum * factor;
    let one_plus_e = e + identity;
    let residual = one_norm(&(logarithm.exp() - &one_plus_e)) / one_norm(&one_plus_e);
    (residual <= RESIDUAL).then_some(logarithm)
}

/// Returns the principal square root R of A; `None` if an iterate is singular or not finite, or if
/// R^2 differs from A by more than [`RESIDUAL`].
fn square_root(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = a.nrows();
    let identity = DMatrix::<f64>::identity(n, n);
    let (mut product, mut root) = (a.clone(), a.clone());
    for _ in 0..ITERATIONS {
        let inverse = product.clone().try_inverse()?;
        root = (&root + &root * &inverse) * 0.5;
        product = (&identity + (&product + inverse) * 0.5) * 0.5;
        let distance = one_norm(&(&product - &identity));
        if !distance.is_finite() {
            return None;
        }
        if distance <= 1e-15 * f64::from(u32::try_from(n).unwrap_or(u32::MAX)) {
            break;
        }
    }
    let residual = one_norm(&(&root * &root - a));
    (residual <= RESIDUAL * one_norm(a)).then_some(root)
}

/// Returns the 1-norm, the largest sum of magnitudes in a column; infinite if an entry is NaN.
pub(crate) fn one_norm(a: &DMatrix<f64>) -> f64 {
    let sums = a.column_iter().map(|column| column.iter().map(|x| x.abs()).sum::<f64>());
    sums.fold(0.0, |largest, sum| if sum.is_nan() { f64::INFINITY } else { sum.max(largest) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_of_the_exponential_is_the_matrix() {
        let rotation = [0.0, 3.0, -3.0, 0.0];
        for (n, entries, tolerance) in [
            (2, &rotation[..], 1e-13),
            (2, &[-10.0, 1.0, 0.0, -1e-3][..], 1e-11),
            (3, &[1.0, 5.0, 0.0, -1.5, 0.5, 1.0, 0.0, 0.0, 0.0][..], 1e-13),
            (2, &[0.0, 1.0, 0.0, 0.0][..], 1e-15),
        ] {
            let a = DMatrix::from_row_slice(n, n, entries);
            let e = a.exp() - DMatrix::identity(n, n);
            let actual = logarithm_of_one_plus(&e).unwrap();
            assert!((&actual - &a).norm() <= tolerance * a.norm(), "{actual} {a}");
        }
    }

    /// log([1, 1; 0, 4]) = [0, log(4)/3; 0, log(4)].
    #[test]
    fn a_triangular_matrix_has_its_logarithm_by_hand() {
        let e = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 3.0]);
        let ln4 = 4.0_f64.ln();
        let expected = DMatrix::from_row_slice(2, 2, &[0.0, ln4 / 3.0, 0.0, ln4]);
        assert!((logarithm_of_one_plus(&e).unwrap() - expected).norm() < 1e-14);
    }

    #[test]
    fn a_small_matrix_keeps_its_relative_precision() {
        let e = DMatrix::from_row_slice(2, 2, &[1e-9, 2e-9, -3e-9, 0.0]);
        let actual = logarithm_of_one_plus(&e).unwrap();
        let second = &e - &e * &e * 0.5;
        assert!((actual - second).norm() < 1e-15 * e.norm());
    }

    #[test]
    fn a_matrix_without_a_real_logarithm_gives_none() {
        for entries in [[-2.0, 0.0, 0.0, 0.5], [-1.0, 0.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0, 0.0]] {
            let e = DMatrix::from_row_slice(2, 2, &entries);
            assert_eq!(logarithm_of_one_plus(&e), None, "{entries:?}");
        }
    }
}
