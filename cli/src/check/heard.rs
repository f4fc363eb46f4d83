//! The messages of an FMU while it is tried.

use std::collections::BTreeSet;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

/// Where the master sends the messages of FMUs.
const TARGET: &str = "fmu";

/// Hears the log categories that are used.
#[derive(Clone, Default)]
pub(super) struct Heard {
    categories: Arc<Mutex<BTreeSet<String>>>,
}

impl Heard {
    /// Runs `body` and gives the categories of all messages that came.
    pub(super) fn during<T>(body: impl FnOnce() -> T) -> (T, BTreeSet<String>) {
        let heard = Self::default();
        let result = tracing::subscriber::with_default(heard.clone(), body);
        let categories = heard.categories.lock().map(|mut own| std::mem::take(&mut *own));
        (result, categories.unwrap_or_default())
    }
}

/// Takes the field `category` of an event.
struct Category(Option<String>);

impl Visit for Category {
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

impl Subscriber for Heard {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == TARGET
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut category = Category(None);
        event.record(&mut category);
        if let (Some(name), Ok(mut all)) = (category.0, self.categories.lock()) {
            all.insert(name);
        }
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}
