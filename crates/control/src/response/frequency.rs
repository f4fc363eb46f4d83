//! The frequency response.

use crate::balance::Balance;
use crate::blocks::to_complex;
use crate::eigen::eigenvalues;
use crate::svd::ComplexSvd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;
use std::ops::Range;

/// The response at one frequency.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FrequencyPoint {
    /// w in rad per unit of time.
    pub frequency: f64,
    /// G = C (s I - A)^-1 B + D, p x m, s = j w; in sampled time with the period h, s is replaced by
    /// z = e^(j w h).
    pub gain: DMatrix<Complex<f64>>,
    /// The min(p, m) singular values of G, descending.
    pub singular_values: Vec<f64>,
}

/// Computes G at the given frequencies.
///
/// `frequencies`: in rad per unit of time, not negative. G exists unless j w is an eigenvalue of A;
/// the system need not be stable. Method: balancing and Hessenberg form of A, about 8 n^3
/// multiplications; for each frequency an elimination with 4 n^2 (1 + m) and one-sided Jacobi
/// rotations for the singular values.
/// Error: about 1e-16 times the condition number of s I - A in balanced coordinates.
///
/// # Example
///
/// ```
/// use control::response::frequency_response;
/// use control::{Domain, StateSpace};
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
    let point = |&frequency: &f64| {
        let gain = transfer.gain(frequency)?;
        Ok(FrequencyPoint { frequency, singular_values: singular_values(&gain)?, gain })
    };
    frequencies.iter().map(point).collect()
}

/// The singular values of a complex matrix, descending, as many as the smaller one of its dimensions.
pub(crate) fn singular_values(gain: &DMatrix<Complex<f64>>) -> Result<Vec<f64>, Error> {
    let is_wide = gain.nrows() < gain.ncols();
    let svd = if is_wide { ComplexSvd::new(&gain.transpose()) } else { ComplexSvd::new(gain) };
    Ok(svd?.values())
}

/// Frequencies for a figure, ascending, evenly on the logarithmic scale: at least `per_decade` per decade.
///
/// They range from a tenth of the slowest eigenvalue of A to ten times the fastest, eigenvalues at the origin
/// left out; without any other eigenvalue from 0.1 to 10. In sampled time they end at the Nyquist frequency
/// pi / h and start at a hundredth of it or below.
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for a `per_decade` of 0;
/// [`Error::NotConverged`].
pub fn frequency_grid(system: &StateSpace, per_decade: u32) -> Result<Vec<f64>, Error> {
    system.check()?;
    check::positive("per_decade", f64::from(per_decade))?;
    Ok(grid(system, &eigenvalues(&system.a)?, per_decade))
}

/// [`frequency_grid`] of a system whose eigenvalues are known.
pub(crate) fn grid(system: &StateSpace, values: &[Complex<f64>], per_decade: u32) -> Vec<f64> {
    let sizes = values.iter().map(|value| match system.domain {
        Domain::Continuous => value.norm(),
        Domain::Sampled { period } => value.ln().norm() / period,
    });
    // An eigenvalue at the origin has a rounding error of the size of the balanced A.
    let floor = f64::EPSILON * Balance::new(&system.a).matrix.norm() / system.domain.step();
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
    (0..=steps).map(|k| point(k).min(to)).collect()
}

/// A system with A balanced and in Hessenberg form, so that a frequency needs n^2 multiplications only.
///
/// Source: A. J. Laub, Efficient multivariable frequency response computations, IEEE Trans. Autom.
/// Control 26 (1981).
#[derive(Clone)]
pub(crate) struct Transfer {
    /// The transpose of A.
    transposed: DMatrix<f64>,
    b: DMatrix<Complex<f64>>,
    pub(super) c: DMatrix<Complex<f64>>,
    pub(super) d: DMatrix<f64>,
    domain: Domain,
}

impl Transfer {
    pub(crate) fn new(system: &StateSpace) -> Self {
        let StateSpace { a, b, c, d, domain } = system.balanced();
        let (q, h) = a.hessenberg().unpack();
        let (b, c) = (to_complex(&q.tr_mul(&b)), to_complex(&(c * q)));
        Self { transposed: h.transpose(), b, c, d, domain }
    }

