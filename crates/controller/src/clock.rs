//! The clock of a sampled controller or filter.

use serde::{Deserialize, Serialize};

/// The fraction of the period by which an instant may be early, in addition to [`clock_rounding`]: after a million
/// steps that an importer adds up, the error of the sum is 1e-5 of a step.
const TOLERANCE: f64 = 1e-4;

/// Returns the distance in s from `time` that counts as a rounding error of an importer, which adds up its steps.
#[must_use]
pub fn clock_rounding(time: f64) -> f64 {
    8.0 * f64::EPSILON * time.abs()
}

/// The instants start + k T, and the number of the next one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Clock {
    /// The period T in s.
    period: f64,
    /// The time of instant 0 in s.
    start: f64,
    /// The number k of the next instant: a whole number, exact up to 2^53.
    next: f64,
}

impl Clock {
    /// Creates a clock with the period T, in s, whose instant 0 is next.
    #[must_use]
    pub fn new(period: f64) -> Self {
        Self { period, start: 0.0, next: 0.0 }
    }

    /// Starts at `time` in s with instant 0.
    pub fn start(&mut self, time: f64) {
        (self.start, self.next) = (time, 0.0);
    }

    /// Returns instant 0 in s.
    #[must_use]
    pub fn first(&self) -> f64 {
        self.start
    }

    /// Returns the number of the next instant.
    #[must_use]
    pub fn number(&self) -> f64 {
        self.next
    }

    /// Returns the next instant in s.
    #[must_use]
    pub fn next_instant(&self) -> f64 {
        self.start + self.next * self.period
    }

    /// Returns the instant before the next one in s.
    #[must_use]
    pub fn last_instant(&self) -> f64 {
        self.start + (self.next - 1.0) * self.period
    }

    /// Returns the next instant in s if it is at most `end`; otherwise `None`.
    #[must_use]
    pub fn next_until(&self, end: f64) -> Option<f64> {
        let next = self.next_instant();
        let tolerance = TOLERANCE * self.period + clock_rounding(end);
        (next <= end + tolerance).then_some(next.min(end))
    }

    /// Returns the time in s from `time` to the next instant, negative if the instant was before.
    #[must_use]
    pub fn time_to_next(&self, time: f64) -> f64 {
        self.next * self.period - (time - self.start)
    }

    /// Goes on to the next instant.
    pub fn tick(&mut self) {
        self.next += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::Clock;

    /// The importer adds up its steps, of a quarter of the period. In seconds since 1970 the sum of steps of 0.25 ms is
    /// wrong; there, each step starts at a multiple.
    #[test]
    fn each_instant_is_due_at_the_end_of_its_step_and_none_before() {
        for (start, period, adds_up) in [
            (0.0, 1e-6, true),
            (0.0, 0.1, true),
            (3.3, 0.007, true),
            (-0.9, 0.3, true),
            (-1e3, 0.01, true),
            (1.7e9, 1e-3, false),
            (-1.7e9, 0.1, false),
        ] {
            let (mut clock, size, mut time) = (Clock::new(period), period / 4.0, start);
            clock.start(start);
            clock.tick();
            for k in 1..=100_000_u32 {
                let sum = if adds_up { time } else { start + f64::from(k - 1) * size };
                time = sum + size;
                let is_due = clock.next_until(time).is_some();
                assert_eq!(is_due, k.is_multiple_of(4), "{start} {period} {k}");
                if is_due {
                    assert!(clock.next_until(time) <= Some(time));
                    assert!(clock.last_instant() < time && clock.time_to_next(time) < size);
                    clock.tick();
                }
            }
        }
    }

    #[test]
    fn a_step_of_several_periods_has_several_instants() {
        let mut clock = Clock::new(2.0);
        let mut instants = Vec::new();
        while let Some(instant) = clock.next_until(7.0) {
            instants.push(instant);
            clock.tick();
        }
        assert_eq!(instants, [0.0, 2.0, 4.0, 6.0]);
    }
}
