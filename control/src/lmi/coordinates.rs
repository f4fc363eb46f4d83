//! Coordinates in which the solver meets numbers of about one.

use crate::Error;
use crate::balance::{Balance, divide_columns, divide_rows, multiply_columns, power_of_two};
use crate::eigen::eigenvalues;
use crate::singular::Singular;
use nalgebra::{Complex, DMatrix, DVector};

/// Radius of the disc around the eigenvalues relative to the smallest.
const WIDER: f64 = 1.2;
/// Doublings of the sum over powers: (1 / `WIDER`)^(2^10) is nothing.
const DOUBLINGS: usize = 10;
/// Directions that can hardly be seen are not stretched by more than this.
const STRETCH: f64 = 1e6;

/// x~ = T x and the time scale: x' = A x becomes x~' = unit A~ x~ with A~ of about one.
pub(super) struct Coordinates {
    to: DMatrix<f64>,
    from: DMatrix<f64>,
    pub(super) unit: f64,
}

impl Coordinates {
    /// Coordinates in which A differs from a multiple of the identity by little more than its
    /// eigenvalues do: T'T = P with (A - c I)' P (A - c I) - `s^2` P = -`s^2` I, c the mean of the
    /// eigenvalues, s 1.2 times the largest distance from it.
    pub(super) fn of_dynamics(a: &DMatrix<f64>) -> Result<Self, Error> {
        let n = a.nrows();
        let Balance { matrix, scale } = Balance::of(a);
        let order = f64::from(u32::try_from(n).unwrap_or(u32::MAX));
        let center = matrix.trace() / order;
        let distance = |value: &Complex<f64>| (value - Complex::new(center, 0.0)).norm();
        let farthest = eigenvalues(a)?.iter().map(distance).fold(0.0, f64::max);
        let radius = (WIDER * farthest).max(0.1 * center.abs()).max(f64::MIN_POSITIVE);
        let mut power = (matrix - DMatrix::identity(n, n) * center) / radius;
        let mut p = DMatrix::identity(n, n);
        for _ in 0..DOUBLINGS {
            p += power.transpose() * &p * &power;
            power = &power * &power;
        }
        let p = (&p + p.transpose()) * 0.5;
        let factor = p.cholesky().ok_or(Error::NotPositiveDefinite { matrix: "the scaling" })?;
        let root = factor.l().transpose();
        let inverse = inverse_of_upper(&root);
        let unit = power_of_two(center.abs() + radius);
        Ok(Self::within(&scale, &root, &inverse, unit))
    }

    /// Coordinates in which all states are seen equally well through C in the time that `unit`
    /// allows: T'T is the sum of the first n terms (C `A^k` / `unit^k`)' (C `A^k` / `unit^k`).
    pub(super) fn of_observation(
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        unit: f64,
    ) -> Result<Self, Error> {
        let (n, p) = (a.nrows(), c.nrows());
        let mut seen = DMatrix::zeros(n * p, n);
        let mut rows = c.clone();
        for mut row in rows.row_iter_mut() {
            let norm = row.norm();
            row /= if norm > 0.0 { power_of_two(norm) } else { 1.0 };
        }
        for k in 0..n {
            seen.rows_mut(k * p, p).copy_from(&rows);
            rows = rows * a / unit;
        }
        let length = |norm: f64| if norm > 0.0 { 1.0 / power_of_two(norm) } else { 1.0 };
        let scale = DVector::from_fn(n, |at, _| length(seen.column(at).norm()));
        let found = Singular::of(&multiply_columns(&seen, &scale))?;
        let least = (found.values[0] / STRETCH).max(f64::MIN_POSITIVE);
        let values = found.values.map(|value| value.max(least));
        let root = multiply_columns(&found.right, &values).transpose();
        let inverse = divide_columns(&found.right, &values);
        Ok(Self::within(&scale, &root, &inverse, unit))
    }

    /// x = S y with S diagonal, x~ = `root` y.
    fn within(
        scale: &DVector<f64>,
        root: &DMatrix<f64>,
        inverse: &DMatrix<f64>,
        unit: f64,
    ) -> Self {
        let from = DMatrix::from_fn(root.nrows(), root.nrows(), |i, j| scale[i] * inverse[(i, j)]);
        Self { to: divide_columns(root, scale), from, unit }
    }

    /// A~ = T A T^-1 / unit.
    pub(super) fn dynamics(&self, a: &DMatrix<f64>) -> DMatrix<f64> {
        self.input(&(a * &self.from))
    }

    /// B~ = T B / unit.
    pub(super) fn input(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        &self.to * b / self.unit
    }

    /// C~ = C T^-1.
    pub(super) fn output(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        c * &self.from
    }

    /// P = T' P~ T.
    pub(super) fn certificate(&self, p: &DMatrix<f64>) -> DMatrix<f64> {
        let p = self.to.transpose() * p * &self.to;
        (&p + p.transpose()) * 0.5
    }

    /// L = T^-1 L~ unit for the error dynamics A - L C.
    pub(super) fn gain(&self, l: &DMatrix<f64>) -> DMatrix<f64> {
        &self.from * l * self.unit
    }
}

fn inverse_of_upper(u: &DMatrix<f64>) -> DMatrix<f64> {
    let diagonal = u.diagonal();
    let unit = divide_rows(u, &diagonal);
    let identity = DMatrix::identity(u.nrows(), u.nrows());
    let inverse = unit.solve_upper_triangular(&identity).unwrap_or(identity);
    divide_columns(&inverse, &diagonal)
}
