//! Log messages on standard error, as text or JSON, drawn above the progress bar.

use std::fmt;
use std::io::{self, Write};
use std::sync::{Mutex, OnceLock, PoisonError};

use fmu_description::number::seconds;
use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};
use report::Message;
use study::LogFields;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt as _};
use tracing_subscriber::registry::LookupSpan;

use crate::output;

/// `target` of the events for messages of FMUs.
pub(crate) const FMU: &str = "fmu";
/// `target` of the events about a results file, of which information is logged without `verbose`, too.
pub(crate) const RESULTS_FILE: &str = "results::output";

/// Starts logging: errors, warnings, and that a results file is replaced; with `verbose` 1, all information; from 2 on,
/// everything. `json` writes each message as a JSON object. Only the first call has an effect.
pub(crate) fn start(verbose: u8, json: bool) {
    let level = match verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        _ => LevelFilter::TRACE,
    };
    let text = tracing_subscriber::fmt::layer().with_writer(|| StandardError);
    let filter =
        Targets::new().with_default(level).with_target(RESULTS_FILE, level.max(LevelFilter::INFO));
    let registry = tracing_subscriber::registry().with(filter).with(Collector);
    // Fails at a second call.
    let _ = if json {
        tracing::subscriber::set_global_default(registry.with(text.json().flatten_event(true)))
    } else {
        tracing::subscriber::set_global_default(registry.with(text.event_format(Sentence)))
    };
}

/// Formats a message and discards it, so that later messages of this thread need no new memory.
pub(crate) fn use_memory_of_thread() {
    let layer = tracing_subscriber::fmt::layer().with_writer(io::sink).event_format(Sentence);
    let nowhere = tracing_subscriber::registry().with(layer);
    tracing::subscriber::with_default(nowhere, || tracing::error!("nothing"));
}

/// Largest number of messages that are kept; further messages are only counted.
const LARGEST_KEPT: usize = 1000;

/// Warnings and errors.
#[derive(Clone, Default)]
struct Collection {
    /// The first [`LARGEST_KEPT`] messages.
    messages: Vec<Message>,
    /// Number of all warnings and errors.
    count: usize,
}

/// The warnings and errors since [`collect`]; `None` before.
static COLLECTION: Mutex<Option<Collection>> = Mutex::new(None);

/// Keeps warnings and errors from now on.
pub(crate) fn collect() {
    *COLLECTION.lock().unwrap_or_else(PoisonError::into_inner) = Some(Collection::default());
}

/// Returns the first [`LARGEST_KEPT`] warnings and errors since [`collect`], and a line with the number of further
/// messages; nothing without a call of `collect`.
pub(crate) fn collected() -> Vec<Message> {
    let collection = COLLECTION.lock().unwrap_or_else(PoisonError::into_inner);
    let Collection { mut messages, count } = collection.clone().unwrap_or_default();
    if count > messages.len() {
        let text = format!("and {} more", count - messages.len());
        messages.push(Message { time: None, text });
    }
    messages
}

/// The channel of messages to the live view, if there is one.
static FORWARDED: OnceLock<live::Messages> = OnceLock::new();

/// Passes errors, warnings and information that are logged to a live view from now on.
pub(crate) fn forward(messages: live::Messages) {
    // There is one run in a process, and one view of it: this is called once.
    let _ = FORWARDED.set(messages);
}

/// Keeps warnings and errors for a report after [`collect`], and passes messages to a live view after [`forward`].
struct Collector;

impl<S: Subscriber> Layer<S> for Collector {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if let Some(messages) = FORWARDED.get().filter(|_| *event.metadata().level() <= Level::INFO)
        {
            let is_of_fmu = event.metadata().target() == FMU;
            let instance = if is_of_fmu { fields(event).instance } else { String::new() };
            messages.send(&instance, sentence(event));
        }
        if *event.metadata().level() > Level::WARN {
            return;
        }
        let mut collection = COLLECTION.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Collection { messages, count }) = collection.as_mut() {
            *count += 1;
            if messages.len() < LARGEST_KEPT {
                messages.push(Message { time: fields(event).time, text: sentence(event) });
            }
        }
    }
}

/// Returns the display of progress bars.
fn bars() -> &'static MultiProgress {
    static BARS: OnceLock<MultiProgress> = OnceLock::new();
    BARS.get_or_init(MultiProgress::new)
}

/// Adds a progress bar of this length to the display.
pub(crate) fn bar(template: &str, length: u64) -> ProgressBar {
    let style = ProgressStyle::with_template(template);
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
    bars().add(ProgressBar::new(length).with_style(style.with_key("percent", percent)))
}

/// Rounds a value down to a position on a bar; 0 for a negative value.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a display")]
pub(crate) fn position(value: f64) -> u64 {
    value as u64
}

/// Writes the percentage that is done, rounded down so that 100 % appears only at the end.
fn percent(state: &ProgressState, text: &mut dyn fmt::Write) {
    let percent = 100 * state.pos() / state.len().unwrap_or(1).max(1);
    // Writing to a text does not fail.
    let _ = write!(text, "{percent}");
}

/// A writer to standard error that hides progress bars during a write.
struct StandardError;

impl Write for StandardError {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        bars().suspend(|| output::error(format_args!("{}", String::from_utf8_lossy(bytes))));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Formats a message as text: `warning: ...`, or for an FMU `warning: plant, t = 0.5 s, logStatusWarning: ...`.
struct Sentence;

impl<S, N> FormatEvent<S, N> for Sentence
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        _: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        writeln!(writer, "{}", sentence(event))
    }
}

/// Returns the fields of a message.
pub(crate) fn fields(event: &Event<'_>) -> LogFields {
    let mut fields = LogFields::default();
    event.record(&mut fields);
    fields
}

fn sentence(event: &Event<'_>) -> String {
    let metadata = event.metadata();
    let word = match *metadata.level() {
        Level::ERROR => "error",
        Level::WARN => "warning",
        Level::INFO => "info",
        Level::DEBUG => "debug",
        Level::TRACE => "trace",
    };
    let LogFields { message, instance, category, time, others, .. } = fields(event);
    if metadata.target() != FMU {
        return format!("{word}: {message}{others}");
    }
    let time = time.map_or_else(String::new, |time| format!(", t = {} s", seconds(time)));
    let category =
        if category.is_empty() { String::new() } else { format!(", {}", plain(&category)) };
    format!("{word}: {}{time}{category}: {}{others}", plain(&instance), plain(&message))
}

/// Replaces control characters in a text of an FMU by spaces, so that the text is a single line and cannot move the
/// cursor of a terminal.
fn plain(text: &str) -> String {
    let text = text.trim_end();
    text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}
