//! Passes the messages of an FMU to the master through a ring buffer in shared memory, which survives a crash of the
//! worker. Messages that do not fit are dropped and counted. A message starts with a word for its number of bytes.

use std::collections::VecDeque;
use std::fmt::{self, Write as _};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

use super::layout::Shared;
use super::message::decode;
use super::words::words_of;
use crate::library::log_message;
use slave::CallError;

/// The `target` of `tracing` events that carry messages of an FMU.
const TARGET: &str = "fmu";
/// Maximum number of bytes of the category of a message; further bytes are cut off.
const CATEGORY: usize = 256;
/// Maximum number of bytes of the text of a message; further bytes are cut off.
const TEXT: usize = 4096;
/// Maximum number of recent messages that are kept to explain an error.
const KEPT: usize = 10;
/// Maximum number of messages logged in one [`WINDOW`].
const MESSAGES: u32 = 1000;
/// Maximum number of bytes of all messages that are logged for an instance.
const BYTES: usize = 16 << 20;
/// Interval in which at most [`MESSAGES`] are logged; also the interval of reports of the number of lost messages.
const WINDOW: Duration = Duration::from_secs(1);
/// Maximum number of bytes of a message: category, text, and their lengths, level and time.
const MESSAGE: usize = CATEGORY + TEXT + 32;
/// The levels; a message holds the index into this list.
const LEVELS: [Level; 5] = [Level::ERROR, Level::WARN, Level::INFO, Level::DEBUG, Level::TRACE];

/// Sends the [`tracing`] events with messages of the FMU from the worker to the master.
pub(super) struct Forward {
    shared: Arc<Shared>,
    /// Number of words written to the message ring.
    head: Mutex<u64>,
}

impl Forward {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        Self { shared, head: Mutex::new(0) }
    }

    /// Writes a message to the ring, or counts it as dropped.
    fn send(&self, level: Level, message: &Message) {
        let Ok(mut head) = self.head.lock() else { return };
        let ring = self.shared.ring();
        let sent = RingMessage {
            level: LEVELS.iter().position(|known| *known == level).unwrap_or(0),
            time: message.time,
            category: clip(&message.category, CATEGORY),
            text: clip(&message.text, TEXT),
        };
        let mut buffer = [0; MESSAGE];
        let Ok(bytes) = postcard::to_slice(&sent, &mut buffer) else { return };
        let used = head.wrapping_sub(self.shared.log_tail().load(Ordering::Acquire));
        let free = usize::try_from(used).ok().and_then(|used| ring.len().checked_sub(used));
        if free.is_none_or(|free| free <= bytes.len().div_ceil(8)) {
            self.shared.log_dropped().fetch_add(1, Ordering::Relaxed);
            return;
        }
        for word in std::iter::once(bytes.len() as u64).chain(words_of(bytes)) {
            at(ring, *head).store(word, Ordering::Relaxed);
            *head = head.wrapping_add(1);
        }
        self.shared.log_head().store(*head, Ordering::Release);
    }
}

/// A message in the ring. Its texts may be cut within a character.
#[derive(Serialize, Deserialize)]
struct RingMessage<'a> {
    level: usize,
    time: f64,
    category: &'a [u8],
    text: &'a [u8],
}

/// Returns the word of the ring for the running word number `count`.
#[expect(clippy::cast_possible_truncation, reason = "the remainder is below the length")]
fn at(ring: &[AtomicU64], count: u64) -> &AtomicU64 {
    &ring[(count % ring.len() as u64) as usize]
}

/// Returns the first `length` bytes of a text, which may end within a character.
fn clip(text: &str, length: usize) -> &[u8] {
    &text.as_bytes()[..text.len().min(length)]
}

impl Subscriber for Forward {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_event() && metadata.target() == TARGET
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut message = Message::default();
        event.record(&mut message);
        self.send(*event.metadata().level(), &message);
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// A message of an FMU.
#[derive(Debug, Default, PartialEq)]
struct Message {
    category: String,
    time: f64,
    text: String,
}

impl Visit for Message {
    fn record_f64(&mut self, field: &Field, value: f64) {
        if field.name() == "time" {
            self.time = value;
        }
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "category" => value.clone_into(&mut self.category),
            "message" => value.clone_into(&mut self.text),
            _ => {}
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            // Writing to a String does not fail.
            let _ = write!(self.text, "{value:?}");
        }
    }
}

