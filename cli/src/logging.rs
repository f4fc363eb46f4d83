//! Log messages on standard error, as text or JSON, drawn above the progress bar.

use std::fmt;
use std::io::{self, Write};
use std::sync::OnceLock;

use indicatif::MultiProgress;
use study::LogFields;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::registry::LookupSpan;

/// `target` of the events for messages of FMUs.
const FMU: &str = "fmu";

/// Starts logging: warnings; with `verbose` 1, information; with 2, everything.
pub(crate) fn start(verbose: u8, json: bool) {
    let level = match verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        _ => LevelFilter::TRACE,
    };
    let builder = tracing_subscriber::fmt().with_max_level(level).with_writer(StandardError);
    // A second call keeps the existing subscriber.
    let _ = if json {
        tracing::subscriber::set_global_default(builder.json().flatten_event(true).finish())
    } else {
        tracing::subscriber::set_global_default(builder.event_format(Sentence).finish())
    };
}

/// Returns the display of progress bars.
pub(crate) fn bars() -> &'static MultiProgress {
    static BARS: OnceLock<MultiProgress> = OnceLock::new();
    BARS.get_or_init(MultiProgress::new)
}

/// A writer to standard error that hides the progress bar while it writes.
struct StandardError;

impl Write for StandardError {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // If standard error is closed, nobody can read the message.
        let _ = bars().suspend(|| io::stderr().write_all(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

impl MakeWriter<'_> for StandardError {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        Self
    }
}

/// Formats a message as text: `warning: plant, t = 0.5 s, logStatusWarning: ...`.
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
        let metadata = event.metadata();
        let mut parts = LogFields::default();
        event.record(&mut parts);
        let word = match *metadata.level() {
            Level::ERROR => "error",
            Level::WARN => "warning",
            Level::INFO => "info",
            Level::DEBUG => "debug",
            Level::TRACE => "trace",
        };
        if metadata.target() != FMU {
            return writeln!(writer, "{word}: {}{}", parts.message, parts.others);
        }
        let LogFields { message, instance, category, time, others } = parts;
        write!(writer, "{word}: {}", plain(&instance))?;
        if let Some(time) = time {
            write!(writer, ", t = {time} s")?;
        }
        if !category.is_empty() {
            write!(writer, ", {}", plain(&category))?;
        }
        writeln!(writer, ": {}{others}", plain(&message))
    }
}

/// Makes a message of an FMU a single line without control characters, so that it cannot move the
/// cursor of a terminal.
fn plain(text: &str) -> String {
    let text = text.trim_end();
    text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}
