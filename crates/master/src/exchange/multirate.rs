//! Slaves that make several steps at once: what others see of them on the way.

use super::reals::Reals;

/// Part of a step that is rounding.
const ROUNDING: f64 = 1e-6;

impl Reals {
    /// Begin and end in s of the last step of `slave` where it has gone beyond `time`.
    pub(crate) fn beyond(&self, slave: usize, time: f64) -> Option<(f64, f64)> {
        let span = &self.trace.spans[slave];
        if !(self.several && span.has_size() && span.stepped) {
            return None;
        }
        let end = span.begin + span.size;
        (end > time + ROUNDING * span.size).then_some((span.begin, end))
    }

    /// Whether `slave` has gone beyond `time`: always false where all slaves make equal steps.
    #[inline]
    pub(crate) fn is_beyond(&self, slave: usize, time: f64) -> bool {
        self.several && self.beyond(slave, time).is_some()
    }

    /// The time for which a held input of `slave` asks the slave `source`, in a step from `time` over
    /// `size`: its end where the slave sees that, else its begin.
    pub(crate) fn seen_at(&self, slave: usize, source: usize, time: f64, size: f64) -> f64 {
        if self.sees_end(slave, source, time + size) { time + size } else { time }
    }

    /// The value of an output at `time`: the latest, or the one on the way of a slave that has gone
    /// beyond; on the line between begin and end of its step, of an Integer that at the begin.
    pub(super) fn value_at(&self, output: usize, time: f64) -> f64 {
        let (trace, owner) = (&self.trace, self.layout.owners[output] as usize);
        let end = trace.latest[output];
        match self.beyond(owner, time) {
            None => end,
            Some((begin, until)) => {
                let start = trace.begin[output];
                let is_integer = self.layout.from_integers.iter().any(|&(_, own)| own == output);
                let part = if is_integer { 0.0 } else { (time - begin) / (until - begin) };
                start + part * (end - start)
            }
        }
    }
}
