//! The H-infinity norm.

use super::{KnownResponse, singular_values};
use crate::blocks::block_2x2;
use crate::eigen::{Hamiltonian, eigenvalues};
use crate::svd::norm_2;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::SQRT_2;

const ROUNDS: usize = 100;
/// In a Hamiltonian matrix of at least this order, eigenvalues with a real part above `IMAGINARY` times their modulus
/// and above `ROUNDING` times the norm count as not imaginary.
const LARGE: usize = 96;
const IMAGINARY: f64 = 1e-3;
const ROUNDING: f64 = 1e-7;
/// The first and the smallest logarithmic step of the frequency towards a local maximum. The smallest step is relative
/// to the root of the width, as the maximum is flat.
const FIRST_STEP: f64 = 0.05;
const SMALLEST_STEP: f64 = 0.02;

/// The H-infinity norm and the frequency of its maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct HInfinity {
    /// Lower bound: the largest singular value that was evaluated.
    pub lower: f64,
    /// Upper bound of the largest singular value at every frequency, up to rounding.
    pub upper: f64,
    /// The frequency of `lower` in rad per unit of time; infinite for the D of a continuous system.
    pub frequency: f64,
}

/// Computes the H-infinity norm: the largest singular value of G over all frequencies.
///
/// The norm is the root of the largest ratio of the energy of z to the energy of w. `width`: relative width of the
/// result; values below 1e-10 count as 1e-10. The norm is finite when A is stable.
///
/// Method: the singular values of G equal gamma at the imaginary eigenvalues of the Hamiltonian matrix
///
/// ```text
/// [A + B R^-1 D' C, B R^-1 B'; -C' (I + D R^-1 D') C, -(A + B R^-1 D' C)'],  R = gamma^2 I - D' D
/// ```
///
/// gamma is a little above the largest known singular value. If all singular values are below gamma at the imaginary
/// parts of all eigenvalues and midway between them, gamma is an upper bound of the norm. Otherwise the largest value
/// found, raised to the local maximum near it, replaces gamma. All eigenvalues are used, imaginary or not; in a large
/// matrix, those that are clearly not imaginary are left out. A sampled system is first transformed to a continuous one
/// by z = (1 + s) / (1 - s). About 100 n^3 multiplications for the eigenvalues, a quarter of them from n = 48 on, where
/// the square of the Hamiltonian matrix is reduced (Van Loan 1984), and 4 n^2 (1 + m) for each of the 4 n frequencies
/// in a round; usually 1 or 2 rounds.
///
/// Source: N. A. Bruinsma and M. Steinbuch, A fast algorithm to compute the H-infinity norm of a
/// transfer function matrix, Systems & Control Letters 14 (1990); S. Boyd and V. Balakrishnan, 15
/// (1990).
///
/// # Example
///
/// ```
/// use control::response::h_infinity;
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// // 1 / (s^2 + 2 d s + 1) with d = 0.1: 1 / (2 d sqrt(1 - d^2)) at w^2 = 1 - 2 d^2.
/// let system = StateSpace {
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
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for `width`; [`Error::NotHurwitz`],
/// [`Error::NotSchur`]; [`Error::NotConverged`]; [`Error::Overflow`].
pub fn h_infinity(system: &StateSpace, width: f64) -> Result<HInfinity, Error> {
    norm_of(&KnownResponse::new(system.clone())?, width)
}

/// Same as [`h_infinity`], for a system whose response is known at some frequencies.
pub(crate) fn norm_of(known: &KnownResponse, width: f64) -> Result<HInfinity, Error> {
    check::positive("width", width)?;
    let width = width.max(1e-10);
    let system = &known.system;
    let continuous = continuous_equivalent(system)?;
    // At the highest frequency G is the D of the continuous equivalent.
    let lower = norm_2(&continuous.d)?;
    let frequency = original_frequency(f64::INFINITY, system.domain);
    let mut best = HInfinity { lower, upper: lower, frequency };
    for frequency in std::iter::once(0.0).chain(known.resonances()) {
        best.raise_at(known, frequency)?;
    }
    // A sampled system with real eigenvalues has no other resonances, and may be zero at both ends.
    let is_at_end = best.frequency <= 0.0 || best.frequency >= frequency;
    if system.domain != Domain::Continuous && is_at_end {
        best.raise_at(known, original_frequency(1.0, system.domain))?;
    }
    best.climb(known, width)?;
    for _ in 0..ROUNDS {
        if best.lower == 0.0 {
            return Ok(best);
        }
        best.upper = best.lower * (1.0 + width);
        for frequency in crossings(&continuous, best.upper)? {
            best.raise_at(known, original_frequency(frequency, system.domain))?;
        }
        if best.lower >= best.upper {
            best.climb(known, width)?;
            continue;
        }
        return Ok(best);
    }
    Err(Error::NotConverged { what: "the H-infinity norm", iterations: ROUNDS })
}

