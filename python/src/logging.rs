//! Messages of the libraries and of FMUs for Python's `logging`.
//!
//! The module `aso_ftc._logging` names the loggers. A thread that is not attached to the interpreter may also log, so
//! messages wait in a list until an attached thread passes them on: at the end of each call from Python, and during a
//! run at each check for signals.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use study::LogFields;
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::Interest;
use tracing::{Event, Level, Metadata, Subscriber};

/// The module that names the loggers.
const MODULE: &str = "aso_ftc._logging";
/// `target` of the messages of FMUs.
const FMU: &str = "fmu";
/// Largest number of messages that wait at the same time; further messages are only counted.
const WAITING: usize = 10_000;

/// Messages that wait for a thread that can pass them on to Python.
static MESSAGES: Mutex<Vec<Message>> = Mutex::new(Vec::new());
/// Number of messages that were dropped.
static LOST: AtomicU64 = AtomicU64::new(0);
/// The lowest level of `logging` that is passed on, at first 30 (`WARNING`).
static LEAST: AtomicU8 = AtomicU8::new(30);

/// A message: level of `logging`, name of the FMU that sent it, simulated time in s, category, text.
struct Message {
    level: u8,
    fmu: Option<String>,
    time: Option<f64>,
    category: String,
    text: String,
}

thread_local! {
    /// Whether messages of this thread are dropped.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Calls `work`; if `quiet`, drops the messages of this thread meanwhile.
pub(crate) fn quietly<T>(quiet: bool, work: impl FnOnce() -> T) -> T {
    let before = QUIET.replace(quiet);
    let result = catch_unwind(AssertUnwindSafe(work));
    QUIET.set(before);
    result.unwrap_or_else(|panic| resume_unwind(panic))
}

/// Starts to collect messages.
pub(crate) fn start() {
    // Fails only if the module is initialised twice.
    let _ = tracing::subscriber::set_global_default(Collector);
}

/// Reads from Python's `logging` the lowest level that is passed on; keeps the present level if this fails.
pub(crate) fn adopt_level(py: Python<'_>) {
    let level = || py.import(MODULE)?.call_method0("level")?.extract::<u32>();
    if let Ok(level) = level() {
        LEAST.store(level.min(255) as u8, Ordering::Relaxed);
    }
}

/// Whether a logger passes on the debugging messages of FMUs.
pub(crate) fn is_debugging() -> bool {
    LEAST.load(Ordering::Relaxed) <= level(Level::DEBUG)
}

/// Passes the messages so far to Python's `logging`.
///
/// # Errors
///
/// The exception of a logging handler; messages after the message that caused the exception are dropped.
pub(crate) fn pass_on(py: Python<'_>) -> PyResult<()> {
    let messages = {
        let mut waiting = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *waiting)
    };
    let lost = LOST.swap(0, Ordering::Relaxed);
    if messages.is_empty() {
        return Ok(());
    }
    let emit = py.import(MODULE)?.getattr("emit")?;
    for Message { level, fmu, time, category, text } in messages {
        emit.call1((level, text, fmu, time, category))?;
    }
    if lost > 0 {
        emit.call1((level(Level::WARN), format!("{lost} further messages were dropped")))?;
    }
    Ok(())
}

/// Collects the messages of all threads.
struct Collector;

impl Subscriber for Collector {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        // Not cached: Python may change the level at any time.
        Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        !QUIET.get() && level(*metadata.level()) >= LEAST.load(Ordering::Relaxed)
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let metadata = event.metadata();
        let mut fields = LogFields::default();
        event.record(&mut fields);
        let LogFields { message, instance, category, time, others, .. } = fields;
        let fmu = (metadata.target() == FMU).then_some(instance);
        let text = message.trim_end().to_owned() + &others;
        let level = level(*metadata.level());
        let mut messages = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() < WAITING {
            messages.push(Message { level, fmu, time, category, text });
        } else {
            LOST.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// Returns the number of a level in Python's `logging`.
fn level(level: Level) -> u8 {
    match level {
        Level::ERROR => 40,
        Level::WARN => 30,
        Level::INFO => 20,
        Level::DEBUG => 10,
        Level::TRACE => 5,
    }
}
