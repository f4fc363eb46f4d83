//! The progress bar of a run.

use std::io::IsTerminal;
use std::time::Instant;

use fmu_description::number::rounded;
use indicatif::ProgressBar;

use crate::logging;

/// Number of updates of the bar during the run.
const PARTS: f64 = 400.0;
/// Significant digits of the time and of the speed on the bar.
const DIGITS: usize = 3;

/// A progress bar of simulated time; hidden if standard error is not a terminal.
pub(super) struct Progress {
    bar: Option<ProgressBar>,
    /// Start time of the run in s.
    start: f64,
    /// Simulated time in s between two updates, and the time of the next one; infinite without a bar.
    part: f64,
    next: f64,
    wall_clock_start: Instant,
}

impl Progress {
    /// Creates a bar from `start` to `stop`, in s.
    pub(super) fn new(start: f64, stop: f64) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            logging::bar("{bar:24} {percent:>3} %, {msg}, {eta} left", logging::position(PARTS))
        });
        let next = if bar.is_some() { start } else { f64::INFINITY };
        let wall_clock_start = Instant::now();
        Self { bar, start, part: (stop - start) / PARTS, next, wall_clock_start }
    }

    /// Updates the bar to `time`, in s, if an update is due.
    #[inline]
    pub(super) fn show(&mut self, time: f64) {
        if time >= self.next {
            self.draw(time);
        }
    }

    #[cold]
    fn draw(&mut self, time: f64) {
        self.next = time + self.part;
        if let Some(bar) = &self.bar {
            let done = time - self.start;
            let elapsed = self.wall_clock_start.elapsed().as_secs_f64();
            let speed = done / elapsed.max(f64::MIN_POSITIVE);
            let (time, speed) = (rounded(time, DIGITS), rounded(speed, DIGITS));
            bar.set_message(format!("t = {time} s, {speed} times real time"));
            bar.set_position(logging::position(done / self.part));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
