//! The work between the steps of a run: signals, limits, progress, messages.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::logging;

/// Interval at which a run looks for signals, in wall-clock time.
const INTERVAL: Duration = Duration::from_millis(20);
/// Number of steps between two readings of the clock while these steps take less than [`SHORT`]; otherwise the clock is
/// read after each step.
const STRIDE: u32 = 8;
const SHORT: Duration = Duration::from_millis(1);
/// Number of updates of the progress bar during a run.
const PARTS: u64 = 400;

/// A request to end a run, which any thread may make.
#[pyclass(frozen, module = "aso_ftc._core")]
#[derive(Default)]
pub(crate) struct Cancel {
    pub(crate) flag: Arc<AtomicBool>,
}

#[pymethods]
impl Cancel {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Ends the runs that were given this object, each after its present step.
    fn cancel(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    /// Whether the end was requested.
    #[getter]
    fn cancelled(&self) -> bool {
        self.flag.load(Ordering::Relaxed)
    }
}

/// Why a run was ended from outside.
pub(crate) enum Stop {
    /// The exception of a signal or of a callback.
    Raised(PyErr),
    /// The time limit in s.
    TimeLimit(f64),
    /// [`Cancel`].
    Cancelled,
}

/// The form in which a run reports its progress.
pub(crate) enum Progress {
    None,
    Bar(ProgressBar),
    Callback(Py<PyAny>),
}

impl Progress {
    /// `True`: a bar on standard error; a function: called with the fraction done; `None` and `False`: no progress.
    pub(crate) fn new(requested: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(requested) = requested else { return Ok(Self::None) };
        if requested.is_callable() {
            return Ok(Self::Callback(requested.clone().unbind()));
        }
        if !requested.is_truthy()? {
            return Ok(Self::None);
        }
        let style = ProgressStyle::with_template("{bar:40} {percent} % {eta}");
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
        // The bar is hidden where standard error is not a terminal.
        Ok(Self::Bar(ProgressBar::new(PARTS).with_style(style)))
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a display")]
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    fn show(&self, py: Python<'_>, fraction: f64) -> PyResult<()> {
        match self {
            Self::None => Ok(()),
            Self::Bar(bar) => {
                bar.set_position((fraction * PARTS as f64) as u64);
                Ok(())
            }
            Self::Callback(function) => function.call1(py, (fraction,)).map(|_| ()),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

/// Checks signals, limits and cancellation between the steps of a run; reports progress and messages.
pub(crate) struct Watch {
    /// Start and stop time of the run in s, for the progress.
    pub(crate) span: (f64, f64),
    /// End of the time limit, and the limit in s.
    deadline: Option<(Instant, f64)>,
    cancel: Option<Arc<AtomicBool>>,
    progress: Progress,
    /// Whether Python handles signals in this thread.
    is_main: bool,
    /// Number of remaining steps until the next reading of the clock.
    left: u32,
    /// Number of steps between two readings of the clock; 0 before the first reading.
    stride: u32,
    last_reading: Instant,
    /// Time of the last call of [`Watch::look`].
    last_look: Instant,
    /// Reason why the run is to end; `None` while the run goes on.
    pub(crate) stop: Option<Stop>,
}

impl Watch {
    /// Prepares for a run in the present thread, with a limit of wall-clock time in s. `ValueError` for a limit that is
    /// negative or NaN.
    pub(crate) fn new(
        py: Python<'_>,
        limit: Option<f64>,
        cancel: Option<Arc<AtomicBool>>,
        progress: Progress,
    ) -> PyResult<Self> {
        if limit.is_some_and(|limit| limit.is_nan() || limit < 0.0) {
            let what = "time_limit: expected a number of seconds, at least 0";
            return Err(PyValueError::new_err(what));
        }
        let now = Instant::now();
        let deadline = limit.map(|limit| {
            let after = Duration::try_from_secs_f64(limit).ok();
            (after.and_then(|after| now.checked_add(after)), limit)
        });
        Ok(Self {
            span: (0.0, 0.0),
            deadline: deadline.and_then(|(end, limit)| Some((end?, limit))),
            cancel,
            progress,
            is_main: is_main(py)?,
            left: 1,
            stride: 0,
            last_reading: now,
            last_look: now,
            stop: None,
        })
    }

    /// Checks limits and signals; call this after every step, with the time reached in s; a call before the first step
    /// is possible. Breaks and sets `stop` if the run should end.
    #[inline]
    pub(crate) fn after_step(&mut self, time: f64) -> ControlFlow<()> {
        self.left -= 1;
        if self.left > 0 {
            return ControlFlow::Continue(());
        }
        self.read_clock(time)
    }

    #[cold]
    fn read_clock(&mut self, time: f64) -> ControlFlow<()> {
        let now = Instant::now();
        // No step has been timed before the first reading.
        let is_short = self.stride > 0 && now - self.last_reading < SHORT;
        self.stride = if is_short { STRIDE } else { 1 };
        (self.last_reading, self.left) = (now, self.stride);
        if self.cancel.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            self.stop = Some(Stop::Cancelled);
        } else if let Some((_, limit)) = self.deadline.filter(|(end, _)| now >= *end) {
            self.stop = Some(Stop::TimeLimit(limit));
        } else if now - self.last_look >= INTERVAL {
            self.last_look = now;
            self.look(time);
        }
        if self.stop.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Reports the run as done. Sets `stop` to an exception of a signal or of the progress function, if there is one.
    pub(crate) fn finish(&mut self, py: Python<'_>) {
        let finished = py.check_signals().and_then(|()| self.progress.show(py, 1.0));
        self.stop = finished.err().map(Stop::Raised);
    }

    /// Checks signals, passes on messages and reports the progress. Does nothing outside of Python's main thread unless
    /// progress is requested. An exception sets `stop`.
    fn look(&mut self, time: f64) {
        if !self.is_main && matches!(self.progress, Progress::None) {
            return;
        }
        let (start, stop) = self.span;
        let fraction = if stop > start { ((time - start) / (stop - start)).min(1.0) } else { 0.0 };
        let result = Python::attach(|py| {
            py.check_signals()?;
            logging::pass_on(py)?;
            self.progress.show(py, fraction)
        });
        if let Err(error) = result {
            self.stop = Some(Stop::Raised(error));
        }
    }
}

/// Whether the present thread is Python's main thread, the only one that handles signals.
fn is_main(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let thread = threading.call_method0("get_ident")?;
    thread.eq(threading.call_method0("main_thread")?.getattr("ident")?)
}
