//! The chi-square test of the mean of residuals over a window.

use super::Delay;
use super::chi_square::{noncentral_quantile, noncentral_survival};
use crate::check::as_number;
use crate::{Error, check};

/// The largest number of starts of the fault within a window over which a delay is averaged.
const PHASES: usize = 32;

/// The chi-square test of the mean of m white residuals r with covariance I, over successive windows of N samples.
///
/// ```text
/// s = N |mean of r over the window|^2,  alarm at the end of the window: s > h
/// ```
///
/// Without faults s has the chi-square distribution with m degrees of freedom. s is twice the logarithm of the
/// generalised likelihood ratio for a constant mean of unknown direction and size. Windows do not overlap, so that
/// their results are independent and the mean number of samples between false alarms is N / P(s > h).
///
/// Source: A. S. Willsky, Automatica 12 (1976), section 4.1; M. Basseville and I. V. Nikiforov, Detection of
/// Abrupt Changes (1993), section 4.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowTest {
    /// m, the number of residuals in the mean.
    pub residuals: u32,
    /// N, the number of samples of a window.
    pub window: usize,
    /// The threshold h of the statistic.
    pub threshold: f64,
}

impl WindowTest {
    /// The test whose mean number of samples between false alarms is `samples`, while the mean of the
    /// residuals without faults has at most the length `bias` (0 for a plant without model error).
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for an empty window, no residuals, a bias that is not finite, or a number of
    /// samples that is not larger than the window.
    pub fn with_false_alarms(
        residuals: u32,
        window: usize,
        samples: f64,
        bias: f64,
    ) -> Result<Self, Error> {
        let length = as_number(window);
        let name = "the number of residuals or of samples";
        check::that(residuals > 0 && window > 0, name, 0.0, "at least 1")?;
        let is_bound = bias >= 0.0 && bias.is_finite();
        check::that(is_bound, "the mean of the residuals", bias, "a finite number from 0")?;
        let threshold = noncentral_quantile(residuals, length * bias * bias, length / samples);
        let name = "the number of samples between false alarms";
        check::that(!threshold.is_nan(), name, samples, "more than a window")?;
        Ok(Self { residuals, window, threshold })
    }

    /// The mean number of samples between false alarms while the residuals have mean zero.
    #[must_use]
    pub fn between_false_alarms(&self) -> f64 {
        as_number(self.window) / self.alarm_probability(0.0)
    }

    /// The probability of an alarm in a window in which the mean of the residuals has the length `mean`.
    #[must_use]
    pub fn alarm_probability(&self, mean: f64) -> f64 {
        noncentral_survival(self.residuals, as_number(self.window) * mean * mean, self.threshold)
    }

    /// The distribution of the delay of a fault that moves the mean of the residuals to `mean(k)`, m
    /// entries, in its k-th sample, k from 0 on; at most `most` samples are followed.
    ///
    /// All starts of the fault within a window are equally likely; of more than 32 starts, 32 are evaluated. The result
    /// ends where less than 1e-6 of the faults are missed.
    #[must_use]
    pub fn delay(&self, mean: impl Fn(usize) -> Vec<f64>, most: usize) -> Delay {
        let dimension = self.residuals as usize;
        // Sums of the means of the first k samples.
        let mut sums = vec![vec![0.0; dimension]];
        for k in 0..most {
            let sum = sums[k].iter().zip(mean(k)).map(|(sum, value)| sum + value).collect();
            sums.push(sum);
        }
        let phases = self.window.min(PHASES);
        let mut missed = vec![0.0; most + 1];
        for phase in 0..phases {
            let before = phase * self.window / phases;
            let (mut undetected, mut start, mut end) = (1.0, 0, self.window - before);
            for (k, missed) in missed.iter_mut().enumerate() {
                if k == end {
                    let shift = sums[end].iter().zip(&sums[start]).map(|(end, start)| end - start);
                    let squared: f64 = shift.map(|value| value * value).sum();
                    let noncentrality = squared / as_number(self.window);
                    undetected *=
                        1.0 - noncentral_survival(self.residuals, noncentrality, self.threshold);
                    (start, end) = (end, end + self.window);
                }
                *missed += undetected / as_number(phases);
            }
        }
        let last = missed.iter().position(|missed| *missed < 1e-6).unwrap_or(most);
        missed.truncate(last + 1);
        Delay { missed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_false_alarms_are_the_stated_ones() {
        for (residuals, window) in [(1, 1), (2, 10), (5, 64)] {
            let test = WindowTest::with_false_alarms(residuals, window, 1e5, 0.0).unwrap();
            assert!((test.between_false_alarms() / 1e5 - 1.0).abs() < 1e-9);
        }
        assert!(WindowTest::with_false_alarms(1, 10, 10.0, 0.0).is_err());
        assert!(WindowTest::with_false_alarms(0, 10, 1e5, 0.0).is_err());
        assert!(WindowTest::with_false_alarms(1, 10, 1e5, f64::NAN).is_err());
    }

    #[test]
    fn a_constant_mean_is_found_window_by_window() {
        let test = WindowTest::with_false_alarms(2, 1, 1000.0, 0.0).unwrap();
        let power = test.alarm_probability(3.0);
        let delay = test.delay(|_| vec![3.0, 0.0], 4000).mean().unwrap();
        assert!((delay - 1.0 / power).abs() < 1e-3, "{delay} {power}");
    }

    #[test]
    fn a_mean_that_a_bias_explains_raises_the_threshold() {
        let [exact, biased] =
            [0.0, 1.0].map(|bias| WindowTest::with_false_alarms(2, 4, 1e4, bias).unwrap());
        assert!(biased.threshold > exact.threshold);
        assert!((4.0 / biased.alarm_probability(1.0) / 1e4 - 1.0).abs() < 1e-9);
    }
}
