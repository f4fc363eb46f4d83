//! Eigenvalues of large Hamiltonian matrices.

use super::francis;
use crate::balance::Balance;
use crate::blocks::block_2x2;
use nalgebra::{Complex, DMatrix, DVector};

/// A Hamiltonian matrix [A, G; Q, -A'] with symmetric G and Q.
pub(crate) struct Hamiltonian {
    a: DMatrix<f64>,
    g: DMatrix<f64>,
    q: DMatrix<f64>,
}

impl Hamiltonian {
    /// Creates the matrix from its blocks, n x n each, with balanced states and costates.
    ///
    /// The states are scaled by the diagonal D, the costates by D^-1, which keeps the matrix Hamiltonian and changes no
    /// eigenvalue. D^2 is the ratio of the scales of state and costate that balance the whole matrix: a factor that all
    /// scales have in common changes no entry.
    pub(crate) fn balanced(a: &DMatrix<f64>, g: &DMatrix<f64>, q: &DMatrix<f64>) -> Self {
        let n = a.nrows();
        let scale = Balance::new(&block_2x2([a, g], [q, &-a.transpose()])).scale;
        let unit = DVector::from_fn(n, |i, _| (scale[i] / scale[n + i]).sqrt());
        Self {
            a: DMatrix::from_fn(n, n, |i, j| a[(i, j)] * (unit[j] / unit[i])),
            g: DMatrix::from_fn(n, n, |i, j| g[(i, j)] / unit[i] / unit[j]),
            q: DMatrix::from_fn(n, n, |i, j| q[(i, j)] * unit[i] * unit[j]),
        }
    }

    /// The Frobenius norm of the balanced matrix.
    pub(crate) fn norm(&self) -> f64 {
        (2.0 * self.a.norm_squared() + self.g.norm_squared() + self.q.norm_squared()).sqrt()
    }

    /// One eigenvalue x of each pair x, -x, with a real part that is not negative; None if the QR algorithm
    /// does not converge.
    ///
    /// The square of the matrix is skew-Hamiltonian, [M, N; K, M'] with skew-symmetric N and K.
    /// Orthogonal symplectic transformations make K zero and M a Hessenberg matrix, whose eigenvalues are
    /// the squares of the results: about a quarter of the multiplications that the eigenvalues of the
    /// whole matrix need. An eigenvalue x has an error of about eps |H|^2 / |x|, at most sqrt(eps) |H|.
    ///
    /// Source: C. F. Van Loan, A symplectic method for approximating all the eigenvalues of a Hamiltonian
    /// matrix, Linear Algebra Appl. 61 (1984).
    pub(crate) fn eigenvalues(&self) -> Option<Vec<Complex<f64>>> {
        let Self { a, g, q } = self;
        let (a_g, q_a) = (a * g, q * a);
        let mut square =
            Square { m: a * a + g * q, n: &a_g - a_g.transpose(), k: &q_a - q_a.transpose() };
        let order = a.nrows();
        for column in 0..order.saturating_sub(1) {
            let below = order - column - 1;
            let entries = square.k.view((column + 1, column), (below, 1)).column(0).into_owned();
            square.reflect(column, entries);
            square.rotate(column);
            let entries = square.m.view((column + 1, column), (below, 1)).column(0).into_owned();
            square.reflect(column, entries);
        }
        let squares = francis::eigenvalues(square.m)?;
        Some(squares.into_iter().map(Complex::sqrt).collect())
    }
}

/// The matrix [M, N; K, M'] during the reduction, which proceeds by columns.
///
/// In the reduced columns K is zero. N is not updated there: its entries follow from the rows, because N is
/// skew-symmetric.
struct Square {
    m: DMatrix<f64>,
    n: DMatrix<f64>,
    k: DMatrix<f64>,
}

impl Square {
    /// Transforms the states below `column`, and their costates, by the reflection that maps `vector` to a multiple of
    /// the first axis; does nothing if `vector` is zero or has one entry.
    fn reflect(&mut self, column: usize, mut vector: DVector<f64>) {
        let size = vector.norm();
        if vector.len() < 2 || !size.is_normal() {
            return;
        }
        vector[0] += size.copysign(vector[0]);
        let (first, order) = (column + 1, self.m.nrows());
        let below = order - first;
        let v = vector.normalize();
        // P = I - 2 v v'. M becomes P M P.
        let mut rows = self.m.view_mut((first, column), (below, below + 1));
        let product = rows.tr_mul(&v);
        rows.ger(-2.0, &v, &product, 1.0);
        let mut columns = self.m.columns_mut(first, below);
        let product = &columns * &v;
        columns.ger(-2.0, &product, &v, 1.0);
        // A skew-symmetric N becomes N - p v' + v p' with p = 2 N v.
        let mut columns = self.n.columns_mut(first, below);
        let product = &columns * &v;
        columns.ger(-2.0, &product, &v, 1.0);
        let product = product.rows(first, below);
        self.n.view_mut((first, first), (below, below)).ger(2.0, &v, &product, 1.0);
        let mut rest = self.k.view_mut((column, column), (below + 1, below + 1));
        let product = rest.columns(1, below) * &v;
        rest.columns_mut(1, below).ger(-2.0, &product, &v, 1.0);
        rest.rows_mut(1, below).ger(2.0, &v, &product, 1.0);
    }

