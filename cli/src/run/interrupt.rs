//! Handles Ctrl-C and SIGTERM: the run ends after the current step, or without it if the step does
//! not return.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use fmu_import::crash;

/// Exit status of a run that was interrupted.
pub(crate) const STATUS: u8 = 130;

/// Time limit of the current step after the signal.
const PATIENCE: Duration = Duration::from_millis(800);
/// Interval of checks whether FMU calls return after that.
const LOOK: Duration = Duration::from_millis(50);

static LISTENING: AtomicBool = AtomicBool::new(false);
static RAISED: AtomicBool = AtomicBool::new(false);
static NOTICED: AtomicBool = AtomicBool::new(false);
static STARTED: AtomicBool = AtomicBool::new(false);

/// Starts to handle signals: the first one ends the run soon, a second one ends the process at
/// once.
pub(super) fn listen() -> anyhow::Result<()> {
    if LISTENING.swap(true, Ordering::Relaxed) {
        return Ok(());
    }
    let raised = || {
        if RAISED.swap(true, Ordering::Relaxed) {
            crash::give_up();
            crash::leave(STATUS);
        }
        // If the thread cannot start, only the step itself and a second signal end the run.
        let _ = thread::Builder::new().name("interrupt".to_owned()).spawn(wait);
    };
    ctrlc::set_handler(raised).context("signals cannot be handled")
}

/// Waits for the end of the run, and ends the process if an FMU call does not return.
fn wait() {
    thread::sleep(PATIENCE);
    if !NOTICED.load(Ordering::Relaxed) {
        crash::give_up();
    }
    // Writing results, plots and checkpoints may take time; FMU calls may not.
    let mut before = Vec::new();
    loop {
        let calls = crash::calls();
        if !calls.is_empty() && calls == before {
            crash::give_up();
        }
        before = calls;
        thread::sleep(LOOK);
    }
}

/// Whether a signal has arrived.
#[inline]
pub(super) fn is_raised() -> bool {
    RAISED.load(Ordering::Relaxed)
}

/// Records that the first step starts.
pub(super) fn start() {
    STARTED.store(true, Ordering::Relaxed);
}

/// Whether the first step has started.
pub(crate) fn has_started() -> bool {
    STARTED.load(Ordering::Relaxed)
}

/// Records that the steps have ended and only the final work remains.
pub(super) fn notice() {
    NOTICED.store(true, Ordering::Relaxed);
}
