//! Coordinates of the state in which the data of the solver are about one.

use super::{Affine, Disc, Problem, Region};
use crate::balance::{
    Balance, divide_columns, divide_rows, multiply_columns, multiply_rows, power_of_two,
};
use crate::blocks::symmetric_part;
use crate::check::as_number;
use crate::eigen::eigenvalues;
use crate::svd::Svd;
use crate::{Domain, Error};
use nalgebra::{Complex, DMatrix, DVector};

/// Radius of the disc around the eigenvalues, relative to the smallest possible.
const WIDER: f64 = 1.2;
/// Doublings of the sum over powers: (1 / `WIDER`)^(2^10) is negligible.
const DOUBLINGS: usize = 10;
/// Largest factor by which weakly observable directions are stretched.
const STRETCH: f64 = 1e11;

/// Coordinates x~ = T x and a unit of frequency: x' = A x becomes x~' = unit A~ x~ with A~ of about one.
pub(super) struct Coordinates {
    /// T, from x to x~.
    to: DMatrix<f64>,
    /// T^-1, from x~ to x.
    from: DMatrix<f64>,
    pub(super) unit: f64,
}

impl Coordinates {
    /// Coordinates in which the norm of A - c I is little more than its spectral radius. In balanced coordinates T'T =
    /// P solves (A - c I)' P (A - c I) - `s^2` P = -`s^2` I. c is the mean of the eigenvalues, s 1.2 times their
    /// largest distance from c, at least 0.1 |c|, or the norm of A if all eigenvalues are zero. The unit is near |c| +
    /// s. None if rounding errors hide that P > 0; [`Error::NotConverged`] when eigenvalues are not found.
    pub(super) fn of_dynamics(a: &DMatrix<f64>) -> Result<Option<Self>, Error> {
        let n = a.nrows();
        let Balance { matrix, scale } = Balance::new(a);
        let (center, farthest) = spread(a)?;
        let size = (WIDER * farthest).max(0.1 * center.abs());
        let radius = if size > 0.0 { size } else { matrix.norm().max(f64::MIN_POSITIVE) };
        let mut power = (matrix - DMatrix::identity(n, n) * center) / radius;
        let mut p = DMatrix::identity(n, n);
        for _ in 0..DOUBLINGS {
            p += power.transpose() * &p * &power;
            power = &power * &power;
        }
        let Some(factor) = symmetric_part(&p).cholesky() else { return Ok(None) };
        let root = factor.l().transpose();
        let inverse = inverse_of_upper(&root);
        let unit = power_of_two(center.abs() + radius);
        Ok(Some(Self::from_scaled(&scale, &root, &inverse, unit)))
    }

    /// Coordinates in which all states are equally observable through C for an observer whose
    /// eigenvalues are at a distance [`speed`] from the eigenvalues of A: T'T is the sum of (C
    /// `M^k`)' (C `M^k`), k from 0 to n - 1, with M = (A - c I) / speed, c the mean of the
    /// eigenvalues of A. Weakly observable directions are stretched by at most 1e11. The unit of frequency is the speed
    /// in continuous time, 1 in sampled time. The error is [`Error::NotConverged`].
    pub(super) fn of_observation(
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        region: &Region,
        domain: Domain,
    ) -> Result<Self, Error> {
        let (n, p) = (a.nrows(), c.nrows());
        let (center, speed) = speed(a, region, domain)?;
        let shifted = (a - DMatrix::identity(n, n) * center) / speed;
        let mut rows = divide_rows(c, &row_units(c));
        let mut observability = DMatrix::zeros(n * (p + 1), n);
        for k in 0..n {
            observability.rows_mut(k * p, p).copy_from(&rows);
            rows *= &shifted;
        }
        let scale = DVector::from_fn(n, |at, _| 1.0 / unit_near(observability.column(at).norm()));
        observability = multiply_columns(&observability, &scale);
        let regularisation = observability.norm() / STRETCH;
        observability.rows_mut(n * p, n).fill_diagonal(regularisation);
        let svd = Svd::new(&observability.transpose())?;
        let (directions, values) = (svd.left.columns(0, n), svd.values.rows(0, n).into_owned());
        let root = multiply_rows(&directions.transpose(), &values);
        let inverse = divide_columns(&directions.into_owned(), &values);
        Ok(Self::from_scaled(&scale, &root, &inverse, time_unit(domain, speed)))
    }

    /// Coordinates in which P becomes the identity; `p` is P in the coordinates `self`. None if `p` is not positive
    /// definite.
    pub(super) fn refined(&self, p: &DMatrix<f64>) -> Option<Self> {
        let root = p.clone().cholesky()?.l().transpose();
        let from = &self.from * inverse_of_upper(&root);
        Some(Self { to: root * &self.to, from, unit: self.unit })
    }

