//! Timing of the automatic writes of a sink.

use std::time::{Duration, Instant};

/// Largest number of rows between two readings of the clock.
const STRIDE: u32 = 256;

/// A timer of an interval of wall-clock time. If rows arrive fast, the timer reads the clock only for some rows,
/// because a reading takes as long as writing several cells.
#[derive(Debug)]
pub(super) struct Pace {
    interval: Duration,
    last_write: Instant,
    last_reading: Instant,
    /// Number of rows until the next reading of the clock.
    left: u32,
    /// Present number of rows between two readings of the clock.
    stride: u32,
}

impl Pace {
    pub(super) fn new(interval: Duration) -> Self {
        let now = Instant::now();
        Self { interval, last_write: now, last_reading: now, left: 1, stride: 1 }
    }

    /// Counts a row. Returns true if the interval has passed since the last true result.
    pub(super) fn due(&mut self) -> bool {
        self.left -= 1;
        if self.left > 0 {
            return false;
        }
        let now = Instant::now();
        let slow = now.duration_since(self.last_reading) > self.interval / 16;
        self.stride = if slow { 1 } else { (2 * self.stride).min(STRIDE) };
        (self.left, self.last_reading) = (self.stride, now);
        let due = now.duration_since(self.last_write) >= self.interval;
        if due {
            self.last_write = now;
        }
        due
    }
}
