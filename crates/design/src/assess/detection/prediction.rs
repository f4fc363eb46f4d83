//! Predicted delays, and the least fault that is detected in time.

use control::Error;
use control::detection::{Cusum, Delay, WindowTest};
use nalgebra::DMatrix;

/// Largest number of samples over which a detection delay is computed, after the mean has settled.
const MOST_SAMPLES: usize = 20_000;
/// Probability with which the least detectable fault must be detected in time.
const POWER: f64 = 0.95;
/// The largest factor of the size of a fault that is tried, and the number of bisections.
const LARGEST: f64 = 1e3;
const BISECTIONS: usize = 18;
/// Longest window, in samples, that the choice of the window tries.
const LONGEST: usize = 4096;

/// A test of residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TestKind {
    Cusum(Cusum),
    Window(WindowTest),
}

impl TestKind {
    pub(super) fn drift(&self) -> Option<f64> {
        match self {
            Self::Cusum(test) => Some(test.drift),
            Self::Window(_) => None,
        }
    }

    pub(super) fn window(&self) -> Option<u32> {
        match self {
            Self::Cusum(_) => None,
            Self::Window(test) => Some(u32::try_from(test.window).unwrap_or(u32::MAX)),
        }
    }

    pub(super) fn threshold(&self) -> f64 {
        match self {
            Self::Cusum(test) => test.threshold,
            Self::Window(test) => test.threshold,
        }
    }

    /// Returns a lower bound of the mean number of samples between false alarms while the mean of the residuals without
    /// faults has at most the norm `bias`.
    pub(super) fn between_false_alarms(&self, bias: f64) -> f64 {
        match self {
            Self::Cusum(test) => test.between_false_alarms_with_bias(bias),
            #[expect(clippy::cast_precision_loss, reason = "a number of samples")]
            Self::Window(test) => test.window as f64 / test.alarm_probability(bias),
        }
    }

    /// Returns the delay after a step that moves the means of the residuals to `factor` times the columns of `means`,
    /// one for each sample; the last column stays. The delay is computed over `most` samples.
    fn delay(&self, means: &DMatrix<f64>, factor: f64, most: usize) -> Delay {
        let last = means.ncols() - 1;
        match self {
            Self::Cusum(test) => test.delay(|k| means[(0, k.min(last))] * factor, most),
            Self::Window(test) => {
                let mean =
                    |k: usize| means.column(k.min(last)).iter().map(|mean| mean * factor).collect();
                test.delay(mean, most)
            }
        }
    }
}

/// A test and the means of its residuals after a step of a fault.
pub(super) struct Prediction<'a> {
    pub(super) kind: &'a TestKind,
    /// Mean of each residual at each sample, residuals x samples.
    pub(super) means: &'a DMatrix<f64>,
    /// Time between samples, s.
    pub(super) period: f64,
}

impl Prediction<'_> {
    /// Returns the delay after a step of `factor` times the size.
    pub(super) fn delay(&self, factor: f64) -> Delay {
        self.kind.delay(self.means, factor, self.means.ncols() + MOST_SAMPLES)
    }

    /// Returns the least factor of the size, from 0.001 on, that is detected within `time` s with probability 0.95;
    /// None if 1000 times the size is not.
    pub(super) fn least(&self, time: f64) -> Option<f64> {
        // A sample after this time does not count; the factor is for the rounding of the quotient.
        let samples = (time / self.period * (1.0 + 1e-9)).floor();
        let most = whole(samples).min(2 * MOST_SAMPLES);
        let detects =
            |factor: f64| self.kind.delay(self.means, factor, most).detected_within(most) >= POWER;
        if !detects(LARGEST) {
            return None;
        }
        let (mut low, mut high) = (1.0 / LARGEST, LARGEST);
        for _ in 0..BISECTIONS {
            let middle = f64::sqrt(low * high);
            *(if detects(middle) { &mut high } else { &mut low }) = middle;
        }
        Some(high)
    }
}

/// Returns the test whose window, a power of two of samples, gives the least sum of mean delays of some faults.
///
/// `samples`: the number between false alarms; a window has less than a quarter of it, or one sample.
pub(super) fn best_window(
    residuals: u32,
    samples: f64,
    bias: f64,
    means: &[DMatrix<f64>],
) -> Result<WindowTest, Error> {
    let mut best: Option<(f64, WindowTest)> = None;
    let mut window = 1;
    #[expect(clippy::cast_precision_loss, reason = "at most 4096")]
    while window <= LONGEST && (window as f64) < 0.25 * samples {
        let test = WindowTest::with_false_alarms(residuals, window, samples, bias)?;
        let kind = TestKind::Window(test);
        let delay = |means: &DMatrix<f64>| {
            let most = means.ncols().min(40 * window) + 40 * window;
            kind.delay(means, 1.0, most).mean().unwrap_or(f64::INFINITY)
        };
        let sum: f64 = means.iter().map(delay).sum();
        match best {
            // Beyond the best window the delays grow with its length.
            Some((least, _)) if sum > 2.0 * least => break,
            Some((least, _)) if sum >= least => {}
            _ => best = Some((sum, test)),
        }
        window *= 2;
    }
    let shortest = || WindowTest::with_false_alarms(residuals, 1, samples, bias);
    best.map_or_else(shortest, |(_, test)| Ok(test))
}

/// Returns the number rounded to a whole one, from 0 to 2^31.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
pub(super) fn whole(number: f64) -> usize {
    number.round().clamp(0.0, 2_147_483_648.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_fault_is_detected_in_the_samples_within_the_time() {
        let kind = TestKind::Cusum(Cusum { drift: 0.5, threshold: 5.0 });
        let means = DMatrix::from_element(1, 10, 1.0);
        let least = |period, time| Prediction { kind: &kind, means: &means, period }.least(time);
        // The third sample is at 1.2 s.
        assert_eq!(least(0.4, 1.0), least(0.4, 0.8));
        assert!(least(0.4, 1.2).unwrap() < least(0.4, 1.0).unwrap());
        assert_eq!(least(0.4, 0.3), None);
        // The quotient is 2.9999999999999996.
        assert_eq!(least(0.1, 0.3), least(1.0, 3.0));
    }
}
