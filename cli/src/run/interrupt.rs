//! Ctrl-C and SIGTERM: the run ends at the current step.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;

/// Exit status of a run that was interrupted.
pub(super) const STATUS: u8 = 130;

static RAISED: AtomicBool = AtomicBool::new(false);

/// From now on a signal is noted; a second one, where the first does not help, ends the process.
pub(super) fn listen() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if RAISED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(STATUS));
        }
    })
    .context("signals cannot be handled")
}

/// Whether a signal has come.
#[inline]
pub(super) fn is_raised() -> bool {
    RAISED.load(Ordering::Relaxed)
}
