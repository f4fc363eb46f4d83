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
    /// The log categories used.
    pub(super) categories: BTreeSet<String>,
    /// Number of messages, including those that arrived too fast to be kept.
    pub(super) messages: u64,
}

/// A layer that records the messages.
#[derive(Clone, Default)]
pub(super) struct MessageRecorder {
    messages: Arc<Mutex<MessageSummary>>,
}

impl MessageRecorder {
    /// Runs `body`; returns its result and the summary of the messages during the call.
    pub(super) fn during<T>(body: impl FnOnce() -> T) -> (T, MessageSummary) {
        let heard = Self::default();
        let subscriber = tracing_subscriber::registry().with(heard.clone());
        let result = tracing::subscriber::with_default(subscriber, body);
        let messages = heard.messages.lock().map(|mut messages| std::mem::take(&mut *messages));
        (result, messages.unwrap_or_default())
    }
}

/// A visitor that reads the field `category` of an event, and the number of messages that the event
/// represents.
struct Category(Option<String>, u64);

impl Visit for Category {
    fn record_u64(&mut self, field: &Field, value: u64) {
        if field.name() == "lost" {
            self.1 = value;
        }
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        if field.name() == "category" {
            self.0 = Some(value.to_owned());
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "category" {
            self.0 = Some(format!("{value:?}").trim_matches('"').to_owned());
        }
    }
}

impl<S: Subscriber> Layer<S> for MessageRecorder {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if event.metadata().target() != TARGET {
            return;
        }
        let mut category = Category(None, 1);
        event.record(&mut category);
        if let Ok(mut messages) = self.messages.lock() {
            messages.messages = messages.messages.saturating_add(category.1);
            messages.categories.extend(category.0);
        }
    }
}
