//! The detection of faults in a sample: residuals, tests, decision.
//!
//! ```text
//! r    = C x_r + D_u u + D_y y                                  u: the commands that are really applied
//! x_r' = A x_r + B_u u + B_y y
//! S+   = max(0, S+ + r - kappa),  S- = max(0, S- - r - kappa)   alarm: max(S+, S-) > threshold
//! s    = |sum of r over N samples|^2 / N                        alarm: s > threshold, at the end of a window
//! ```

use super::{Matrix, Number, all_finite};

/// The filter of the residuals, with k states and as many residuals as C has rows.
#[derive(Clone, Copy)]
pub struct Filter<'a, N> {
    /// A, `B_u`, `B_y`.
    pub state: [Matrix<'a, N>; 3],
    /// C, `D_u`, `D_y`.
    pub residual: [Matrix<'a, N>; 3],
}

impl<N: Number> Filter<'_, N> {
    /// `target` = the sum of three matrices times vectors, starting with 0.
    #[inline(always)]
    fn set_sums(matrices: &[Matrix<'_, N>; 3], vectors: [&[N]; 3], target: &mut [N]) {
        target.fill(N::zero());
        for (matrix, vector) in matrices.iter().zip(vectors) {
            matrix.add_product(vector, target);
        }
    }

    /// Computes the next state and the residuals of this sample from `x_r`, u and y; the residuals of the first sample
    /// are 0. Returns whether all numbers are finite.
    #[inline(always)]
    pub fn advance(
        &self,
        vectors: [&[N]; 3],
        is_first: bool,
        next: &mut [N],
        residuals: &mut [N],
    ) -> bool {
        if is_first {
            residuals.fill(N::zero());
        } else {
            Self::set_sums(&self.residual, vectors, residuals);
        }
        Self::set_sums(&self.state, vectors, next);
        all_finite(next) && all_finite(residuals)
    }
}

/// The sum if it is finite, else the largest finite number.
fn within_range<N: Number>(sum: N) -> N {
    if sum.is_finite() { sum } else { N::largest() }
}

/// The sum if it is above 0, else 0.
fn above_zero<N: Number>(sum: N) -> N {
    if sum.is_above(&N::zero()) { sum } else { N::zero() }
}

/// Two cumulative sums of a residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cumulative<N> {
    /// S+ and S-.
    pub sums: [N; 2],
    /// For each sum the sample since which it is above 0.
    pub since: [u32; 2],
}

impl<N: Number> Cumulative<N> {
    /// Adds the residual of a sample to both sums. Returns the larger sum, and the sample since which it is above 0, or
    /// this sample.
    #[inline(always)]
    pub fn add_sample(&mut self, residual: &N, drift: &N, sample: u32) -> (N, u32) {
        for (sum, since) in self.sums.iter().zip(self.since.iter_mut()) {
            if !sum.is_above(&N::zero()) {
                *since = sample;
            }
        }
        let [upper, lower] = self.sums.clone();
        let upper = above_zero(within_range(upper + residual.clone() - drift.clone()));
        let lower = above_zero(within_range(lower - residual.clone() - drift.clone()));
        self.sums = [upper.clone(), lower.clone()];
        let [since_upper, since_lower] = self.since;
        if lower.is_above(&upper) { (lower, since_lower) } else { (upper, since_upper) }
    }
}

/// The window of a test of several residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// The first sample of the window.
    pub since: u32,
    /// The number of samples in it so far.
    pub count: u32,
}

impl Window {
    /// Adds the residuals of a sample to their sums. Returns the statistic and the first sample of the window if this
    /// sample completes it, else `None`.
    #[inline(always)]
    pub fn add_sample<'a, N: Number + 'a>(
        &mut self,
        sums: impl Iterator<Item = (&'a mut N, &'a N)>,
        length: u32,
        sample: u32,
    ) -> Option<(N, u32)> {
        let is_first = self.count == 0;
        if is_first {
            self.since = sample;
        }
        self.count += 1;
        let mut squared = N::zero();
        for (sum, residual) in sums {
            let before = if is_first { N::zero() } else { sum.clone() };
            *sum = within_range(before + residual.clone());
            squared = squared + sum.clone() * sum.clone();
        }
        if self.count < length {
            return None;
        }
        self.count = 0;
        Some((within_range(squared / N::whole(length)), self.since))
    }
}

