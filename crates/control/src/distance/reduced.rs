//! The smallest singular value of [A - s I, B] for many s.

use crate::blocks::{ComplexMatrix, beside, to_complex};
use nalgebra::{Complex, DMatrix, DVector};

/// Number of steps of the inverse iteration.
const ITERATIONS: usize = 6;
/// A substitution divides the vector by the modulus of any entry above this, so that no product overflows.
const LARGE: f64 = 1e100;

/// The pencil [B, A - s I] in coordinates in which [B, A] is zero below its diagonal.
///
/// The smallest singular value for one s needs about 2 (m + 4) n^2 complex multiplications: m + 1
/// columns at a time are reflected, from the last row to the first, until the pencil is [0, T] with a
/// triangular T; then six steps of inverse iteration with T T*.
///
/// Source: controller Hessenberg form, C. C. Paige, Properties of numerical algorithms related to
/// computing controllability, IEEE Trans. Autom. Control 26 (1981).
pub(super) struct ReducedPencil {
    /// The matrix [B, A], n x (m + n).
    both: ComplexMatrix,
    inputs: usize,
}

impl ReducedPencil {
    /// `a`: n x n; `b`: n x m.
    pub(super) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Self {
        let (n, inputs) = b.shape();
        let mut both = beside(b, a);
        for at in 0..n.saturating_sub(1) {
            let mut v = both.view((at, at), (n - at, 1)).into_owned();
            let norm = v.norm();
            if v.rows(1, n - at - 1).amax() <= 0.0 {
                continue;
            }
            v[0] += norm.copysign(v[0]);
            v.unscale_mut(v.norm());
            let mut left = both.view_mut((at, at), (n - at, inputs + n - at));
            let products = left.tr_mul(&v);
            left.ger(-2.0, &v.column(0), &products.column(0), 1.0);
            let mut right = both.columns_mut(inputs + at, n - at);
            let products = &right * &v;
            right.ger(-2.0, &products.column(0), &v.column(0), 1.0);
            both.view_mut((at + 1, at), (n - at - 1, 1)).fill(0.0);
        }
        Self { both: to_complex(&both), inputs }
    }

    /// Returns a close upper bound of the smallest singular value of [A - s I, B], and u* A u with its left singular
    /// vector u.
    pub(super) fn at(&self, s: Complex<f64>) -> (f64, Complex<f64>) {
        let n = self.both.nrows();
        let mut pencil = self.both.clone();
        for i in 0..n {
            pencil[(i, self.inputs + i)] -= s;
        }
        let mut t = triangular(pencil, self.inputs);
        // A T singular within rounding is made regular; inverse iteration then gives the left singular vector.
        for i in 0..n {
            if t[(i, i)].norm() < f64::EPSILON {
                t[(i, i)] = Complex::from(f64::EPSILON);
            }
        }
        let mut u =
            DVector::from_fn(n, |i, _| Complex::new(1.0, if i % 2 == 0 { 0.3 } else { -0.2 }));
        u.unscale_mut(u.norm());
        for _ in 0..ITERATIONS {
            solve(&t, &mut u);
            solve_adjoint(&t, &mut u);
        }
        let image = self.both.columns(self.inputs, n) * &u;
        (t.ad_mul(&u).norm(), u.dotc(&image))
    }
}

/// Replaces u by T^-1 u, scaled to length one; T: upper triangular, its diagonal at least eps, the unit of rounding.
///
/// u is also scaled down on the way, so that it does not overflow: a chain of k states that no input reaches gives
/// T^-1 entries of the size eps^-k.
fn solve(t: &ComplexMatrix, u: &mut DVector<Complex<f64>>) {
    for i in (0..u.len()).rev() {
        u[i] /= t[(i, i)];
        limit(u, i);
        let entry = u[i];
        u.rows_mut(0, i).axpy(-entry, &t.column(i).rows(0, i), Complex::from(1.0));
    }
    u.unscale_mut(u.norm());
}

/// Replaces u by the direction of T^-* u, see [`solve`].
fn solve_adjoint(t: &ComplexMatrix, u: &mut DVector<Complex<f64>>) {
    for i in 0..u.len() {
        let known = t.column(i).rows(0, i).dotc(&u.rows(0, i));
        u[i] = (u[i] - known) / t[(i, i)].conj();
        limit(u, i);
    }
    u.unscale_mut(u.norm());
}

