//! The progress bar of a design.

use std::io::IsTerminal;
use std::time::Duration;

use design::Progress;
use indicatif::{ProgressBar, ProgressStyle};

use crate::logging;

/// Number of parts of the bar.
const PARTS: f64 = 1000.0;
/// Interval at which the elapsed time is drawn again.
const REDRAWN: Duration = Duration::from_millis(200);

/// A progress bar of the steps of a design; hidden if standard error is not a terminal. It is removed
/// when it is dropped.
pub(super) struct Bar {
    bar: Option<ProgressBar>,
}

impl Bar {
    pub(super) fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template(
                "{bar:24} {percent:>3} %, {elapsed}, {eta} left: {msg}",
            )
            .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = logging::bars().add(ProgressBar::new(parts(1.0)).with_style(style));
            bar.enable_steady_tick(REDRAWN);
            bar
        });
        Self { bar }
    }

    /// Shows the step that begins.
    pub(super) fn show(&self, progress: Progress) {
        if let Some(bar) = &self.bar {
            bar.set_position(parts(progress.done));
            bar.set_message(progress.step);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a display")]
fn parts(done: f64) -> u64 {
    (PARTS * done) as u64
}
