//! Counts the messages of an FMU during a trial.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use tracing::{Event, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt as _};

use crate::logging::{FMU, fields};

/// Summary of the messages.
#[derive(Default)]
pub(super) struct MessageSummary {
    /// The log categories of the messages; empty for messages without one.
    pub(super) categories: BTreeSet<String>,
    /// Number of messages, including messages that were lost because there were too many.
    pub(super) messages: u64,
}

/// A layer of `tracing` that records the messages.
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

impl<S: Subscriber> Layer<S> for MessageRecorder {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if event.metadata().target() != FMU {
            return;
        }
        let fields = fields(event);
        if let Ok(mut summary) = self.messages.lock() {
            summary.messages = summary.messages.saturating_add(fields.lost.unwrap_or(1));
            summary.categories.insert(fields.category);
        }
    }
}
