//! The progress of a design on standard error.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use design::Progress;
use indicatif::ProgressBar;

use crate::logging;

/// Number of parts of the progress bar.
const PARTS: f64 = 1000.0;
/// Interval at which the progress bar is redrawn, to update the elapsed time.
const REDRAW: Duration = Duration::from_millis(200);
/// Interval between two lines where standard error is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// Shows the steps of a design: on a terminal by a bar, which is removed when the reporter is dropped, elsewhere by a
/// line every 10 s.
pub(super) enum Reporter {
    Bar(ProgressBar),
    Lines(Lines),
}

/// The thread that prints a line every 10 s. The drop of the sender ends the thread.
pub(super) struct Lines {
    /// The step that the next line names; `None` before the first one.
    latest: Arc<Mutex<Option<Progress>>>,
    _end: Sender<()>,
}

impl Reporter {
    pub(super) fn new() -> Self {
        if !std::io::stderr().is_terminal() {
            return Self::Lines(Lines::new());
        }
        let template = "{bar:24} {percent:>3} %, {elapsed}, {eta} left: {msg}";
        let bar = logging::bar(template, logging::position(PARTS));
        bar.enable_steady_tick(REDRAW);
        Self::Bar(bar)
    }

    /// Shows the step that starts; without a bar, the next line names the latest step.
    pub(super) fn show(&self, progress: Progress) {
        match self {
            Self::Bar(bar) => {
                bar.set_position(logging::position(PARTS * progress.done));
                bar.set_message(progress.step);
            }
            Self::Lines(lines) => {
                *lines.latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
            }
        }
    }
}

impl Lines {
    fn new() -> Self {
        let latest = Arc::new(Mutex::new(None::<Progress>));
        let (sender, receiver) = channel::<()>();
        let (start, shown) = (Instant::now(), Arc::clone(&latest));
        let print = move || {
            while receiver.recv_timeout(BETWEEN_LINES) == Err(RecvTimeoutError::Timeout) {
                let latest = *shown.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(Progress { step, done, .. }) = latest {
                    let seconds = start.elapsed().as_secs();
                    eprintln!("{seconds} s, {:.0} %: {step}", (100.0 * done).floor());
                }
            }
        };
        // Without a thread there are no lines; the design does not depend on them.
        let _ = thread::Builder::new().name("progress".to_owned()).spawn(print);
        Self { latest, _end: sender }
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
