//! The choice of the measurements of a sample that are used; the last value replaces others for a limited time.

use super::Number;

/// The conditions under which measurements are used, one number for each measurement.
#[derive(Clone, Copy)]
pub struct Validity<'a, N> {
    /// The smallest values that are used.
    pub low: &'a [N],
    /// The largest values that are used.
    pub high: &'a [N],
    /// The most samples for which the last value may be used, `u32::MAX` for a measurement without such a limit; empty
    /// if no measurement has one.
    pub most_held: &'a [u32],
}

impl<N: Number> Validity<'_, N> {
    /// Takes the measurements that are finite and in their range. The others keep their last value, and `held`, if it
    /// is not empty, counts the samples since it was taken. Returns whether a measurement keeps its last value.
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

    /// Whether the last value of a measurement was used for too many samples.
    #[must_use]
    #[inline(always)]
    pub fn is_lost(&self, held: &[u32]) -> bool {
        held.iter().zip(self.most_held).any(|(count, most)| count > most)
    }
}
