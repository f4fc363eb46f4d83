//! A two-sided CUSUM test of a residual.

/// Shift of the mean in standard deviations from which on the sums grow, and the threshold of the sums.
///
/// The mean number of samples between two false alarms of one side is about
/// (exp(2 k (h + 1.166)) - 1 - 2 k (h + 1.166)) / (2 k^2) (Siegmund 1985), 1.6e12 for these values.
pub(crate) const ALLOWANCE: f64 = 1.0;
pub(crate) const THRESHOLD: f64 = 13.0;
/// Upper limit of the sums, so that an alarm ends soon after its fault.
const LARGEST: f64 = 20.0;

/// The sums of E. S. Page, "Continuous inspection schemes" (1954), of both signs.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Cusum {
    sums: [f64; 2],
}

impl Cusum {
    /// Takes a residual divided by its standard deviation; returns whether a sum is above the threshold.
    pub(crate) fn take(&mut self, residual: f64) -> bool {
        for (sum, signed) in self.sums.iter_mut().zip([residual, -residual]) {
            *sum = (*sum + signed - ALLOWANCE).clamp(0.0, LARGEST);
        }
        self.is_above(THRESHOLD)
    }

    /// Whether a sum is above `limit`.
    pub(crate) fn is_above(&self, limit: f64) -> bool {
        self.sums.iter().any(|sum| *sum > limit)
    }
}
