//! Eigenvalues of a complex matrix, without vectors.

use super::QR_ALGORITHM;
use crate::Error;
use crate::balance::Balance;
use nalgebra::{Complex, DMatrix};

/// Largest number of sweeps for one eigenvalue; two or three are usual.
const SWEEPS: usize = 120;
/// Interval between exceptional shifts, in sweeps without a result.
const EXCEPTIONAL: usize = 10;
/// Number of sweeps after which an entry that is small relative to the norm of the matrix counts as zero.
const PATIENCE: usize = 20;

/// Computes the eigenvalues of a square complex matrix, in no particular order; none for an empty matrix.
///
/// Method: diagonal balancing of the moduli, Hessenberg form, then the explicit QR algorithm with the shift of Wilkinson
/// and exceptional shifts, on the part that has not been deflated. The result is exact for a matrix that differs from
/// the balanced one by a few units of rounding of its norm. Symmetries of the matrix, and clusters of eigenvalues beside
/// larger entries, do not stop it.
///
/// Source: J. H. Wilkinson, The algebraic eigenvalue problem (1965), chapter 8; exceptional shifts: LAPACK's
/// `zlahqr`. The error is [`Error::NotConverged`], after 120 sweeps for one eigenvalue and for entries that are not
/// finite.
pub(crate) fn complex_eigenvalues(m: &DMatrix<Complex<f64>>) -> Result<Vec<Complex<f64>>, Error> {
    let n = m.nrows();
    let failed = || Error::NotConverged { what: QR_ALGORITHM, iterations: SWEEPS };
    if n == 0 {
        return Ok(Vec::new());
    }
    if !m.iter().all(|entry| entry.re.is_finite() && entry.im.is_finite()) {
        return Err(failed());
    }
    let scale = Balance::new(&m.map(Complex::norm)).scale;
    let balanced = DMatrix::from_fn(n, n, |i, j| m[(i, j)] * (scale[j] / scale[i]));
    let mut h = balanced.hessenberg().unpack_h();
    let norm = h.norm();
    let mut eigenvalues = Vec::with_capacity(n);
    let mut end = n;
    while end > 0 {
        let last = end - 1;
        let mut sweeps = 0;
        loop {
            let first = start_of_block(&h, last, if sweeps < PATIENCE { 0.0 } else { norm });
            if first > 0 {
                h[(first, first - 1)] = Complex::ZERO;
            }
            if first == last {
                eigenvalues.push(h[(last, last)]);
                end = last;
                break;
            }
            if sweeps == SWEEPS {
                return Err(failed());
            }
            sweeps += 1;
            let shift = if sweeps % EXCEPTIONAL == 0 {
                h[(last, last)] + 0.75 * h[(last, last - 1)].norm()
            } else {
                wilkinson(&h, last)
            };
            sweep(&mut h, first, last, shift);
        }
    }
    Ok(eigenvalues)
}

/// Returns the first row of the block that ends in row `last` and has no negligible subdiagonal entry. An entry is
/// negligible by comparison with its neighbours on the diagonal and with `norm`.
fn start_of_block(h: &DMatrix<Complex<f64>>, last: usize, norm: f64) -> usize {
    let size = |at: (usize, usize)| h[at].re.abs() + h[at].im.abs();
    let negligible = |k: usize| {
        let around = size((k, k)) + size((k - 1, k - 1));
        size((k, k - 1)) <= (f64::EPSILON * around.max(norm)).max(f64::MIN_POSITIVE)
    };
    (1..=last).rev().find(|&k| negligible(k)).unwrap_or(0)
}

/// The Wilkinson shift: the eigenvalue of the last 2 x 2 block that is nearer to the last entry.
fn wilkinson(h: &DMatrix<Complex<f64>>, last: usize) -> Complex<f64> {
    let (a, d) = (h[(last - 1, last - 1)], h[(last, last)]);
    let product = h[(last - 1, last)] * h[(last, last - 1)];
    let half = (a - d) * 0.5;
    let root = (half * half + product).sqrt();
    let farther = if (half.conj() * root).re < 0.0 { half - root } else { half + root };
    if farther.norm() > 0.0 { d - product / farther } else { d }
}

