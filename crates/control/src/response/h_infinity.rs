//! The H-infinity norm.

use super::System;
use super::frequency::Transfer;
use crate::eigen::eigenvalues;
use crate::singular::Singular;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;
use std::f64::consts::{FRAC_PI_2, SQRT_2};

const ROUNDS: usize = 100;

/// The H-infinity norm and where it is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HInfinity {
    /// The largest singular value that was found; the norm is not below.
    pub lower: f64,
    /// No frequency was found at which the largest singular value reaches this.
    pub upper: f64,
    /// The frequency of `lower` in rad per unit of time; infinite when it is the D of a continuous
    /// system.
    pub frequency: f64,
}

/// The H-infinity norm: the largest singular value of G over all frequencies.
///
/// It is the largest ratio of the energy of z to that of w, as the root. `width`: relative width of
/// the answer, at least 1e-10. It is finite when A is stable. Method: the singular values of G
/// equal gamma at the imaginary eigenvalues of the Hamiltonian matrix
///
/// ```text
/// [A + B R^-1 D' C, B R^-1 B'; -C' (I + D R^-1 D') C, -(A + B R^-1 D' C)'],  R = gamma^2 I - D' D
/// ```
///
/// so that gamma, a little above the largest value known, is the norm when the largest singular
/// value stays below gamma at the imaginary parts of all eigenvalues and midway between them. Which
/// eigenvalues are imaginary need not be decided. Otherwise the largest found takes the place of
/// gamma; this converges quadratically. A sampled system is first taken to a continuous one by z =
/// (1 + s) / (1 - s). About 100 n^3 multiplications for the eigenvalues and 4 n^3 for each of the 4
/// n frequencies in a round; usually 3 to 6 rounds.
///
/// Source: N. A. Bruinsma and M. Steinbuch, A fast algorithm to compute the H-infinity norm of a
/// transfer function matrix, Systems & Control Letters 14 (1990); S. Boyd and V. Balakrishnan, 15
/// (1990).
///
/// # Example
///
/// ```
/// use control::Domain;
/// use control::response::{System, h_infinity};
/// use nalgebra::DMatrix;
/// // 1 / (s^2 + 2 d s + 1) with d = 0.1: 1 / (2 d sqrt(1 - d^2)) at w^2 = 1 - 2 d^2.
/// let system = System {
///     a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -0.2]),
///     b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
///     c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
///     d: DMatrix::zeros(1, 1),
///     domain: Domain::Continuous,
/// };
/// let norm = h_infinity(&system, 1e-8)?;
/// assert!((norm.lower - 1.0 / (0.2 * 0.99_f64.sqrt())).abs() < 1e-7);
/// assert!((norm.frequency - 0.98_f64.sqrt()).abs() < 1e-3);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Those of [`System::check`]; [`Error::OutOfRange`] for `width`; [`Error::NotHurwitz`],
/// [`Error::NotSchur`]; [`Error::NotConverged`]; [`Error::Overflow`].
pub fn h_infinity(system: &System, width: f64) -> Result<HInfinity, Error> {
    let modes = system.stable_eigenvalues()?;
    check::positive("width", width)?;
    let width = width.max(1e-10);
    let transfer = Transfer::of(system);
    let level = LevelSet::of(system)?;
    let mut best = level.ends(&transfer)?;
    let resonances = modes.iter().flat_map(|mode| match system.domain {
        Domain::Continuous => vec![mode.im.abs(), mode.norm()],
        Domain::Sampled { period } => vec![mode.arg().abs() / period],
    });
    for frequency in resonances {
        best.offer(&transfer, frequency)?;
    }
    for _ in 0..ROUNDS {
        if best.lower == 0.0 {
            return Ok(best);
        }
        best.upper = best.lower * (1.0 + width);
        for frequency in level.crossings(best.upper)? {
            best.offer(&transfer, frequency)?;
        }
        if best.lower < best.upper {
            return Ok(best);
        }
    }
    Err(Error::NotConverged { what: "the H-infinity norm", iterations: ROUNDS })
}

impl HInfinity {
    fn offer(&mut self, transfer: &Transfer, frequency: f64) -> Result<(), Error> {
        let size = transfer.size(frequency)?;
        if size > self.lower {
            self.lower = size;
            self.frequency = frequency;
        }
        Ok(())
    }
}

/// A continuous system with the same singular values.
struct LevelSet {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    domain: Domain,
}

impl LevelSet {
    fn of(system: &System) -> Result<Self, Error> {
        let System { a, b, c, d, domain } = system.clone();
        if domain == Domain::Continuous {
            return Ok(Self { a, b, c, d, domain });
        }
        let identity = DMatrix::identity(a.nrows(), a.nrows());
        let overflow = Error::Overflow { what: "(A + I)^-1" };
        let inverse = (&a + &identity).try_inverse().ok_or(overflow)?;
        Ok(Self {
            a: &inverse * (a - identity),
            b: &inverse * &b * SQRT_2,
            d: d - &c * &inverse * b,
            c: c * inverse * SQRT_2,
            domain,
        })
    }

    /// The larger of the values at frequency zero and at the other end.
    fn ends(&self, transfer: &Transfer) -> Result<HInfinity, Error> {
        let frequency = match self.domain {
            Domain::Continuous => f64::INFINITY,
            Domain::Sampled { period } => 2.0 * FRAC_PI_2 / period,
        };
        let lower = Singular::of(&self.d)?.values[0];
        let mut best = HInfinity { lower, upper: lower, frequency };
        best.offer(transfer, 0.0)?;
        Ok(best)
    }

    /// Frequencies among which are those where a singular value of G is gamma, and those midway.
    fn crossings(&self, gamma: f64) -> Result<Vec<f64>, Error> {
        let (n, m, p) = (self.a.nrows(), self.b.ncols(), self.c.nrows());
        let (b, c, d) = (&self.b / gamma.sqrt(), &self.c / gamma.sqrt(), &self.d / gamma);
        let overflow = Error::Overflow { what: "(gamma^2 I - D' D)^-1" };
        let r = DMatrix::identity(m, m) - d.tr_mul(&d);
        let inverse = r.try_inverse().ok_or(overflow)?;
        let a = &self.a + &b * &inverse * d.tr_mul(&c);
        let weight = DMatrix::identity(p, p) + &d * &inverse * d.transpose();
        let mut hamiltonian = DMatrix::zeros(2 * n, 2 * n);
        hamiltonian.view_mut((0, 0), (n, n)).copy_from(&a);
        hamiltonian.view_mut((0, n), (n, n)).copy_from(&(&b * inverse * b.transpose()));
        hamiltonian.view_mut((n, 0), (n, n)).copy_from(&-(c.tr_mul(&weight) * &c));
        hamiltonian.view_mut((n, n), (n, n)).copy_from(&-a.transpose());
        let hamiltonian = check::in_range("the Hamiltonian matrix", hamiltonian)?;
        let mut found: Vec<f64> = eigenvalues(&hamiltonian)?.iter().map(|x| x.im.abs()).collect();
        found.push(0.0);
        found.sort_by(f64::total_cmp);
        found.dedup();
        let middles: Vec<f64> = found.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        found.extend(middles);
        Ok(found.into_iter().map(|frequency| self.given(frequency)).collect())
    }

    /// The frequency in the time of the system given.
    fn given(&self, frequency: f64) -> f64 {
        match self.domain {
            Domain::Continuous => frequency,
            Domain::Sampled { period } => 2.0 * frequency.atan() / period,
        }
    }
}