    /// Rotates the first state below `column` and its costate such that the entry of K in this row and in `column`
    /// becomes zero.
    fn rotate(&mut self, column: usize) {
        let (i, order) = (column + 1, self.m.nrows());
        let (x, y) = (self.m[(i, column)], self.k[(i, column)]);
        let size = x.hypot(y);
        if y == 0.0 || !size.is_normal() {
            return;
        }
        let (c, s) = (x / size, -y / size);
        for l in (0..order).filter(|l| *l != i) {
            let (m, n) = (self.m[(l, i)], self.n[(l, i)]);
            self.m[(l, i)] = c * m - s * n;
            self.n[(l, i)] = s * m + c * n;
            self.n[(i, l)] = -self.n[(l, i)];
        }
        for l in (column..order).filter(|l| *l != i) {
            let (m, k) = (self.m[(i, l)], self.k[(i, l)]);
            self.m[(i, l)] = c * m - s * k;
            self.k[(i, l)] = s * m + c * k;
            self.k[(l, i)] = -self.k[(i, l)];
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::eigen::eigenvalues;

    /// Numbers from -1/2 to 1/2, the same in every run.
    pub(crate) fn random(mut seed: f64) -> impl FnMut() -> f64 {
        move || {
            seed = (seed * 997.0 + 0.123).fract();
            seed - 0.5
        }
    }

    /// Removes the number nearest to `value`; returns its distance.
    pub(crate) fn remove_nearest(numbers: &mut Vec<Complex<f64>>, value: Complex<f64>) -> f64 {
        let distance = |at: &usize| (numbers[*at] - value).norm();
        let nearest = (0..numbers.len()).min_by(|x, y| distance(x).total_cmp(&distance(y)));
        (numbers.swap_remove(nearest.unwrap()) - value).norm()
    }

    #[test]
    fn the_eigenvalues_are_those_of_the_whole_matrix() {
        let sizes = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0];
        for n in [1, 2, 3, 7, 30] {
            let mut random = random(1.0);
            let a = DMatrix::from_fn(n, n, |i, j| random() * sizes[(i + 2 * j) % 9]);
            let mut symmetric = || {
                let half = DMatrix::from_fn(n, n, |_, _| random());
                &half + half.transpose()
            };
            let (g, q) = (symmetric() * 1e3, symmetric());
            let hamiltonian = Hamiltonian::balanced(&a, &g, &q);
            let roots = hamiltonian.eigenvalues().unwrap();
            let mut expected = eigenvalues(&block_2x2([&a, &g], [&q, &-a.transpose()])).unwrap();
            assert_eq!(2 * roots.len(), expected.len());
            for value in roots.iter().flat_map(|value| [*value, -value]) {
                let error = remove_nearest(&mut expected, value);
                let norm = hamiltonian.norm();
                assert!(error < 1e-12 * norm * norm / value.norm(), "{n}: {value} {error}");
            }
        }
    }

    /// A change of the unit of all states, by 2^20, multiplies G by 2^40 and Q by 2^-40.
    #[test]
    fn the_balanced_norm_does_not_depend_on_the_unit_of_the_states() {
        let n = 7;
        let norm = |unit: f64| {
            let mut random = random(1.0);
            let a = DMatrix::from_fn(n, n, |_, _| random());
            let mut symmetric = || {
                let half = DMatrix::from_fn(n, n, |_, _| random());
                &half + half.transpose()
            };
            let (g, q) = (symmetric() * (unit * unit), symmetric() / (unit * unit));
            Hamiltonian::balanced(&a, &g, &q).norm()
        };
        let (one, large, small) = (norm(1.0), norm(2.0_f64.powi(20)), norm(2.0_f64.powi(-20)));
        assert!(large < 2.0 * one && small < 2.0 * one, "{one} {large} {small}");
    }
}
