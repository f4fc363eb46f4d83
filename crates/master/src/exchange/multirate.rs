//! Outputs of slaves whose step covers several communication steps, at the points within this step.

use super::reals::Reals;
use slave::time_rounding;

/// Two times count as equal if they differ by less than this fraction of the step, or by [`time_rounding`].
const ROUNDING: f64 = 1e-6;

impl Reals {
    /// Returns start and end in s of the last step of `slave` if the step ends after `time`.
    pub(crate) fn step_ahead(&self, slave: usize, time: f64) -> Option<(f64, f64)> {
        let span = &self.trace.spans[slave];
        if !(self.multirate && span.has_size() && span.stepped) {
            return None;
        }
        let end = span.start + span.size;
        let rounding = (ROUNDING * span.size).max(time_rounding(time, 0.0));
        (end > time + rounding).then_some((span.start, end))
    }

    /// Whether the last step of `slave` ends after `time`; always false if all slaves make equal
    /// steps.
    #[inline]
    pub(crate) fn is_ahead(&self, slave: usize, time: f64) -> bool {
        self.multirate && self.step_ahead(slave, time).is_some()
    }

    /// Returns the time at which a held input of `slave` reads its source: the end of the step from
    /// `time` over `size` if the slave uses end values, otherwise its start.
    pub(crate) fn source_time(&self, slave: usize, source: usize, time: f64, size: f64) -> f64 {
        if self.uses_end_value(slave, source, time + size) { time + size } else { time }
    }

    /// Returns the value of an output at `time`. If its slave is ahead, a continuous output is interpolated
    /// between start and end of the slave's step; a discrete output has its value at the start.
    pub(super) fn value_at(&self, output: usize, time: f64) -> f64 {
        let (trace, owner) = (&self.trace, self.layout.owners[output] as usize);
        let end = trace.latest[output];
        match self.step_ahead(owner, time) {
            None => end,
            Some((start, until)) => {
                let value = trace.start[output];
                let held = self.layout.discrete[output];
                let part = if held { 0.0 } else { (time - start) / (until - start) };
                value + part * (end - value)
            }
        }
    }
}
