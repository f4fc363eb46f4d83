//! Counts the messages of an FMU during a trial.

use std::collections::BTreeSet;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};

use tracing::field::{Field, Visit};
use tracing::{Event, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt as _};

/// `target` of the events for messages of FMUs.
const TARGET: &str = "fmu";

/// Summary of the messages.
#[derive(Default)]
pub(super) struct MessageSummary {
    /// The log categories of the messages.
    pub(super) categories: BTreeSet<String>,
    /// Number of messages, including those that were lost because they came too fast.
    pub(super) messages: u64,
}

/// A layer that records the messages.
#[derive(Clone, Default)]
pub(super) struct MessageRecorder {
    messages: Arc<Mutex<MessageSummary>>,
}

impl MessageRecorder {
    /// Runs `body`; returns its result and the summary of the messages that this thread logs meanwhile.
    pub(super) fn during<T>(body: impl FnOnce() -> T) -> (T, MessageSummary) {
        let recorder = Self::default();
        let subscriber = tracing_subscriber::registry().with(recorder.clone());
        let result = tracing::subscriber::with_default(subscriber, body);
        let messages = recorder.messages.lock().map(|mut messages| std::mem::take(&mut *messages));
        (result, messages.unwrap_or_default())
    }
}

/// A visitor that reads what an event says about messages.
struct EventFields {
    /// The field `category`.
    category: Option<String>,
    /// Number of messages that the event represents: the field `lost`, or 1.
    count: u64,
}

impl Visit for EventFields {
    fn record_u64(&mut self, field: &Field, value: u64) {
        if field.name() == "lost" {
            self.count = value;
        }
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        if field.name() == "category" {
            self.category = Some(value.to_owned());
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "category" {
            self.category = Some(format!("{value:?}").trim_matches('"').to_owned());
        }
    }
}

impl<S: Subscriber> Layer<S> for MessageRecorder {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if event.metadata().target() != TARGET {
            return;
        }
        let mut fields = EventFields { category: None, count: 1 };
        event.record(&mut fields);
        if let Ok(mut summary) = self.messages.lock() {
            summary.messages = summary.messages.saturating_add(fields.count);
            summary.categories.extend(fields.category);
        }
    }
}