impl HInfinity {
    /// Raises the lower bound to the local maximum near its frequency, which saves eigenvalue problems of Hamiltonian
    /// matrices. The frequency steps grow while the value rises; otherwise they reverse and shrink.
    fn climb(&mut self, known: &KnownResponse, width: f64) -> Result<(), Error> {
        let last = original_frequency(f64::INFINITY, known.system.domain);
        if self.frequency <= 0.0 || self.frequency >= last {
            return Ok(());
        }
        let mut step = FIRST_STEP;
        while step.abs() > SMALLEST_STEP * width.sqrt() {
            let before = self.lower;
            self.raise_at(known, (self.frequency * step.exp()).min(last))?;
            step *= if self.lower > before { 1.5 } else { -0.5 };
        }
        Ok(())
    }

    /// Raises the lower bound to the value at `frequency` if that is larger.
    fn raise_at(&mut self, known: &KnownResponse, frequency: f64) -> Result<(), Error> {
        let size = singular_values(&known.gain(frequency)?)?[0];
        if size > self.lower {
            (self.lower, self.frequency) = (size, frequency);
        }
        Ok(())
    }
}

/// The continuous system whose frequency response has the same values as that of `system`, at other frequencies
/// (see [`original_frequency`]). [`Error::Overflow`] if a sampled A has the eigenvalue -1.
///
/// A sampled system is transformed by z = (1 + s) / (1 - s), with R = (A + I)^-1:
///
/// ```text
/// A_c = R (A - I),  B_c = sqrt(2) R B,  C_c = sqrt(2) C R,  D_c = D - C R B
/// ```
pub(crate) fn continuous_equivalent(system: &StateSpace) -> Result<StateSpace, Error> {
    let StateSpace { a, b, c, d, domain } = system.clone();
    if domain == Domain::Continuous {
        return Ok(StateSpace { a, b, c, d, domain });
    }
    let identity = DMatrix::identity(a.nrows(), a.nrows());
    let overflow = Error::Overflow { what: "(A + I)^-1" };
    let inverse = (&a + &identity).try_inverse().ok_or(overflow)?;
    Ok(StateSpace {
        a: &inverse * (a - identity),
        b: &inverse * &b * SQRT_2,
        d: d - &c * &inverse * b,
        c: c * inverse * SQRT_2,
        domain: Domain::Continuous,
    })
}

/// Frequencies of a continuous system that include every frequency at which a singular value of G equals `gamma`, and
/// the midpoints between neighbours.
fn crossings(system: &StateSpace, gamma: f64) -> Result<Vec<f64>, Error> {
    let (m, p) = (system.b.ncols(), system.c.nrows());
    let (b, c) = (&system.b / gamma.sqrt(), &system.c / gamma.sqrt());
    let d = &system.d / gamma;
    let overflow = Error::Overflow { what: "(gamma^2 I - D' D)^-1" };
    let r = DMatrix::identity(m, m) - d.tr_mul(&d);
    let inverse = r.try_inverse().ok_or(overflow)?;
    let a = &system.a + &b * &inverse * d.tr_mul(&c);
    let weight = DMatrix::identity(p, p) + &d * &inverse * d.transpose();
    let (g, q) = (&b * inverse * b.transpose(), -(c.tr_mul(&weight) * &c));
    let hamiltonian = block_2x2([&a, &g], [&q, &-a.transpose()]);
    let hamiltonian = check::in_range("the Hamiltonian matrix", hamiltonian)?;
    let mut frequencies = if hamiltonian.nrows() < LARGE {
        eigenvalues(&hamiltonian)?.iter().map(|x| x.im.abs()).collect()
    } else {
        let reduced = Hamiltonian::balanced(&a, &g, &q);
        let rounding = ROUNDING * reduced.norm();
        let possible = |x: &&Complex<f64>| x.re.abs() <= rounding.max(IMAGINARY * x.norm());
        let all = reduced.eigenvalues().map_or_else(|| eigenvalues(&hamiltonian), Ok)?;
        all.iter().filter(possible).map(|x| x.im.abs()).collect::<Vec<_>>()
    };
    frequencies.push(0.0);
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup();
    let midpoints: Vec<f64> =
        frequencies.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    frequencies.extend(midpoints);
    Ok(frequencies)
}

/// The frequency of a system at which its [`continuous_equivalent`] has the given frequency.
pub(crate) fn original_frequency(frequency: f64, domain: Domain) -> f64 {
    match domain {
        Domain::Continuous => frequency,
        Domain::Sampled { period } => 2.0 * frequency.atan() / period,
    }
}