/// The decision, which stays until it is reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Decision {
    /// The position from 1 of the fault that the alarms fit; 0 without an alarm, -1 if they fit none or several.
    pub isolated: i32,
    /// The sample of the first alarm.
    pub detected_at: u32,
    /// The sample at which the fault started, as the test of the first alarm estimates it.
    pub onset: u32,
}

impl Decision {
    /// Whether a test has given an alarm.
    #[must_use]
    #[inline(always)]
    pub fn is_detected(&self) -> bool {
        self.isolated != 0
    }

    /// The time in s of `sample`, which is `detected_at` or `onset`; -1 without an alarm.
    #[inline(always)]
    pub fn time<N: Number>(&self, sample: u32, sample_time: N) -> N {
        if self.is_detected() { N::whole(sample) * sample_time } else { -N::whole(1) }
    }

    /// Notes the first alarm; later alarms change nothing.
    #[inline(always)]
    fn alarm(&mut self, sample: u32, onset: u32) {
        if !self.is_detected() {
            *self = Self { isolated: -1, detected_at: sample, onset };
        }
    }

    /// After an alarm, finds the only fault to which exactly the tests with an alarm react; -1 for none or several.
    #[inline(always)]
    fn isolate<const TESTS: usize>(&mut self, alarmed: &[bool; TESTS], reacts: &[[bool; TESTS]]) {
        if self.is_detected() {
            let mut fitting = (1..).zip(reacts).filter(|(_, reacts)| *reacts == alarmed);
            self.isolated = match (fitting.next(), fitting.next()) {
                (Some((fault, _)), None) => fault,
                _ => -1,
            };
        }
    }
}

/// The sums of the windows and the residuals of a sample, in the order of the tests.
pub struct Sums<'a, N> {
    /// The sums.
    pub sums: &'a mut [N],
    /// The residuals of the sample.
    pub residuals: &'a [N],
}

/// The outcomes of all tests, their thresholds, and the decision.
pub struct Outcomes<'a, N, const TESTS: usize> {
    /// The statistic of each test.
    pub statistic: &'a mut [N; TESTS],
    /// Whether each test has given an alarm.
    pub alarmed: &'a mut [bool; TESTS],
    /// The threshold of each test: a statistic above it is an alarm.
    pub threshold: &'a [N; TESTS],
    /// For each fault the tests that react to it.
    pub reacts: &'a [[bool; TESTS]],
    /// The decision.
    pub decision: &'a mut Decision,
}

impl<N: Number, const TESTS: usize> Outcomes<'_, N, TESTS> {
    /// Tests the residuals of a sample by cumulative sums, one residual for each test.
    #[inline(always)]
    pub fn test_sums(
        &mut self,
        tests: &mut [Cumulative<N>; TESTS],
        residuals: &[N],
        drifts: &[N; TESTS],
        sample: u32,
    ) {
        let inputs = tests.iter_mut().zip(residuals).zip(drifts);
        self.compare(
            sample,
            inputs.map(|((test, residual), drift)| Some(test.add_sample(residual, drift, sample))),
        );
    }

    /// Tests the residuals of a sample by windows. `counts`: the number of residuals of each test; `lengths`: the
    /// samples of its window; `sums`: one sum for each residual, and the residuals.
    #[inline(always)]
    pub fn test_windows(
        &mut self,
        windows: &mut [Window; TESTS],
        sums: &mut Sums<'_, N>,
        counts: &[usize; TESTS],
        lengths: &[u32; TESTS],
        sample: u32,
    ) {
        let mut sums = sums.sums.iter_mut().zip(sums.residuals);
        let tests = windows.iter_mut().zip(counts).zip(lengths);
        self.compare(
            sample,
            tests.map(|((window, count), length)| {
                window.add_sample(sums.by_ref().take(*count), *length, sample)
            }),
        );
    }

    /// Compares each statistic with its threshold, notes alarms, and decides. `statistics`: for each test its statistic
    /// and its estimate of the sample of the onset; `None` while the window of the test is not complete.
    #[inline(always)]
    fn compare(&mut self, sample: u32, statistics: impl Iterator<Item = Option<(N, u32)>>) {
        let outcomes = self.statistic.iter_mut().zip(self.alarmed.iter_mut()).zip(self.threshold);
        for (complete, ((statistic, alarmed), threshold)) in statistics.zip(outcomes) {
            let Some((value, onset)) = complete else { continue };
            *statistic = value;
            if statistic.is_above(threshold) {
                *alarmed = true;
                self.decision.alarm(sample, onset);
            }
        }
        self.decision.isolate(self.alarmed, self.reacts);
    }
}