/// Limits the number of messages of an FMU that are logged in a [`WINDOW`], and the number of their bytes in total.
struct Quota {
    /// Start of the present window.
    since: Instant,
    /// Number of messages logged in the present window.
    messages: u32,
    /// Number of bytes logged in total.
    bytes: usize,
    /// Number of lost messages that have not been reported.
    lost: u64,
}

impl Default for Quota {
    fn default() -> Self {
        Self { since: Instant::now(), messages: 0, bytes: 0, lost: 0 }
    }
}

impl Quota {
    /// Returns whether a message of `bytes` bytes is logged; counts it as lost otherwise.
    fn admits(&mut self, instance: &str, bytes: usize) -> bool {
        self.end_window(instance);
        let admitted = self.messages < MESSAGES && self.bytes + bytes <= BYTES;
        if admitted {
            self.messages += 1;
            self.bytes += bytes;
        } else {
            self.lost += 1;
        }
        admitted
    }

    /// Starts a new window if the current one is over, and reports the messages lost in it.
    fn end_window(&mut self, instance: &str) {
        // Reads the clock only if messages were lost or the limit is reached.
        if (self.lost > 0 || self.messages == MESSAGES) && self.since.elapsed() >= WINDOW {
            (self.since, self.messages) = (Instant::now(), 0);
            self.report_lost(instance);
        }
    }

    /// Logs the number of lost messages, if any.
    fn report_lost(&mut self, instance: &str) {
        let count = std::mem::take(&mut self.lost);
        if count > 0 {
            tracing::warn!(target: "fmu", instance, lost = count, "{count} more messages are lost: there were too many");
        }
    }
}

impl Drop for Inbox {
    fn drop(&mut self) {
        self.quota.report_lost(&self.instance);
    }
}

/// Receives the messages of one instance in the master.
#[derive(Default)]
pub(super) struct Inbox {
    instance: String,
    /// Number of words read from the message ring.
    tail: u64,
    /// Number of messages dropped by the worker that are already counted as lost.
    dropped: u64,
    quota: Quota,
    /// The last messages, at most [`KEPT`], since the last [`Inbox::take`] or [`Inbox::clear`].
    recent: VecDeque<String>,
}

impl Inbox {
    pub(super) fn new(instance: &str) -> Self {
        let mut inbox = Self::default();
        instance.clone_into(&mut inbox.instance);
        inbox
    }

    /// Sets the name of the instance for later messages.
    pub(super) fn rename(&mut self, instance: &str) {
        self.quota.report_lost(&self.instance);
        instance.clone_into(&mut self.instance);
    }

    /// Logs the messages in the ring within the quota, and removes all of them.
    #[inline]
    pub(super) fn drain(&mut self, shared: &Shared) {
        if shared.log_head().load(Ordering::Acquire) != self.tail
            || shared.log_dropped().load(Ordering::Relaxed) != self.dropped
        {
            self.receive(shared);
        }
    }

    #[cold]
    fn receive(&mut self, shared: &Shared) {
        let head = shared.log_head().load(Ordering::Acquire);
        while self.tail != head {
            let Some((level, message)) = self.next(shared.ring(), head) else {
                // The ring is corrupted: skip everything up to `head`.
                self.tail = head;
                break;
            };
            if self.quota.admits(&self.instance, message.text.len()) {
                let Message { category, time, text } = &message;
                log_message(level, &self.instance, category, Some(*time), text);
            }
            if self.recent.len() == KEPT {
                self.recent.pop_front();
            }
            self.recent.push_back(message.text);
        }
        shared.log_tail().store(self.tail, Ordering::Release);
        let dropped = shared.log_dropped().load(Ordering::Relaxed);
        let count = dropped.wrapping_sub(self.dropped);
        self.dropped = dropped;
        self.quota.lost += count;
        self.quota.end_window(&self.instance);
    }

