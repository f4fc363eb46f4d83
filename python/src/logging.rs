//! Messages of the libraries and of FMUs for Python's `logging`.
//!
//! A message may arise in any thread, without the interpreter. So messages wait in a list until a thread
//! that is attached to the interpreter passes them on: at the end of each call, and during a run each
//! time that it looks for signals.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use fmu_description::number::seconds;
use pyo3::prelude::*;
use study::LogFields;
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::Interest;
use tracing::{Event, Level, Metadata, Subscriber};

/// `target` of the messages of FMUs.
const FMU: &str = "fmu";
/// Most messages that wait at the same time; further ones are counted only.
const WAITING: usize = 10_000;

static MESSAGES: Mutex<Vec<Message>> = Mutex::new(Vec::new());
static LOST: AtomicU64 = AtomicU64::new(0);
/// The lowest level of `logging` that is passed on.
static LEAST: AtomicU8 = AtomicU8::new(30);

/// A message: level of `logging`, whether it is from an FMU, text.
struct Message {
    level: u8,
    from_fmu: bool,
    text: String,
}

/// Starts to collect messages.
pub(crate) fn start() {
    // Fails only if the module is initialised twice.
    let _ = tracing::subscriber::set_global_default(Collector);
}

/// Reads from Python's `logging` which levels are passed on.
pub(crate) fn adopt_level(py: Python<'_>) {
    let level = || -> PyResult<u8> {
        let logger = py.import("logging")?.call_method1("getLogger", ("aso_ftc",))?;
        Ok(logger.call_method0("getEffectiveLevel")?.extract::<u32>()?.min(255) as u8)
    };
    if let Ok(level) = level() {
        LEAST.store(level, Ordering::Relaxed);
    }
}

/// Passes the messages so far to Python's `logging`.
///
/// # Errors
///
/// The exception of a handler.
pub(crate) fn pass_on(py: Python<'_>) -> PyResult<()> {
    let messages = {
        let mut waiting = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *waiting)
    };
    let lost = LOST.swap(0, Ordering::Relaxed);
    if messages.is_empty() {
        return Ok(());
    }
    let logging = py.import("logging")?;
    let package = logging.call_method1("getLogger", ("aso_ftc",))?;
    let fmu = logging.call_method1("getLogger", ("aso_ftc.fmu",))?;
    for message in messages {
        let logger = if message.from_fmu { &fmu } else { &package };
        logger.call_method1("log", (message.level, "%s", message.text))?;
    }
    if lost > 0 {
        package.call_method1("warning", ("%s further messages were dropped", lost))?;
    }
    Ok(())
}

/// Collects the messages of all threads.
struct Collector;

impl Subscriber for Collector {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        // Python may change the level at any time.
        Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        level(*metadata.level()) >= LEAST.load(Ordering::Relaxed)
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
        let from_fmu = metadata.target() == FMU;
        let text = if from_fmu { of_fmu(fields) } else { fields.message + &fields.others };
        let mut messages = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() < WAITING {
            messages.push(Message { level: level(*metadata.level()), from_fmu, text });
        } else {
            LOST.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// Returns the level of `logging`.
fn level(level: Level) -> u8 {
    match level {
        Level::ERROR => 40,
        Level::WARN => 30,
        Level::INFO => 20,
        Level::DEBUG => 10,
        Level::TRACE => 5,
    }
}

/// Returns the message of an FMU with its name, time and category.
fn of_fmu(fields: LogFields) -> String {
    let LogFields { message, instance, category, time, others } = fields;
    let time = time.map(|time| format!(", t = {} s", seconds(time))).unwrap_or_default();
    let category = if category.is_empty() { category } else { format!(", {category}") };
    format!("{instance}{time}{category}: {}{others}", message.trim_end())
}
