//! The chi-square distribution, central and noncentral, for a whole number of degrees of freedom.

/// The series of the noncentral distribution ends at a weight below this fraction of the sum; a weight multiplies a
/// probability, which is at most 1.
const NEGLIGIBLE: f64 = 1e-17;
const MOST_TERMS: u32 = 1_000_000;
/// The largest noncentrality for which the series is summed; above, a normal approximation is used.
const LARGEST: f64 = 1e6;
/// In double precision, a noncentral chi-square variable is above a point this many standard deviations below its mean
/// with probability 1.
const FAR: f64 = 40.0;

/// The probability that a chi-square variable with `degrees` degrees of freedom is above `x`.
///
/// ```text
/// Q(x) = e^(-x/2) sum (x/2)^j / j!, 0 <= j < k/2                                          k even
/// Q(x) = erfc((x/2)^(1/2)) + e^(-x/2) sum (x/2)^(j-1/2) / Gamma(j+1/2), 1 <= j <= (k-1)/2     k odd
/// ```
///
/// k = `degrees`. All terms are positive: full relative precision, also for large x. Q is 1 for x <= 0, and 0 for x > 0
/// and k = 0.
///
/// Source: M. Abramowitz and I. Stegun, Handbook of Mathematical Functions (1964), 26.4.4, 26.4.5.
///
/// # Example
///
/// ```
/// let above = control::detection::chi_square::survival(2, 4.0);
/// assert!((above - (-2.0_f64).exp()).abs() < 1e-16);
/// ```
#[must_use]
pub fn survival(degrees: u32, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    Terms::new(degrees, 0.5 * x).survival
}

/// The probability that a noncentral chi-square variable is above `x`. The variable is the squared length of a
/// normal vector with `degrees` entries, unit covariance and a mean of squared length `noncentrality`.
///
/// A `noncentrality` below 0 counts as 0; the result is 1 for x <= 0. Method: the Poisson mixture of the central
/// probabilities of k, k + 2, ... degrees of freedom, about `noncentrality` terms; above a noncentrality of 1e6 the
/// vector's length counts as normally distributed.
///
/// Source: Abramowitz and Stegun (1964), 26.4.25.
#[must_use]
pub fn noncentral_survival(degrees: u32, noncentrality: f64, x: f64) -> f64 {
    if noncentrality <= 0.0 {
        return survival(degrees, x);
    }
    if x <= 0.0 {
        return 1.0;
    }
    let mean = f64::from(degrees) + noncentrality;
    let deviation = (2.0 * (mean + noncentrality)).sqrt();
    if x < mean - FAR * deviation {
        return 1.0;
    }
    if noncentrality > LARGEST {
        return normal_below((mean - 1.0).sqrt() - x.sqrt());
    }
    let rate = 0.5 * noncentrality;
    let mut terms = Terms::new(degrees, 0.5 * x);
    let mut sum = 0.0;
    for j in 0..MOST_TERMS {
        let count = f64::from(j);
        let weight = (count * rate.ln() - rate - libm::lgamma(count + 1.0)).exp();
        sum += weight * terms.survival;
        if count > rate && weight <= NEGLIGIBLE * sum {
            break;
        }
        terms.raise();
    }
    sum.min(1.0)
}

/// The x that a chi-square variable with `degrees` degrees of freedom exceeds with the probability `probability`.
///
/// `probability`: in 0 to 1, both excluded. Method: bisection of [`survival`] to the resolution of double
/// precision. NaN for a probability outside of its range, and for no degrees of freedom.
#[must_use]
pub fn quantile(degrees: u32, probability: f64) -> f64 {
    noncentral_quantile(degrees, 0.0, probability)
}

/// Same as [`quantile`] for [`noncentral_survival`].
#[must_use]
pub fn noncentral_quantile(degrees: u32, noncentrality: f64, probability: f64) -> f64 {
    if !(probability > 0.0 && probability < 1.0) || degrees == 0 {
        return f64::NAN;
    }
    let above = |x: f64| noncentral_survival(degrees, noncentrality, x) > probability;
    let (mut low, mut high) = (0.0, 1.0);
    while above(high) {
        (low, high) = (high, 2.0 * high);
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        *(if above(middle) { &mut low } else { &mut high }) = middle;
    }
}

/// The probability that a standard normal variable is below `x`.
pub(super) fn normal_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

pub(super) fn normal_density(x: f64) -> f64 {
    (-0.5 * x * x).exp() * 0.5 * std::f64::consts::FRAC_2_SQRT_PI * std::f64::consts::FRAC_1_SQRT_2
}

/// The probability that a chi-square variable is above x, updated as its degrees of freedom grow by two.
struct Terms {
    /// Half of the x at which the probability is computed, above 0.
    half: f64,
    /// The probability that a variable with the present degrees of freedom is above x.
    survival: f64,
    /// Half of the present degrees of freedom.
    shape: f64,
}

impl Terms {
    /// The probability for `degrees` degrees of freedom, computed from 0 degrees up, or from 1 if odd.
    fn new(degrees: u32, half: f64) -> Self {
        let mut terms = match degrees % 2 {
            0 => Self { half, survival: 0.0, shape: 0.0 },
            _ => Self { half, survival: libm::erfc(half.sqrt()), shape: 0.5 },
        };
        (0..degrees / 2).for_each(|_| terms.raise());
        terms
    }

    /// Adds two degrees of freedom: Q grows by h^a e^(-h) / Gamma(a + 1), h = x / 2, a = half of the previous degrees.
    fn raise(&mut self) {
        let exponent = self.shape * self.half.ln() - self.half - libm::lgamma(self.shape + 1.0);
        self.survival += exponent.exp();
        self.shape += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_of_the_survival_is_the_value() {
        for degrees in [1, 2, 3, 8, 41] {
            for x in [0.2, 3.0, 50.0, 300.0] {
                let p = survival(degrees, x);
                if p < 0.999_999 {
                    assert!((quantile(degrees, p) / x - 1.0).abs() < 1e-10, "{degrees} {x}");
                }
            }
        }
    }

    #[test]
    fn a_shifted_normal_variable_is_noncentral_with_one_degree() {
        let near = [(0.3, 1.0), (2.0, 9.0), (40.0, 1500.0), (200.0, 39_000.0)];
        for (mean, x) in near.into_iter().chain([(10.0, 900.0)]) {
            let root = f64::sqrt(x);
            let expected = normal_below(mean - root) + normal_below(-mean - root);
            let above = noncentral_survival(1, mean * mean, x);
            assert!((above / expected - 1.0).abs() < 1e-11, "{mean} {x}: {above} {expected}");
        }
    }

    #[test]
    fn a_very_large_noncentrality_has_no_series() {
        for shift in [-3.0, 0.0, 3.0] {
            let above = noncentral_survival(1, 4e6, f64::powi(2000.0 + shift, 2));
            assert!((above / normal_below(-shift) - 1.0).abs() < 1e-9, "{shift} {above}");
        }
    }

    #[test]
    fn a_variable_is_above_what_is_far_below_its_mean() {
        assert!((noncentral_survival(3, 1e9, 20.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn nothing_is_found_for_a_probability_out_of_range() {
        assert!(
            quantile(3, 0.0).is_nan() && quantile(3, 1.0).is_nan() && quantile(0, 0.5).is_nan()
        );
    }
}
