//! What happens beside the steps of a run: signals, limits, progress, messages.

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
/// A look at the clock every few steps, as long as these steps are short.
const STRIDE: u32 = 8;
const SHORT: Duration = Duration::from_millis(1);
/// Parts of the progress bar.
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

    /// Ends the runs that have this object, each after its present step.
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
    /// An exception: a signal, or one of a callback.
    Raised(PyErr),
    /// The time limit in s.
    TimeLimit(f64),
    /// [`Cancel`].
    Cancelled,
}

/// What a run reports while it goes on.
pub(crate) enum Progress {
    None,
    Bar(ProgressBar),
    Callback(Py<PyAny>),
}

impl Progress {
    /// `True` is a bar on standard error, a function receives the fraction.
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

/// Looks beside the steps of a run.
pub(crate) struct Watch {
    /// Start and stop time of the run in s.
    pub(crate) span: (f64, f64),
    deadline: Option<(Instant, f64)>,
    cancel: Option<Arc<AtomicBool>>,
    progress: Progress,
    /// Whether Python handles signals in this thread.
    main: bool,
    left: u32,
    stride: u32,
    clock: Instant,
    looked: Instant,
    pub(crate) stop: Option<Stop>,
}

impl Watch {
    /// Prepares for a run in the present thread, with a limit of wall-clock time in s.
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
            main: is_main(py)?,
            left: 1,
            stride: 0,
            clock: now,
            looked: now,
            stop: None,
        })
    }

    /// Called after every step, at the time reached in s.
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
        // The first call is at the start, before any step.
        let is_short = self.stride > 0 && now - self.clock < SHORT;
        self.stride = if is_short { STRIDE } else { 1 };
        (self.clock, self.left) = (now, self.stride);
        if self.cancel.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            self.stop = Some(Stop::Cancelled);
        } else if let Some((_, limit)) = self.deadline.filter(|(end, _)| now >= *end) {
            self.stop = Some(Stop::TimeLimit(limit));
        } else if now - self.looked >= INTERVAL {
            self.looked = now;
            self.look(time);
        }
        if self.stop.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Reports the end of the run, and takes the exception of a signal that has arrived meanwhile.
    pub(crate) fn finish(&mut self, py: Python<'_>) {
        let finished = py.check_signals().and_then(|()| self.progress.show(py, 1.0));
        self.stop = finished.err().map(Stop::Raised);
    }

    fn look(&mut self, time: f64) {
        if !self.main && matches!(self.progress, Progress::None) {
            return;
        }
        let (start, stop) = self.span;
        let fraction = if stop > start { ((time - start) / (stop - start)).min(1.0) } else { 0.0 };
        let looked = Python::attach(|py| {
            py.check_signals()?;
            logging::pass_on(py)?;
            self.progress.show(py, fraction)
        });
        if let Err(error) = looked {
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
