//! Paces a run by the wall clock.

use std::fmt;
use std::time::{Duration, Instant};

use fmu_description::number::seconds;

/// Longest sleep between two checks whether the wait has to end early.
const SLICE: Duration = Duration::from_millis(50);
/// Remaining wait below which the clock is read in a loop, because a sleep may end late by about this time.
const SPIN: Duration = Duration::from_micros(150);

/// A factor of real time: `factor` seconds of simulated time take one second of wall-clock time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealTimeFactor(f64);

impl std::str::FromStr for RealTimeFactor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = "expected a finite number above 0, for example 2 for twice real time";
        match text.parse::<f64>() {
            Ok(factor) if factor > 0.0 && factor.is_finite() => Ok(Self(factor)),
            Ok(_) => Err(expected.to_owned()),
            Err(_) => Err(format!("{expected}; before a file, write --real-time=1 for real time")),
        }
    }
}

/// Delays a run so that the communication point `t` is not passed before the instant
/// `i(t) = i_0 + (t - t_0) / factor` of a monotonic clock.
///
/// `t_0` and `i_0` are simulated time and instant at the start. Each instant is computed from `t_0` and `i_0`, so that
/// errors of single waits do not add up. A step that ends after its instant is an overrun; later steps are not delayed
/// until the run has caught up.
#[derive(Clone, Debug)]
pub struct RealTime {
    start: Option<(f64, Instant)>,
    overruns: Overruns,
}

/// The overruns of a paced run. [`fmt::Display`] writes a clause for the run's summary.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overruns {
    /// The factor of real time.
    pub factor: f64,
    /// Number of steps so far.
    pub steps: u64,
    /// Number of overruns: steps that ended after their instant.
    pub count: u64,
    /// Largest overrun in s.
    pub largest: f64,
    /// Simulated time in s at the end of the step with the largest overrun; 0 without overruns.
    pub at: f64,
}

impl fmt::Display for Overruns {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { factor, steps, count, largest, at } = self;
        write!(
            formatter,
            "paced at {factor} times real time: {count} of {steps} steps ended late"
        )?;
        if *count > 0 {
            write!(formatter, ", at most by {largest:.3e} s, at t = {} s", seconds(*at))?;
        }
        Ok(())
    }
}

impl RealTime {
    /// Creates the pacing of a run; its clock starts with the first call of [`RealTime::wait`].
    #[must_use]
    pub fn new(factor: RealTimeFactor) -> Self {
        let RealTimeFactor(factor) = factor;
        Self { start: None, overruns: Overruns { factor, ..Overruns::default() } }
    }

    /// Waits until the instant of the simulated time `time` in s, or counts an overrun if this instant has passed. The
    /// first call starts the clock. Returns early if `ends` returns true, which is called at least every 50 ms.
    pub fn wait(&mut self, time: f64, mut ends: impl FnMut() -> bool) {
        let now = Instant::now();
        let Some((first, start)) = self.start else {
            self.start = Some((time, now));
            return;
        };
        self.overruns.steps += 1;
        let due = (time - first) / self.overruns.factor;
        let passed = (now - start).as_secs_f64();
        if passed > due {
            self.overruns.count += 1;
            if passed - due > self.overruns.largest {
                (self.overruns.largest, self.overruns.at) = (passed - due, time);
            }
            return;
        }
        loop {
            // An instant beyond the range of the clock is never reached; `ends` ends the wait.
            let left = due - start.elapsed().as_secs_f64();
            if left <= 0.0 || ends() {
                return;
            }
            let left = Duration::try_from_secs_f64(left).unwrap_or(Duration::MAX);
            match left.checked_sub(SPIN) {
                Some(sleep) => std::thread::sleep(sleep.min(SLICE)),
                None => std::hint::spin_loop(),
            }
        }
    }

    /// Delays all later instants by the time `paused` that the run was paused. Does nothing before the first call of
    /// [`RealTime::wait`].
    pub fn shift(&mut self, paused: Duration) {
        if let Some((_, start)) = &mut self.start
            && let Some(later) = start.checked_add(paused)
        {
            *start = later;
        }
    }

    /// Returns the overruns so far.
    #[must_use]
    pub fn overruns(&self) -> Overruns {
        self.overruns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_follow_from_the_start_so_that_late_steps_do_not_shift_later_ones() {
        let mut pace = RealTime::new("2".parse().unwrap());
        let start = Instant::now();
        pace.wait(1.0, || false);
        for step in 1..=40 {
            if step == 10 {
                std::thread::sleep(Duration::from_millis(20));
            }
            pace.wait(1.0 + 0.005 * f64::from(step), || false);
        }
        let seconds = start.elapsed().as_secs_f64();
        let Overruns { steps, count, largest, .. } = pace.overruns();
        assert!(seconds >= 0.1, "0.2 s at twice real time took {seconds} s");
        assert_eq!(steps, 40);
        assert!(count >= 1 && largest >= 0.015, "{count} overruns, at most {largest} s");
    }

    #[test]
    fn a_wait_ends_early_if_the_caller_asks() {
        let mut pace = RealTime::new("1e-300".parse().unwrap());
        pace.wait(0.0, || false);
        let mut calls = 0;
        pace.wait(1e9, || {
            calls += 1;
            calls > 1
        });
        assert_eq!(calls, 2);
    }

    #[test]
    fn a_factor_is_a_finite_number_above_zero() {
        for text in ["0", "-1", "nan", "inf", "system.toml", ""] {
            let error = text.parse::<RealTimeFactor>().unwrap_err();
            assert!(error.starts_with("expected a finite number above 0"), "{text}: {error}");
        }
    }
}
