//! What the verdict on the loop of a solution depends on.

use std::cmp::Ordering;

use crate::Error;
use crate::assess::robustness::{Physical, by_entries, loop_points};
use crate::report::robustness::LoopPoint;
use crate::solve::solution::Solution;
use plant_file::robustness::RobustnessLimits;

/// The peaks of S of a stable loop, and its stability within the tolerances.
pub(crate) struct Judged {
    pub(crate) points: Vec<LoopPoint>,
    pub(crate) is_unstable: bool,
}

impl Judged {
    /// Examines a loop, within the tolerances if they are given; None if it is not stable.
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
        let within = |limits| {
            by_entries(solution, &physical, limits).map(|tolerance| tolerance.is_unstable())
        };
        let is_unstable = tolerances.map_or(Ok(false), within)?;
        Ok(Some(Self { points, is_unstable }))
    }

    /// Whether the verdict has no reason to be other than green.
    pub(crate) fn is_green(&self, limits: &RobustnessLimits) -> bool {
        !self.is_unstable && self.largest_peak() <= limits.amber
    }

    /// Whether the peaks are within the limit where those of the other are not, else whether it is stable within the
    /// tolerances where the other is not, else whether its peaks are lower.
    pub(crate) fn is_better(&self, other: &Self, limits: &RobustnessLimits) -> bool {
        let rank = |judged: &Self| (judged.largest_peak() > limits.amber, judged.is_unstable);
        match rank(self).cmp(&rank(other)) {
            Ordering::Equal => self.largest_peak() < other.largest_peak(),
            ordering => ordering.is_lt(),
        }
    }

    fn largest_peak(&self) -> f64 {
        self.points.iter().map(|point| point.judged).fold(0.0, f64::max)
    }
}
