//! The tests: cumulative sums of one residual r, with drift kappa, or the mean of several over a window of N samples; h
//! is the threshold.
//!
//! ```text
//! S+ = max(0, S+ + r - kappa),  S- = max(0, S- - r - kappa)      alarm: max(S+, S-) > h
//! s = |sum of r over N samples|^2 / N                            alarm: s > h, at the end of a window
//! ```

use serde::{Deserialize, Serialize};

use aso_controller::design::detection::TestDesign;

#[derive(Clone, Serialize, Deserialize)]
pub(super) struct TestState {
    /// S+ and S-, or the sums of the window.
    sums: Vec<f64>,
    /// The times in s since which S+ and S- are above 0, or the start of the window.
    since: Vec<f64>,
    /// The number of samples in the window so far.
    count: u32,
    /// max(S+, S-), or s of the last whole window.
    pub(super) statistic: f64,
    /// Whether there was an alarm since the last reset.
    pub(super) has_alarmed: bool,
}

impl TestState {
    pub(super) fn new(test: &TestDesign) -> Self {
        let (sums, times) = if test.drift.is_some() { (2, 2) } else { (test.residuals, 1) };
        Self {
            sums: vec![0.0; sums],
            since: vec![0.0; times],
            count: 0,
            statistic: 0.0,
            has_alarmed: false,
        }
    }

    /// Clears the sums and the alarm.
    pub(super) fn clear(&mut self) {
        self.restart();
        self.has_alarmed = false;
    }

    /// Clears the sums and the statistic, but not an alarm.
    pub(super) fn restart(&mut self) {
        self.sums.fill(0.0);
        (self.count, self.statistic) = (0, 0.0);
    }

    /// Tests the residuals of the sample at `time` in s; returns the estimated onset in s if there is an alarm. A test
    /// with a window has alarms at the end of its windows only.
    pub(super) fn take(&mut self, test: &TestDesign, residuals: &[f64], time: f64) -> Option<f64> {
        let onset = match test.drift {
            Some(drift) => self.add_to_sums(drift, residuals[0], time),
            None => self.add_to_window(test.window.unwrap_or(1), residuals, time)?,
        };
        if self.statistic > test.threshold {
            self.has_alarmed = true;
            return Some(onset);
        }
        None
    }

    /// Updates the cumulative sums; returns the time since which the larger sum is above 0.
    fn add_to_sums(&mut self, drift: f64, residual: f64, time: f64) -> f64 {
        let signed = [residual, -residual];
        for ((sum, since), signed_residual) in self.sums.iter_mut().zip(&mut self.since).zip(signed)
        {
            if *sum <= 0.0 {
                *since = time;
            }
            *sum = (*sum + signed_residual - drift).max(0.0);
        }
        let larger = usize::from(self.sums[1] > self.sums[0]);
        self.statistic = self.sums[larger];
        self.since[larger]
    }

    /// Adds residuals to the window of `window` samples; returns the time of its first sample if it is complete.
    fn add_to_window(&mut self, window: u32, residuals: &[f64], time: f64) -> Option<f64> {
        if self.count == 0 {
            self.sums.fill(0.0);
            self.since[0] = time;
        }
        self.sums.iter_mut().zip(residuals).for_each(|(sum, residual)| *sum += residual);
        self.count += 1;
        if self.count < window {
            return None;
        }
        self.count = 0;
        let squared: f64 = self.sums.iter().map(|sum| sum * sum).sum();
        self.statistic = squared / f64::from(window);
        Some(self.since[0])
    }
}
