//! Weights over frequency: constants, stable transfer functions of order 1 and 2 without zeros in the right half plane.

use crate::blocks::block_diagonal;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix};
use std::iter::successors;

/// A weight W of order 0, 1 or 2.
///
/// ```text
/// W(s) = (b_r p^r + ... + b_0) / (p^r + ... + a_0),  p = s / unit,  all coefficients above zero
/// ```
///
/// In sampled time s = 2 (z - 1) / (T (z + 1)): the frequency w of a sampled signal corresponds to s = (2 j / T) tan(w
/// T / 2), see [`bilinear_frequency`]. A weight for mapped frequencies has the stated magnitudes in sampled time.
#[derive(Debug, Clone, PartialEq)]
pub struct Weight {
    /// Coefficients `b_r` to `b_0` of the numerator.
    numerator: Vec<f64>,
    /// Coefficients of the denominator, from 1 to `a_0`.
    denominator: Vec<f64>,
    /// The unit of s, in rad/s.
    unit: f64,
}

impl Weight {
    /// A weight with the same magnitude, above zero, at every frequency. The sign is not checked.
    #[must_use]
    pub fn constant(magnitude: f64) -> Self {
        Self { numerator: vec![magnitude], denominator: vec![1.0], unit: 1.0 }
    }

    /// A weight from its coefficients in p, the highest power first; the first of `denominator` is 1.
    #[cfg_attr(not(feature = "lmi"), expect(dead_code, reason = "used by the fit to a table"))]
    pub(crate) fn from_coefficients(numerator: Vec<f64>, denominator: Vec<f64>, unit: f64) -> Self {
        Self { numerator, denominator, unit }
    }

    /// A weight that changes from the magnitude `low` at low frequencies to `high` at high ones.
    ///
    /// ```text
    /// order 1: W(s) = (high s + w sqrt(low high)) / (s + w sqrt(high / low)),  w = frequency
    /// order 2: the square of the W of order 1 for sqrt(low), sqrt(high)
    /// ```
    ///
    /// `frequency`, in rad/s: where the magnitude is sqrt(low high); sampled: its [`bilinear_frequency`].
    ///
    /// # Example
    ///
    /// ```
    /// use control::weight::Weight;
    /// let weight = Weight::lead_lag(0.1, 5.0, 10.0, 2)?;
    /// assert!((weight.magnitude(5.0) - 1.0).abs() < 1e-12);
    /// assert!((weight.magnitude(0.0) - 0.1).abs() < 1e-12);
    /// # Ok::<(), control::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a number that is not above zero, or an order other than 1 and 2.
    pub fn lead_lag(low: f64, frequency: f64, high: f64, order: usize) -> Result<Self, Error> {
        for (name, value) in [("low", low), ("frequency", frequency), ("high", high)] {
            check::positive(name, value)?;
        }
        // Roots first: products and quotients of the numbers may leave the range of double precision.
        let first = |low: f64, high: f64| {
            [[high, low.sqrt() * high.sqrt()], [1.0, high.sqrt() / low.sqrt()]]
        };
        let [numerator, denominator] = match order {
            1 => first(low, high).map(Vec::from),
            2 => first(low.sqrt(), high.sqrt()).map(|[b, c]| vec![b * b, 2.0 * b * c, c * c]),
            _ => {
                let value = f64::from(u32::try_from(order).unwrap_or(u32::MAX));
                return Err(Error::OutOfRange { name: "order", value, rule: "1 or 2" });
            }
        };
        Ok(Self { numerator, denominator, unit: frequency })
    }

    /// The magnitude of a constant weight; None for other weights.
    #[must_use]
    pub fn as_constant(&self) -> Option<f64> {
        (self.denominator.len() == 1).then(|| self.numerator[0])
    }

    /// |W(j w)|, `frequency`: w in rad/s; in sampled time the [`bilinear_frequency`] of the signal's frequency.
    #[must_use]
    pub fn magnitude(&self, frequency: f64) -> f64 {
        if frequency.is_infinite() {
            return self.numerator[0];
        }
        let p = Complex::new(0.0, frequency / self.unit);
        let value = |coefficients: &[f64]| {
            coefficients.iter().fold(Complex::new(0.0, 0.0), |sum, b| sum * p + b)
        };
        value(&self.numerator).norm() / value(&self.denominator).norm()
    }

    /// The weight as a system with one input and one output, in sampled time by the bilinear
    /// transformation. A constant weight has no states.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a bad period.
    pub fn system(&self, domain: Domain) -> Result<StateSpace, Error> {
        domain.check()?;
        let order = self.denominator.len() - 1;
        let direct = self.numerator[0];
        let (numerator, denominator) = (&self.numerator[1..], &self.denominator[1..]);
        let a = DMatrix::from_fn(order, order, |i, j| match i {
            0 => -denominator[j],
            _ => f64::from(u8::from(i == j + 1)),
        });
        let c = DMatrix::from_fn(1, order, |_, j| numerator[j] - direct * denominator[j]);
        let d = DMatrix::from_element(1, 1, direct);
        let (a, b) = (a * self.unit, DMatrix::identity(order, 1) * self.unit);
        let Domain::Sampled { period } = domain else {
            return Ok(StateSpace { a, b, c, d, domain });
        };
        let one = DMatrix::identity(order, order);
        let half = 0.5 * period;
        // The poles of W are stable, so I - A T / 2 is regular.
        let inverse = (&one - &a * half).try_inverse().unwrap_or(one.clone());
        Ok(StateSpace {
            a: &inverse * (&one + &a * half),
            b: &inverse * &b * period,
            c: &c * &inverse,
            d: d + &c * &inverse * &b * half,
            domain,
        })
    }

