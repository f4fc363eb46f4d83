//! The figures of a loop that decide whether its verdict is green, for the comparison of designs.

use std::cmp::Ordering;

use crate::Error;
use crate::assess::robustness::{Physical, by_entries, loop_points};
use crate::report::robustness::{LoopPoint, ToleranceResult};
use crate::solve::solution::Solution;
use plant_file::robustness::RobustnessLimits;
use plant_file::signals::Signal;

/// A loop that is unstable within the tolerances is better than another one if it stays stable for a multiple of them
/// that is larger by this factor.
const FARTHER: f64 = 1.1;

/// Whether there are several signals, all without a unit, so that the units of the file count as equal.
pub(crate) fn have_no_units(signals: &[Signal]) -> bool {
    signals.len() > 1 && signals.iter().all(|signal| signal.unit.is_none())
}

/// The peaks of S of a stable loop, and its stability within the tolerances.
pub(crate) struct Judged {
    pub(crate) points: Vec<LoopPoint>,
    /// The largest peak of S. Signals without units count in the units that make it least.
    pub(crate) comparable_peak: f64,
    /// Whether an unstable loop was found for entries of the plant within their tolerances; false if the tolerances
    /// were not examined. Tolerances of FMU parameters do not count.
    pub(crate) is_unstable: bool,
    /// The multiple of the tolerances from which the loop is unstable; infinite if none was found or examined.
    pub(crate) unstable_from: f64,
}

impl Judged {
    /// Examines a loop, within `tolerances` if there are any; None if the nominal loop is not stable.
    pub(crate) fn of(
        solution: &Solution,
        tolerances: Option<&RobustnessLimits>,
    ) -> Result<Option<Self>, Error> {
        if solution.instability >= 0.0 {
            return Ok(None);
        }
        let physical = Physical::of(solution)?;
        let closed = physical.closed(&physical.controller)?;
        let linear = &solution.linear;
        let points = loop_points(&closed, &linear.actuators, &linear.measurements)?;
        let signals = [&linear.actuators, &linear.measurements];
        let peaks = points.iter().zip(signals).map(|(point, signals)| {
            if have_no_units(signals) { point.s_peak_scaled } else { point.judged }
        });
        let comparable_peak = peaks.fold(0.0, f64::max);
        let within = |limits| by_entries(linear, &physical, limits);
        let tolerance = tolerances.map(within).transpose()?;
        let is_unstable = tolerance.as_ref().is_some_and(ToleranceResult::is_unstable);
        let unstable_from = tolerance.map_or(f64::INFINITY, |test| test.first_unstable);
        Ok(Some(Self { points, comparable_peak, is_unstable, unstable_from }))
    }

    /// Whether peaks of S and tolerances allow a green verdict.
    pub(crate) fn is_green(&self, limits: &RobustnessLimits) -> bool {
        !self.is_unstable && self.largest_peak() <= limits.amber
    }

    /// Whether this loop is better than `other`, by the first criterion in which they differ: a peak of S that is not
    /// red; the peak of the choice within the limit; stability within the tolerances; the larger multiple of them for
    /// which an unstable loop is stable; the lower peak above the limit.
    pub(crate) fn is_better(&self, other: &Self, limits: &RobustnessLimits) -> bool {
        let rank = |judged: &Self| {
            let is_high = judged.peak_of_choice(limits) > limits.amber;
            (judged.largest_peak() > limits.red, is_high, judged.is_unstable)
        };
        let [peak, other_peak] = [self, other].map(|judged| judged.peak_of_choice(limits));
        match rank(self).cmp(&rank(other)) {
            Ordering::Equal if self.is_unstable => {
                self.unstable_from > FARTHER * other.unstable_from
            }
            Ordering::Equal => peak > limits.amber && peak < other_peak,
            ordering => ordering.is_lt(),
        }
    }

    /// The largest peak of S, if it is red that of signals in comparable units: the units of the file may be its cause.
    pub(crate) fn peak_of_choice(&self, limits: &RobustnessLimits) -> f64 {
        let peak = self.largest_peak();
        if peak <= limits.red { peak } else { self.comparable_peak }
    }

    pub(crate) fn largest_peak(&self) -> f64 {
        self.points.iter().map(|point| point.judged).fold(0.0, f64::max)
    }
}
