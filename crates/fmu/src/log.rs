//! The messages of a model.

use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The largest number of messages of one call; further messages are dropped and counted.
const LIMIT: usize = 1000;

/// The messages of a model to the importer's logger.
///
/// A model that logs has a field of this type, and [`Model::log`](crate::Model::log) returns it (`#[fmu::model]` does
/// so). After each call the exporter sends the messages and empties the field. The field is therefore not part of the
/// FMU state: its serialised form is empty. A message that is repeated within a call is sent once; messages beyond 1000
/// in one call are only counted.
///
/// [`Model::update`](crate::Model::update) also runs at states that an integrator only tries; messages about
/// what has happened belong to the other functions.
///
/// ```
/// use fmu::Log;
///
/// let mut log = Log::default();
/// log.info("logEvents", "the valve opens at t = 3 s");
/// log.warn("the pressure 2.1 bar is above the range of the table, 2 bar");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Log {
    messages: Vec<Message>,
    /// Number of messages dropped because of [`LIMIT`].
    dropped: usize,
}

/// One message of a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    /// The log category; `None` for a warning.
    pub(crate) category: Option<&'static str>,
    pub(crate) text: String,
}

impl Log {
    /// Logs a message of a `category`, one of [`Model::LOG_CATEGORIES`](crate::Model::LOG_CATEGORIES) or `logEvents`.
    /// The importer receives the message if debug logging is on for the category.
    pub fn info(&mut self, category: &'static str, text: impl Into<String>) {
        self.add(Some(category), text.into());
    }

    /// Logs a warning. The call that is in progress then returns `fmi2Warning` if it succeeds.
    pub fn warn(&mut self, text: impl Into<String>) {
        self.add(None, text.into());
    }

    /// Adds a message, unless the log already has an equal message.
    fn add(&mut self, category: Option<&'static str>, text: String) {
        let message = Message { category, text };
        if self.messages.contains(&message) {
            return;
        }
        if self.messages.len() < LIMIT {
            self.messages.push(message);
        } else {
            self.dropped += 1;
        }
    }

    /// Whether there are no messages.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// The texts of the messages that were not sent yet, for tests of a model.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.messages.iter().map(|message| message.text.as_str())
    }

    /// Removes and returns all messages, with a warning that states how many were dropped.
    pub(crate) fn take(&mut self) -> Vec<Message> {
        let mut messages = std::mem::take(&mut self.messages);
        let dropped = std::mem::take(&mut self.dropped);
        if dropped > 0 {
            let text = format!("the model logged {dropped} more messages in this call");
            messages.push(Message { category: None, text });
        }
        messages
    }
}

impl Serialize for Log {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_unit()
    }
}

impl<'de> Deserialize<'de> for Log {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_unit(IgnoredAny).map(|_| Self::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_has_no_serialised_form() {
        let mut log = Log::default();
        log.warn("hot");
        let bytes = postcard::to_stdvec(&(1_u8, &log, 2_u8)).unwrap();
        assert_eq!(bytes, [1, 2]);
        assert_eq!(postcard::from_bytes(&bytes), Ok((1_u8, Log::default(), 2_u8)));
    }

    #[test]
    fn messages_above_the_limit_are_counted() {
        let mut log = Log::default();
        for k in 0..LIMIT + 7 {
            log.info("logEvents", format!("sample {k}"));
            log.info("logEvents", "sample 0");
        }
        let messages = log.take();
        assert_eq!(messages.len(), LIMIT + 1);
        assert!(messages[LIMIT].text.contains("7 more"));
        assert!(log.is_empty());
    }
}
