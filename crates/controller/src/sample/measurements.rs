//! Which measurements of a sample are used, and for how long the last value replaces one that is not.

use super::Number;

/// When a measurement is used; a number for each measurement.
#[derive(Clone, Copy)]
pub struct Validity<'a, N> {
    /// The smallest values that are used.
    pub low: &'a [N],
    /// The largest ones.
    pub high: &'a [N],
    /// The most samples for which the last value may be used, the largest number where there is no such limit; empty
    /// without a limit.
    pub most_held: &'a [u32],
}

impl<N: Number> Validity<'_, N> {
    /// Takes the measurements that are finite and in their range. The others keep their last value, and `held` counts
    /// the samples for which they do. Returns whether there is one of them.
    #[inline(always)]
    pub fn take(&self, values: &[N], last_values: &mut [N], held: &mut [u32]) -> bool {
        let mut counters = held.iter_mut();
        let mut is_held = false;
        let ranges = self.low.iter().zip(self.high);
        for ((last_value, value), (low, high)) in last_values.iter_mut().zip(values).zip(ranges) {
            let is_used = value.is_finite() && !value.is_below(low) && !value.is_above(high);
            if is_used {
                *last_value = value.clone();
            }
            if let Some(count) = counters.next() {
                *count = if is_used { 0 } else { count.saturating_add(1) };
            }
            is_held |= !is_used;
        }
        is_held
    }

    /// Whether the last value of a measurement is too old.
    #[must_use]
    #[inline(always)]
    pub fn is_lost(&self, held: &[u32]) -> bool {
        held.iter().zip(self.most_held).any(|(count, most)| count > most)
    }
}
