//! The messages of an FMU while it is tried.

use std::collections::BTreeSet;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

/// Where the master sends the messages of FMUs.
const TARGET: &str = "fmu";

/// What was heard.
#[derive(Default)]
pub(super) struct MessageSummary {
    /// The log categories that are used.
    pub(super) categories: BTreeSet<String>,
    /// Messages, also those that came too fast to be kept.
    pub(super) messages: u64,
}

/// Hears the messages.
#[derive(Clone, Default)]
pub(super) struct MessageRecorder {
    messages: Arc<Mutex<MessageSummary>>,
}

impl MessageRecorder {
    /// Runs `body` and gives what came meanwhile.
    pub(super) fn during<T>(body: impl FnOnce() -> T) -> (T, MessageSummary) {
        let heard = Self::default();
        let result = tracing::subscriber::with_default(heard.clone(), body);
        let messages = heard.messages.lock().map(|mut own| std::mem::take(&mut *own));
        (result, messages.unwrap_or_default())
    }
}

/// Takes the field `category` of an event, and the number of messages that it stands for.
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

impl Subscriber for MessageRecorder {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == TARGET
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut category = Category(None, 1);
        event.record(&mut category);
        if let Ok(mut messages) = self.messages.lock() {
            messages.messages = messages.messages.saturating_add(category.1);
            messages.categories.extend(category.0);
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}