    /// The transfer function from input `channel` to output `channel`.
    pub(super) fn channel(&self, channel: usize) -> Self {
        Self {
            transposed: self.transposed.clone(),
            b: self.b.columns(channel, 1).into(),
            c: self.c.rows(channel, 1).into(),
            d: self.d.view((channel, channel), (1, 1)).into(),
            domain: self.domain,
        }
    }

    /// The frequency response G at one frequency.
    pub(crate) fn gain(&self, frequency: f64) -> Result<DMatrix<Complex<f64>>, Error> {
        self.with_direct(self.without_direct(frequency)?)
    }

    /// C (s I - A)^-1 B at one frequency; not finite if s is an eigenvalue.
    pub(super) fn without_direct(&self, frequency: f64) -> Result<DMatrix<Complex<f64>>, Error> {
        let holds = frequency.is_finite() && frequency >= 0.0;
        check::that(holds, "frequency", frequency, "a finite number, not negative")?;
        Ok(&self.c * self.states(self.domain.point(frequency)))
    }

    /// Adds the direct term: G from C (s I - A)^-1 B.
    pub(super) fn with_direct(
        &self,
        response: DMatrix<Complex<f64>>,
    ) -> Result<DMatrix<Complex<f64>>, Error> {
        let gain = response + to_complex(&self.d);
        let is_finite = gain.iter().all(|entry| entry.is_finite());
        is_finite.then_some(gain).ok_or(Error::Overflow { what: "the frequency response" })
    }

    /// (s I - A)^-1 B by elimination, exchanging adjacent rows; not finite if s is an eigenvalue.
    fn states(&self, s: Complex<f64>) -> DMatrix<Complex<f64>> {
        let n = self.transposed.nrows();
        // Column k is row k of s I - A.
        let mut rows = Parts { re: -&self.transposed, im: DMatrix::zeros(n, n) };
        for k in 0..n {
            rows.re[(k, k)] += s.re;
            rows.im[(k, k)] = s.im;
        }
        // All inputs of a state are neighbours, so that their sums are formed at the same time.
        let inputs = self.b.transpose();
        let mut states = Parts { re: inputs.map(|x| x.re), im: inputs.map(|x| x.im) };
        for k in 1..n {
            if rows.at(k - 1, k).norm_sqr() > rows.at(k - 1, k - 1).norm_sqr() {
                rows.exchange(k - 1, k);
                states.exchange(k - 1, k);
            }
            let factor = rows.at(k - 1, k) / rows.at(k - 1, k - 1);
            rows.subtract(k, factor, k - 1, k..n);
            states.subtract(k, factor, k - 1, 0..self.b.ncols());
        }
        for k in (0..n).rev() {
            for other in k + 1..n {
                states.subtract(k, rows.at(other, k), other, 0..self.b.ncols());
            }
            states.divide(k, rows.at(k, k));
        }
        states.re.zip_map(&states.im, Complex::new).transpose()
    }
}

/// A complex matrix as two real ones, on whose columns the compiler uses vector instructions.
struct Parts {
    re: DMatrix<f64>,
    im: DMatrix<f64>,
}

impl Parts {
    fn at(&self, row: usize, column: usize) -> Complex<f64> {
        Complex::new(self.re[(row, column)], self.im[(row, column)])
    }

    fn exchange(&mut self, one: usize, other: usize) {
        self.re.swap_columns(one, other);
        self.im.swap_columns(one, other);
    }

    /// Subtracts `factor` times column `source` from column `target` in the rows `rows`.
    fn subtract(&mut self, target: usize, factor: Complex<f64>, source: usize, rows: Range<usize>) {
        let Complex { re, im } = factor;
        let (mut to_re, from_re) = self.re.columns_range_pair_mut(target, source);
        let (mut to_im, from_im) = self.im.columns_range_pair_mut(target, source);
        let to = to_re.as_mut_slice()[rows.clone()]
            .iter_mut()
            .zip(&mut to_im.as_mut_slice()[rows.clone()]);
        let from = from_re.as_slice()[rows.clone()].iter().zip(&from_im.as_slice()[rows]);
        for ((x, y), (u, v)) in to.zip(from) {
            *x -= re * u - im * v;
            *y -= re * v + im * u;
        }
    }

    fn divide(&mut self, column: usize, divisor: Complex<f64>) {
        for row in 0..self.re.nrows() {
            let quotient = self.at(row, column) / divisor;
            (self.re[(row, column)], self.im[(row, column)]) = (quotient.re, quotient.im);
        }
    }
}
