//! The frequency response.

use crate::balance::{Balance, divide_rows, multiply_columns};
use crate::blocks::to_complex;
use crate::eigen::eigenvalues;
use crate::svd::ComplexSvd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;

/// The response at one frequency.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FrequencyPoint {
    /// w in rad per unit of time.
    pub frequency: f64,
    /// G = C (s I - A)^-1 B + D, p x m, s = j w; in sampled time z = e^(j w h) takes the place of
    /// s.
    pub gain: DMatrix<Complex<f64>>,
    /// The singular values of G, descending, the smaller of p and m of them.
    pub singular_values: Vec<f64>,
}

/// Computes G at the given frequencies.
///
/// `frequencies`: in rad per unit of time, not negative. G exists unless j w is an eigenvalue of A;
/// the system need not be stable. Method: balancing, one complex LU decomposition for each
/// frequency, one-sided Jacobi rotations for the singular values; about 4 n^3 multiplications each.
/// Error: about 1e-16 times the condition number of s I - A in balanced coordinates.
///
/// # Example
///
/// ```
/// use control::Domain;
/// use control::StateSpace;
/// use control::response::{frequency_response};
/// use nalgebra::DMatrix;
/// let one = DMatrix::identity(1, 1);
/// let (a, d) = (-&one, DMatrix::zeros(1, 1));
/// let lag = StateSpace { a, b: one.clone(), c: one, d, domain: Domain::Continuous };
/// let points = frequency_response(&lag, &[1.0])?;
/// assert!((points[0].singular_values[0] - 0.5_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for a frequency that is negative or not
/// finite; [`Error::Overflow`] at an eigenvalue; [`Error::NotConverged`].
pub fn frequency_response(
    system: &StateSpace,
    frequencies: &[f64],
) -> Result<Vec<FrequencyPoint>, Error> {
    system.check()?;
    let transfer = Transfer::new(system);
    frequencies.iter().map(|&frequency| transfer.point(frequency)).collect()
}

/// Frequencies for a figure: `per_decade` points in each decade, evenly on the logarithmic scale.
///
/// From a tenth of the slowest eigenvalue of A (those at the origin left out) to ten times the
/// fastest; in sampled time to the Nyquist frequency pi / h.
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for `per_decade` of zero;
/// [`Error::NotConverged`].
pub fn frequency_grid(system: &StateSpace, per_decade: u32) -> Result<Vec<f64>, Error> {
    system.check()?;
    check::positive("per_decade", f64::from(per_decade))?;
    let values = eigenvalues(&system.a)?;
    let sizes = values.iter().map(|value| match system.domain {
        Domain::Continuous => value.norm(),
        Domain::Sampled { period } => value.ln().norm() / period,
    });
    let floor = f64::EPSILON * system.a.norm();
    let sizes: Vec<f64> = sizes.filter(|size| size.is_finite() && *size > floor).collect();
    let slowest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let fastest = sizes.iter().copied().fold(0.0, f64::max);
    let (mut from, mut to) = (0.1 * slowest, 10.0 * fastest);
    if sizes.is_empty() {
        (from, to) = (0.1, 10.0);
    }
    if let Domain::Sampled { period } = system.domain {
        to = PI / period;
        from = from.min(0.01 * to);
    }
    let count = (f64::from(per_decade) * (to / from).log10()).ceil().max(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "above zero")]
    let steps = count as u32;
    let point = |k: u32| from * (to / from).powf(f64::from(k) / count);
    Ok((0..=steps).map(|k| point(k).min(to)).collect())
}

/// A system in balanced coordinates.
pub(crate) struct Transfer<'a> {
    a: DMatrix<f64>,
    b: DMatrix<Complex<f64>>,
    c: DMatrix<Complex<f64>>,
    d: &'a DMatrix<f64>,
    domain: Domain,
}

impl<'a> Transfer<'a> {
    pub(crate) fn new(system: &'a StateSpace) -> Self {
        let Balance { matrix, scale } = Balance::new(&system.a);
        let b = to_complex(&divide_rows(&system.b, &scale));
        let c = to_complex(&multiply_columns(&system.c, &scale));
        Self { a: matrix, b, c, d: &system.d, domain: system.domain }
    }

    pub(super) fn point(&self, frequency: f64) -> Result<FrequencyPoint, Error> {
        let gain = self.gain(frequency)?;
        let tall = if gain.nrows() < gain.ncols() { gain.transpose() } else { gain.clone() };
        let singular_values = ComplexSvd::new(&tall)?.values();
        Ok(FrequencyPoint { frequency, gain, singular_values })
    }

    /// G at one frequency.
    pub(crate) fn gain(&self, frequency: f64) -> Result<DMatrix<Complex<f64>>, Error> {
        if !(frequency.is_finite() && frequency >= 0.0) {
            let rule = "a finite number, not negative";
            return Err(Error::OutOfRange { name: "frequency", value: frequency, rule });
        }
        let s = match self.domain {
            Domain::Continuous => Complex::new(0.0, frequency),
            Domain::Sampled { period } => Complex::from_polar(1.0, frequency * period),
        };
        let overflow = Error::Overflow { what: "the frequency response" };
        let n = self.a.nrows();
        let resolvent = DMatrix::from_diagonal_element(n, n, s) - to_complex(&self.a);
        let states = resolvent.lu().solve(&self.b).ok_or(overflow.clone())?;
        let gain = &self.c * states + to_complex(self.d);
        if gain.iter().any(|entry| !(entry.re.is_finite() && entry.im.is_finite())) {
            return Err(overflow);
        }
        Ok(gain)
    }

    /// The largest singular value.
    pub(super) fn size(&self, frequency: f64) -> Result<f64, Error> {
        Ok(self.point(frequency)?.singular_values[0])
    }
}