/// One QR step on the rows and columns from `first` to `last`: H - s I = Q R, H becomes R Q + s I.
fn sweep(h: &mut DMatrix<Complex<f64>>, first: usize, last: usize, shift: Complex<f64>) {
    for k in first..=last {
        h[(k, k)] -= shift;
    }
    let mut rotations = Vec::with_capacity(last - first);
    for k in first..last {
        let (above, below) = (h[(k, k)], h[(k + 1, k)]);
        let size = above.norm().hypot(below.norm());
        let (c, s) =
            if size > 0.0 { (above / size, below / size) } else { (Complex::ONE, Complex::ZERO) };
        for column in k..=last {
            let (x, y) = (h[(k, column)], h[(k + 1, column)]);
            h[(k, column)] = c.conj() * x + s.conj() * y;
            h[(k + 1, column)] = c * y - s * x;
        }
        rotations.push((c, s));
    }
    for (k, (c, s)) in (first..last).zip(rotations) {
        for row in first..=k + 1 {
            let (x, y) = (h[(row, k)], h[(row, k + 1)]);
            h[(row, k)] = x * c + y * s;
            h[(row, k + 1)] = y * c.conj() - x * s.conj();
        }
    }
    for k in first..=last {
        h[(k, k)] += shift;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sorted(mut all: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
        all.sort_by(|x, y| x.arg().total_cmp(&y.arg()));
        all
    }

    /// The cyclic permutation of n entries, turned by an angle: e^(i (angle + 2 pi k / n)).
    #[test]
    fn the_eigenvalues_of_a_cyclic_permutation_are_roots_of_unity() {
        for n in [1_u32, 2, 3, 8, 20, 31] {
            let size = n as usize;
            let one = Complex::from_polar(1.0, 0.01);
            let entry = |i: usize, j| if (i + 1) % size == j { one } else { Complex::ZERO };
            let m = DMatrix::from_fn(size, size, entry);
            let angle = |k: u32| 0.01 + TAU * f64::from(k) / f64::from(n);
            let expected = sorted((0..n).map(|k| Complex::from_polar(1.0, angle(k))).collect());
            let eigenvalues = sorted(complex_eigenvalues(&m).unwrap());
            for (value, expected) in eigenvalues.iter().zip(&expected) {
                assert!((value - expected).norm() < 1e-13, "{n}: {value}, {expected}");
            }
        }
    }

    /// V diag(0, 1, 1, ...) V^-1 with rounding errors: I - S of a loop with many integrators is such a matrix.
    #[test]
    fn a_cluster_beside_a_zero_is_found() {
        let n = 20;
        let v = DMatrix::from_fn(n, n, |i, j| {
            let at = f64::from(u32::try_from(i * n + j).unwrap());
            Complex::new((at * 1.7).sin(), (at * 0.9).cos()) + if i == j { 4.0 } else { 0.0 }
        });
        let mut diagonal = DMatrix::identity(n, n);
        diagonal[(7, 7)] = Complex::ZERO;
        let m = &v * diagonal * v.clone().try_inverse().unwrap();
        let mut eigenvalues = complex_eigenvalues(&m).unwrap();
        eigenvalues.sort_by(|x, y| x.norm().total_cmp(&y.norm()));
        assert!(eigenvalues[0].norm() < 1e-12);
        let is_one = |value: &Complex<f64>| (value - Complex::ONE).norm() < 1e-10;
        assert!(eigenvalues[1..].iter().all(is_one), "{eigenvalues:?}");
    }

    /// S^-1 M S has the eigenvalues of M, here a cyclic permutation.
    #[test]
    fn the_units_of_the_rows_do_not_change_the_eigenvalues() {
        const UNITS: [f64; 8] = [1e-12, 1.0, 3e15, 1e-3, 7e9, 1e-18, 1e6, 2e12];
        let one = Complex::from_polar(1.0, 0.01);
        let entry = |i: usize, j: usize| {
            if (i + 1) % 8 == j { one * (UNITS[j] / UNITS[i]) } else { Complex::ZERO }
        };
        let eigenvalues = sorted(complex_eigenvalues(&DMatrix::from_fn(8, 8, entry)).unwrap());
        let root = |k: u32| Complex::from_polar(1.0, 0.01 + TAU * f64::from(k) / 8.0);
        for (value, expected) in eigenvalues.iter().zip(sorted((0..8).map(root).collect())) {
            assert!((value - expected).norm() < 1e-13, "{value}, {expected}");
        }
    }

    #[test]
    fn entries_that_are_not_finite_are_an_error() {
        let m = DMatrix::from_element(2, 2, Complex::new(f64::NAN, 0.0));
        assert!(complex_eigenvalues(&m).is_err());
    }
}