    /// Reads the message at the tail and advances the tail; `None` if the ring holds no valid message.
    fn next(&mut self, ring: &[AtomicU64], head: u64) -> Option<(Level, Message)> {
        let available = head.wrapping_sub(self.tail);
        let word = |offset: u64| at(ring, self.tail.wrapping_add(offset)).load(Ordering::Relaxed);
        let length = word(0);
        let words = length.div_ceil(8);
        if available > ring.len() as u64 || words >= available {
            return None;
        }
        let mut bytes: Vec<u8> = (1..=words).flat_map(|next| word(next).to_le_bytes()).collect();
        bytes.truncate(usize::try_from(length).ok()?);
        let sent: RingMessage<'_> = decode(&bytes)?;
        let level = *LEVELS.get(sent.level)?;
        let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
        let message =
            Message { category: text(sent.category), time: sent.time, text: text(sent.text) };
        self.tail = self.tail.wrapping_add(words + 1);
        Some((level, message))
    }

    /// Returns and clears the kept messages.
    pub(super) fn take(&mut self) -> Vec<String> {
        std::mem::take(&mut self.recent).into()
    }

    /// Logs an error that has no caller to return to.
    pub(super) fn log_error(&self, error: &CallError) {
        let instance = self.instance.as_str();
        tracing::warn!(target: "fmu", instance, "{error}");
    }

    /// Discards the messages that were kept for an error, before a new call.
    #[inline]
    pub(super) fn clear(&mut self) {
        if !self.recent.is_empty() {
            self.recent.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> Message {
        Message { category: "logAll".to_owned(), time: 1.25, text: text.to_owned() }
    }

    fn pair() -> (Arc<Shared>, Forward, Inbox) {
        let shared = Arc::new(Shared::create(1).unwrap().0);
        (shared.clone(), Forward::new(shared), Inbox::new("one"))
    }

    #[test]
    fn messages_pass_through_the_ring_however_often_it_goes_round() {
        let (shared, forward, mut inbox) = pair();
        for count in 0..20_000 {
            let sent = message(&format!("number {count}{}", "ä".repeat(count % 50)));
            forward.send(Level::WARN, &sent);
            let head = shared.log_head().load(Ordering::Acquire);
            assert_eq!(inbox.next(shared.ring(), head), Some((Level::WARN, sent)));
            assert_eq!(inbox.tail, head);
            shared.log_tail().store(inbox.tail, Ordering::Release);
        }
        assert_eq!(shared.log_dropped().load(Ordering::Relaxed), 0);
    }

    #[test]
    fn a_flood_is_counted_where_it_does_not_fit_and_the_last_ten_heard_are_kept() {
        let (shared, forward, mut inbox) = pair();
        for count in 0..100_000 {
            forward.send(Level::INFO, &message(&count.to_string()));
        }
        let dropped = shared.log_dropped().load(Ordering::Relaxed);
        // The number of bytes; then level, time, category and text, the texts after their lengths.
        let words = 1 + (1 + 8 + 1 + 6 + 1 + 5_u64).div_ceil(8);
        assert_eq!(100_000 - dropped, shared.ring().len() as u64 / words);
        inbox.drain(&shared);
        assert_eq!(inbox.dropped, dropped);
        assert_eq!(inbox.take().last(), Some(&(100_000 - dropped - 1).to_string()));
        forward.send(Level::INFO, &message("after"));
        inbox.drain(&shared);
        assert_eq!(inbox.take(), ["after"]);
    }

    #[test]
    fn of_messages_that_come_too_fast_so_many_are_passed_on_and_the_others_counted() {
        let mut quota = Quota::default();
        let admitted = (0..5000).filter(|_| quota.admits("one", 100)).count();
        assert_eq!((admitted, quota.lost), (1000, 4000));
        quota.since = quota.since.checked_sub(WINDOW).unwrap();
        assert!(quota.admits("one", 100), "the next second");
        assert_eq!(quota.lost, 0, "reported");
        let mut quota = Quota::default();
        let admitted = (0..100).filter(|_| quota.admits("one", 1 << 20)).count();
        assert_eq!((admitted, quota.lost), (16, 84));
    }

    #[test]
    fn a_ring_full_of_anything_is_survived() {
        let (shared, _, mut inbox) = pair();
        let mut state = 7_u64;
        for _ in 0..200 {
            for word in shared.ring() {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                word.store(state >> (state >> 58), Ordering::Relaxed);
            }
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            shared.log_head().store(state >> (state >> 58), Ordering::Relaxed);
            inbox.drain(&shared);
            assert!(inbox.recent.len() <= KEPT);
            assert_eq!(shared.log_tail().load(Ordering::Relaxed), inbox.tail);
        }
    }
}
