//! Ctrl-C and SIGTERM: the run ends at the current step; where that step does not return, without
//! it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use fmu_import::crash;

/// Exit status of a run that was interrupted.
pub(crate) const STATUS: u8 = 130;

/// How long the current step may take from the signal on.
const PATIENCE: Duration = Duration::from_millis(800);
/// Between two looks at the calls of the FMUs after that.
const LOOK: Duration = Duration::from_millis(50);

static LISTENING: AtomicBool = AtomicBool::new(false);
static RAISED: AtomicBool = AtomicBool::new(false);
static NOTICED: AtomicBool = AtomicBool::new(false);
static STARTED: AtomicBool = AtomicBool::new(false);

/// From now on a signal is noted, and the process ends soon after it; a second one ends it at once.
pub(super) fn listen() -> anyhow::Result<()> {
    if LISTENING.swap(true, Ordering::Relaxed) {
        return Ok(());
    }
    let raised = || {
        if RAISED.swap(true, Ordering::Relaxed) {
            crash::give_up();
            crash::leave(STATUS);
        }
        // Without the thread only the step itself and a second signal end the run.
        let _ = thread::Builder::new().name("interrupt".to_owned()).spawn(wait);
    };
    ctrlc::set_handler(raised).context("signals cannot be handled")
}

/// Waits for the end of the run, and ends the process where an FMU keeps it from ending.
fn wait() {
    thread::sleep(PATIENCE);
    if !NOTICED.load(Ordering::Relaxed) {
        crash::give_up();
    }
    // Results, pictures and checkpoints may take their time, FMUs may not.
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

/// Whether a signal has come.
#[inline]
pub(super) fn is_raised() -> bool {
    RAISED.load(Ordering::Relaxed)
}

/// The first step is about to begin.
pub(super) fn start() {
    STARTED.store(true, Ordering::Relaxed);
}

/// Whether a run has begun to step.
pub(crate) fn has_started() -> bool {
    STARTED.load(Ordering::Relaxed)
}

/// The steps have ended: only what follows them is left.
pub(super) fn notice() {
    NOTICED.store(true, Ordering::Relaxed);
}
