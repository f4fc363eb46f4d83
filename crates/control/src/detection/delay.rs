//! The distribution of a detection delay.

/// The distribution of the number of samples from the start of a fault to its detection, under the
/// condition that there was no false alarm before.
#[derive(Debug, Clone, PartialEq)]
pub struct Delay {
    /// `missed[k]`: the probability that the fault is not detected within k samples; `missed[0]` = 1.
    pub missed: Vec<f64>,
}

impl Delay {
    /// The probability that the fault is detected within `samples` samples, at most the last computed number; 0 if
    /// `missed` is empty.
    #[must_use]
    pub fn detected_within(&self, samples: usize) -> f64 {
        1.0 - self.missed.get(samples).or(self.missed.last()).copied().unwrap_or(1.0)
    }

    /// The mean delay in samples: the sum of `missed`. None if more than 1e-3 of the faults are missed at
    /// the last computed sample, or `missed` is empty.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        let last = self.missed.last()?;
        (*last <= 1e-3).then(|| self.missed.iter().sum())
    }

    /// The number of samples within which the fraction `probability` of the faults is detected; None if no computed
    /// number is enough.
    #[must_use]
    pub fn quantile(&self, probability: f64) -> Option<usize> {
        self.missed.iter().position(|missed| 1.0 - missed >= probability)
    }
}
