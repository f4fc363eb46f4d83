//! How often a sink hands its rows over though it could still hold them.

use std::time::{Duration, Instant};

/// Most rows between two looks at the clock.
const STRIDE: u32 = 256;

/// Tells when an interval of wall-clock time has passed. Where rows come fast the clock is looked
/// at only now and then, because a look costs as much as several cells.
#[derive(Debug)]
pub(super) struct Pace {
    interval: Duration,
    handed_over: Instant,
    looked: Instant,
    /// Rows until the next look, and between two looks.
    left: u32,
    stride: u32,
}

impl Pace {
    pub(super) fn new(interval: Duration) -> Self {
        let now = Instant::now();
        Self { interval, handed_over: now, looked: now, left: 1, stride: 1 }
    }

    /// Counts a row; true where the interval has passed since it last was.
    pub(super) fn due(&mut self) -> bool {
        self.left -= 1;
        if self.left > 0 {
            return false;
        }
        let now = Instant::now();
        let slow = now.duration_since(self.looked) > self.interval / 16;
        self.stride = if slow { 1 } else { (2 * self.stride).min(STRIDE) };
        (self.left, self.looked) = (self.stride, now);
        let due = now.duration_since(self.handed_over) >= self.interval;
        if due {
            self.handed_over = now;
        }
        due
    }
}
