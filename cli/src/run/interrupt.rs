//! Handles Ctrl-C and the signals by which systems announce the end: the run ends after the current step; the process
//! ends if the step does not return.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

use anyhow::Context;
use fmu_import::crash;

use crate::signals::on_signal;

/// Time limits, after the signal, for a call of an FMU and for the current step.
const CALL: Duration = Duration::from_millis(800);
const STEP: Duration = Duration::from_secs(5);
/// Interval between two checks whether calls of FMUs return.
const LOOK: Duration = Duration::from_millis(50);
/// A second signal within this time counts as the first one, sent both to the process and to its group.
const TOGETHER: Duration = Duration::from_millis(200);

/// Whether the handler of the signals is installed.
static LISTENING: AtomicBool = AtomicBool::new(false);
/// The number of the first signal that has arrived; 0: none.
static RAISED: AtomicU8 = AtomicU8::new(0);
static STEPS_ENDED: AtomicBool = AtomicBool::new(false);
/// The thread of [`wait`].
static WAITING: OnceLock<Thread> = OnceLock::new();

/// Exit status of a run that a signal has ended: 128 and the number of the signal.
pub(crate) fn status() -> u8 {
    128 + RAISED.load(Ordering::Relaxed)
}

/// Starts to handle signals: the first one ends the run soon, a second one ends the process at
/// once. A second call has no effect.
pub(super) fn listen() -> anyhow::Result<()> {
    if LISTENING.swap(true, Ordering::Relaxed) {
        return Ok(());
    }
    // Started now: while a library is loaded, no thread can start.
    let waiting = thread::Builder::new().name("interrupt".to_owned()).spawn(wait);
    let waiting = waiting.context("signals cannot be handled")?;
    let _ = WAITING.set(waiting.thread().clone());
    on_signal(raise).context("signals cannot be handled")
}

/// Handles a signal: the first one makes [`wait`] watch the end of the run, a later one after [`TOGETHER`] ends the
/// process.
fn raise(signal: u8) {
    /// Time at which the first signal arrived.
    static FIRST: OnceLock<Instant> = OnceLock::new();
    if RAISED.compare_exchange(0, signal, Ordering::Relaxed, Ordering::Relaxed).is_err() {
        if FIRST.get_or_init(Instant::now).elapsed() > TOGETHER {
            crash::give_up(None);
            crash::leave(status());
        }
        return;
    }
    FIRST.get_or_init(Instant::now);
    if let Some(waiting) = WAITING.get() {
        waiting.unpark();
    }
}

/// Waits for a signal. Then ends the process if a call of an FMU does not return within [`CALL`], or if the steps do
/// not end within [`STEP`]; writing results, plots and checkpoints may take longer.
fn wait() {
    while !is_raised() {
        thread::park();
    }
    let start = Instant::now();
    let (mut before, mut since) = (Vec::new(), start);
    loop {
        let calls = crash::calls();
        if calls.is_empty() || calls != before {
            (before, since) = (calls, Instant::now());
        } else if since.elapsed() >= CALL {
            crash::give_up(Some(CALL));
        }
        if start.elapsed() > STEP && !STEPS_ENDED.load(Ordering::Relaxed) {
            crash::give_up(None);
        }
        thread::sleep(LOOK);
    }
}

/// Whether a signal has arrived.
#[inline]
pub(super) fn is_raised() -> bool {
    RAISED.load(Ordering::Relaxed) != 0
}

/// Records that the steps have ended and only the final work remains.
pub(super) fn notice() {
    STEPS_ENDED.store(true, Ordering::Relaxed);
}