    /// Coordinates in which the most interior P of a program becomes the identity; `p` is the unknown P in the
    /// coordinates `self`. None if the program has no solution.
    pub(super) fn refined_by(&self, problem: &Problem, p: &Affine) -> Option<Self> {
        self.refined(&p.evaluate(&problem.most_interior()?))
    }

    /// Number of states.
    pub(super) fn order(&self) -> usize {
        self.to.nrows()
    }

    /// The coordinates `self`, extended by states of the given sizes at the end.
    pub(super) fn extended(&self, sizes: &DVector<f64>) -> Self {
        let (order, whole) = (self.order(), self.order() + sizes.len());
        let mut to = self.to.clone().resize(whole, whole, 0.0);
        let mut from = self.from.clone().resize(whole, whole, 0.0);
        for (at, size) in sizes.iter().enumerate() {
            to[(order + at, order + at)] = 1.0 / size;
            from[(order + at, order + at)] = *size;
        }
        Self { to, from, unit: self.unit }
    }

    /// The coordinates for A' that correspond to the coordinates `self` for A.
    pub(super) fn transposed(&self) -> Self {
        Self { to: self.from.transpose(), from: self.to.transpose(), unit: self.unit }
    }

    /// The coordinates x~ = `root` y with x = S y, S the diagonal `scale`; `inverse` is the inverse of `root`.
    fn from_scaled(
        scale: &DVector<f64>,
        root: &DMatrix<f64>,
        inverse: &DMatrix<f64>,
        unit: f64,
    ) -> Self {
        Self { to: divide_columns(root, scale), from: multiply_rows(inverse, scale), unit }
    }

    /// A in the coordinates x~: T A T^-1 / unit.
    pub(super) fn dynamics(&self, a: &DMatrix<f64>) -> DMatrix<f64> {
        self.input(&(a * &self.from))
    }

    /// B in the coordinates x~: T B / unit.
    pub(super) fn input(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        &self.to * b / self.unit
    }

    /// C in the coordinates x~: C T^-1.
    pub(super) fn output(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        c * &self.from
    }

    /// P in the coordinates of the data: T' P~ T.
    pub(super) fn certificate(&self, p: &DMatrix<f64>) -> DMatrix<f64> {
        symmetric_part(&(self.to.transpose() * p * &self.to))
    }

    /// Q in the coordinates of the data: T^-1 Q~ T'^-1.
    pub(super) fn shape(&self, q: &DMatrix<f64>) -> DMatrix<f64> {
        symmetric_part(&(&self.from * q * self.from.transpose()))
    }

    /// L in the coordinates of the data, T^-1 L~ unit, for the error dynamics A - L C.
    pub(super) fn gain(&self, l: &DMatrix<f64>) -> DMatrix<f64> {
        &self.from * l * self.unit
    }
}

/// The unit of frequency of a program: `unit` in continuous time, 1 in sampled time.
pub(super) fn time_unit(domain: Domain, unit: f64) -> f64 {
    if domain == Domain::Continuous { unit } else { 1.0 }
}

/// The power of two nearest to a size; 1 for 0.
pub(super) fn unit_near(size: f64) -> f64 {
    if size > 0.0 { power_of_two(size) } else { 1.0 }
}

/// Units of signals: powers of two near the lengths of the rows of a matrix.
pub(super) fn row_units(m: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_fn(m.nrows(), |row, _| unit_near(m.row(row).norm()))
}

/// The mean of the eigenvalues, and the largest distance of an eigenvalue from the mean.
fn spread(a: &DMatrix<f64>) -> Result<(f64, f64), Error> {
    let mean = a.trace() / as_number(a.nrows());
    let distance = |value: &Complex<f64>| (value - Complex::new(mean, 0.0)).norm();
    Ok((mean, eigenvalues(a)?.iter().map(distance).fold(0.0, f64::max)))
}

/// The mean of the eigenvalues, and a power of two near the distance by which eigenvalues are moved.
///
/// The mean moves to the target: the centre of the disc, else the limit of the decay rate, else the mean itself. The
/// distance is at least the largest distance of an eigenvalue of A from the mean.
fn speed(a: &DMatrix<f64>, region: &Region, domain: Domain) -> Result<(f64, f64), Error> {
    let (mean, spread) = spread(a)?;
    let limit = |alpha: f64| match domain {
        Domain::Continuous => -alpha,
        Domain::Sampled { period } => (-alpha * period).exp(),
    };
    let disc = region.disc.map(|Disc { center, .. }| center);
    let target = disc.or(region.decay.map(limit)).unwrap_or(mean);
    Ok((mean, unit_near(spread.max((target - mean).abs()))))
}

/// The inverse of an upper triangular matrix.
fn inverse_of_upper(u: &DMatrix<f64>) -> DMatrix<f64> {
    let diagonal = u.diagonal();
    let unit = divide_rows(u, &diagonal);
    let identity = DMatrix::identity(u.nrows(), u.nrows());
    let inverse = unit.solve_upper_triangular(&identity).unwrap_or(identity);
    divide_columns(&inverse, &diagonal)
}