    /// Numerator and monic denominator in s, in sampled time in z, the highest power first.
    #[must_use]
    pub fn polynomials(&self, domain: Domain) -> (Vec<f64>, Vec<f64>) {
        let convert = |coefficients: &[f64]| match domain {
            Domain::Continuous => {
                let powers = successors(Some(1.0), |power| Some(power * self.unit));
                coefficients.iter().zip(powers).map(|(one, power)| one * power).collect()
            }
            Domain::Sampled { period } => powers_of_z(coefficients, 2.0 / (period * self.unit)),
        };
        let (numerator, denominator) = (convert(&self.numerator), convert(&self.denominator));
        let first = denominator[0];
        let monic = |all: Vec<f64>| all.into_iter().map(|one| one / first).collect();
        (monic(numerator), monic(denominator))
    }
}

/// The system whose output i is input i, filtered by weight i.
///
/// # Errors
///
/// Same as [`Weight::system`].
pub fn diagonal(weights: &[Weight], domain: Domain) -> Result<StateSpace, Error> {
    let systems = weights.iter().map(|one| one.system(domain)).collect::<Result<Vec<_>, _>>()?;
    let part = |of: fn(&StateSpace) -> &DMatrix<f64>| block_diagonal(systems.iter().map(of));
    Ok(StateSpace {
        a: part(|one| &one.a),
        b: part(|one| &one.b),
        c: part(|one| &one.c),
        d: part(|one| &one.d),
        domain,
    })
}

/// The coefficients in z of a polynomial in p = `rate` (z - 1) / (z + 1), times (z + 1)^order.
fn powers_of_z(coefficients: &[f64], rate: f64) -> Vec<f64> {
    match *coefficients {
        [b, c] => vec![b * rate + c, c - b * rate],
        [b, c, d] => {
            let square = b * rate * rate;
            vec![square + c * rate + d, 2.0 * (d - square), square - c * rate + d]
        }
        _ => coefficients.to_vec(),
    }
}

/// The frequency of s for the frequency `frequency` of a signal, both in rad/s: the same in continuous
/// time, (2 / T) tan(w T / 2) in sampled time, infinite from pi / T on.
///
/// Source: the bilinear transformation of Tustin, see K. J. Astrom and B. Wittenmark,
/// Computer-controlled systems (1997), section 8.2.
#[must_use]
pub fn bilinear_frequency(frequency: f64, domain: Domain) -> f64 {
    match domain {
        Domain::Continuous => frequency,
        Domain::Sampled { period } if frequency * period < std::f64::consts::PI => {
            2.0 / period * (0.5 * frequency * period).tan()
        }
        Domain::Sampled { .. } => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::response::frequency_response;
    use std::f64::consts::PI;

    #[test]
    fn systems_have_the_stated_magnitudes_in_continuous_and_in_sampled_time() {
        for order in [1, 2] {
            for domain in [Domain::Continuous, Domain::Sampled { period: 0.2 }] {
                let map = |frequency| bilinear_frequency(frequency, domain);
                let weight = Weight::lead_lag(20.0, map(3.0), 0.2, order).unwrap();
                let system = weight.system(domain).unwrap();
                for frequency in [0.01, 3.0, 11.0] {
                    let magnitude =
                        frequency_response(&system, &[frequency]).unwrap()[0].gain[(0, 0)].norm();
                    let expected = weight.magnitude(map(frequency));
                    assert!((magnitude / expected - 1.0).abs() < 1e-9, "{order} {domain:?}");
                }
                assert!((weight.magnitude(map(3.0)) - 2.0).abs() < 1e-9);
                assert!((weight.magnitude(0.0) - 20.0).abs() < 1e-9);
                let (numerator, denominator) = weight.polynomials(domain);
                let point = match domain {
                    Domain::Continuous => Complex::new(0.0, 3.0),
                    Domain::Sampled { period } => Complex::from_polar(1.0, 3.0 * period),
                };
                let at = |all: &[f64]| {
                    all.iter().fold(Complex::new(0.0, 0.0), |sum, one| sum * point + one)
                };
                assert!(((at(&numerator) / at(&denominator)).norm() - 2.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn the_magnitude_at_half_of_the_sampling_rate_is_that_of_high_frequencies() {
        let frequency = bilinear_frequency(PI / 0.2, Domain::Sampled { period: 0.2 });
        for order in [1, 2] {
            let magnitude = Weight::lead_lag(0.1, 5.0, 10.0, order).unwrap().magnitude(frequency);
            assert!((magnitude - 10.0).abs() < 1e-13, "{order}: {magnitude}");
        }
        assert!((Weight::constant(3.0).magnitude(frequency) - 3.0).abs() < 1e-15);
    }

    #[test]
    fn weights_of_very_large_and_small_numbers_have_the_stated_magnitudes() {
        for [low, mean, high] in [[1e200, 1e190, 1e180], [1e-200, 1.0, 1e200]] {
            for order in [1, 2] {
                let weight = Weight::lead_lag(low, 1.0, high, order).unwrap();
                for (frequency, expected) in [(0.0, low), (1.0, mean)] {
                    let magnitude = weight.magnitude(frequency);
                    assert!((magnitude / expected - 1.0).abs() < 1e-9, "{order}: {magnitude:e}");
                }
            }
        }
    }

    #[test]
    fn numbers_that_are_not_above_zero_and_other_orders_are_refused() {
        assert!(Weight::lead_lag(0.0, 1.0, 1.0, 1).is_err());
        assert!(Weight::lead_lag(1.0, 1.0, 2.0, 3).is_err());
    }
}
