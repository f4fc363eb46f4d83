//! The number types of the plant's equations.
//!
//! Power, sine and exponential are functions of the crate `libm`, which have the same bits on every
//! platform; the functions of the standard library differ between platforms.

use num_dual::{Dual64, DualNum};

/// `f64`, or a dual number `x + x' e` with `e² = 0`, which carries the derivative `x'` in a
/// direction through the same equations (forward differentiation).
pub(crate) trait Number: DualNum<Primitive = f64> + Copy {
    /// The absolute value; at zero its derivative is the one from the right.
    fn absolute(self) -> Self;

    /// `self^exponent` of a number `self >= 0` and an exponent above zero.
    ///
    /// The derivative at zero is the one from the right: infinite for exponents below one, unless
    /// the number does not change in the direction.
    fn power(self, exponent: Self) -> Self;
}

impl Number for f64 {
    #[inline]
    fn absolute(self) -> Self {
        self.abs()
    }

    #[inline]
    fn power(self, exponent: Self) -> Self {
        if (exponent - 2.0).abs() < Self::EPSILON { self * self } else { libm::pow(self, exponent) }
    }
}

impl Number for Dual64 {
    fn absolute(self) -> Self {
        if self.re < 0.0 { -self } else { self }
    }

    fn power(self, exponent: Self) -> Self {
        let value = self.re.power(exponent.re);
        let part = |change: f64, factor: f64| if change == 0.0 { 0.0 } else { change * factor };
        let by_base = part(self.eps, exponent.re * libm::pow(self.re, exponent.re - 1.0));
        // x^d ln x tends to zero with x.
        let logarithm = if value == 0.0 { 0.0 } else { libm::log(self.re) };
        Self::new(value, by_base + part(exponent.eps, value * logarithm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_has_the_bits_of_the_power_of_plain_numbers() {
        for exponent in [0.5, 1.0, 1.3, 2.0, 3.0] {
            for base in [0.0, 1e-7, 0.3, 2.5] {
                let dual = Dual64::new(base, 0.7).power(Dual64::new(exponent, -0.2));
                assert_eq!(dual.re.to_bits(), base.power(exponent).to_bits());
            }
        }
    }

    #[test]
    fn the_derivative_is_the_difference_quotient_in_both_arguments() {
        for exponent in [0.5, 1.0, 1.3, 2.0, 3.0_f64] {
            for base in [0.3, 2.5_f64] {
                for (by_base, by_exponent) in [(1.0, 0.0), (0.0, 1.0), (0.7, -0.2)] {
                    let dual = Dual64::new(base, by_base).power(Dual64::new(exponent, by_exponent));
                    let at = |h: f64| (base + h * by_base).powf(exponent + h * by_exponent);
                    let quotient = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!((dual.eps - quotient).abs() < 1e-8, "{} {quotient}", dual.eps);
                }
            }
        }
    }

    #[test]
    fn at_zero_the_derivative_is_the_one_from_the_right() {
        let slope = |exponent: f64| Dual64::new(0.0, 1.0).power(Dual64::new(exponent, 5.0)).eps;
        let actual = [0.5, 1.0, 1.5, 2.0].map(|exponent| slope(exponent).to_bits());
        assert_eq!(actual, [f64::INFINITY, 1.0, 0.0, 0.0].map(f64::to_bits));
        assert_eq!(Dual64::new(0.0, 0.0).power(Dual64::new(0.5, 5.0)).eps.to_bits(), 0);
    }
}