/// Divides the vector by the modulus of its entry `at` if this modulus is above [`LARGE`].
fn limit(u: &mut DVector<Complex<f64>>, at: usize) {
    let size = u[at].norm();
    if size > LARGE {
        u.unscale_mut(size);
    }
}

/// The upper triangular T of the pencil [0, T] Z, n x (m + n), zero below its diagonal, with a unitary Z.
fn triangular(mut pencil: ComplexMatrix, inputs: usize) -> ComplexMatrix {
    let n = pencil.nrows();
    for row in (0..n).rev() {
        let entries = pencil.view((row, row), (1, inputs + 1)).adjoint();
        if entries.rows(0, inputs).norm_squared() <= 0.0 {
            continue;
        }
        let (mut v, last) = (entries.column(0).into_owned(), entries[inputs]);
        let phase = if last.norm() > 0.0 { last.unscale(last.norm()) } else { Complex::from(1.0) };
        v[inputs] += phase.scale(entries.norm());
        v.unscale_mut(v.norm());
        let mut columns = pencil.view_mut((0, row), (row + 1, inputs + 1));
        let products = &columns * &v;
        columns.gerc(Complex::from(-2.0), &products, &v, Complex::from(1.0));
    }
    pencil.columns(inputs, n).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::svd::ComplexSvd;

    #[test]
    fn singular_values_are_those_of_the_pencil() {
        let entry = |i: usize, j: usize| {
            let number = u32::try_from((7 * i * i + 11 * j + 3 * i * j) % 19).unwrap();
            f64::from(number) / 19.0 - 0.5
        };
        for (n, m) in [(30, 1), (30, 3), (4, 4), (5, 6)] {
            let a = DMatrix::from_fn(n, n, entry);
            let b = DMatrix::from_fn(n, m, |i, j| entry(j + 5, i));
            let reduced = ReducedPencil::new(&a, &b);
            for s in [Complex::new(0.3, 0.7), Complex::new(-1.0, 0.0)] {
                let mut tall = to_complex(&b.clone().resize_horizontally(m + n, 0.0));
                tall.columns_mut(m, n).copy_from(&to_complex(&a));
                for i in 0..n {
                    tall[(i, m + i)] -= s;
                }
                let exact = ComplexSvd::new(&tall.adjoint()).unwrap().values();
                let mut pencil = reduced.both.clone();
                for i in 0..n {
                    pencil[(i, m + i)] -= s;
                }
                let values = ComplexSvd::new(&triangular(pencil, m)).unwrap().values();
                let largest = exact[0];
                for (value, exact) in values.iter().zip(&exact) {
                    assert!((value - exact).abs() < 1e-13 * largest, "{n} {m}: {value} {exact}");
                }
                let ratio = reduced.at(s).0 / exact[n - 1];
                assert!((1.0 - 1e-12..1.05).contains(&ratio), "{n} {m}: {ratio}");
            }
        }
    }

    #[test]
    fn an_uncontrollable_state_that_nothing_moves_has_the_singular_value_zero() {
        let mut a = DMatrix::from_fn(30, 30, |i, j| if i == j + 1 { 0.3 } else { 0.0 });
        a.fill_row(29, 0.0);
        a[(29, 29)] = 0.25;
        let b = DMatrix::from_fn(30, 1, |i, _| f64::from(u8::from(i == 0)));
        let (value, s) = ReducedPencil::new(&a, &b).at(Complex::from(0.25));
        assert!(value < 1e-15 && (s - 0.25).norm() < 1e-15, "{value} {s}");
    }

    #[test]
    fn a_chain_of_uncontrollable_states_has_the_singular_value_zero_whatever_its_length() {
        for first in [39, 30, 15] {
            let mut a = DMatrix::zeros(40, 40);
            for i in 0..39 {
                a[if i + 1 < first { (i + 1, i) } else { (i, i + 1) }] = 1.0;
            }
            a[(first - 1, first)] = 0.0;
            let b = DMatrix::from_fn(40, 1, |i, _| f64::from(u8::from(i == 0)));
            let (value, s) = ReducedPencil::new(&a, &b).at(Complex::from(0.0));
            assert!(value < 1e-15 && s.norm() < 1e-15, "{first}: {value} {s}");
        }
    }
}
