//! The progress bar of a run.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressStyle};

use crate::logging;

/// Number of updates of the bar during the run.
const PARTS: f64 = 400.0;

/// A progress bar of simulated time; hidden if standard error is not a terminal.
pub(super) struct Progress {
    bar: Option<ProgressBar>,
    start: f64,
    part: f64,
    next: f64,
}

impl Progress {
    /// Creates a bar from `start` to `stop`, in s.
    pub(super) fn new(start: f64, stop: f64) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:40} {msg} of {prefix} s simulated")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(whole(PARTS)).with_style(style);
            logging::bars().add(bar.with_prefix(format!("{stop}")))
        });
        let next = if bar.is_some() { start } else { f64::INFINITY };
        Self { bar, start, part: (stop - start) / PARTS, next }
    }

    /// Updates the bar to `time`, in s.
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
            bar.set_message(format!("{time:.4}"));
            bar.set_position(whole((time - self.start) / self.part));
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

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a display")]
fn whole(value: f64) -> u64 {
    value.max(0.0) as u64
}
