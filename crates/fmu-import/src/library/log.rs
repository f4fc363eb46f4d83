//! The messages of an instance: passed to `tracing` at once, and the last ones kept for errors.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::{Arc, Mutex, PoisonError, RwLock, Weak};

use fmu_description::abi::{Status, fmi2CallbackLogger};
use tracing::Level;

use super::foreign;
use crate::crash::{Place, last_of_this_thread};

/// Maximum number of recent messages that are kept to explain an error.
const KEPT: usize = 10;

/// The message receivers of all instances of this process.
static SINKS: RwLock<Vec<Weak<Sink>>> = RwLock::new(Vec::new());

unsafe extern "C" {
    fn master_logger();
}

/// Looks up the name of a variable by the letter of its type (r, i, b, s) and its value reference.
pub(crate) type Names = Arc<dyn Fn(char, u32) -> Option<String> + Send + Sync>;

/// Receives the messages of one instance.
///
/// Its address is the `componentEnvironment` of the FMU. This address is compared with the addresses of known sinks and
/// never dereferenced, because some FMUs pass null or another pointer.
pub(super) struct Sink {
    place: Arc<Place>,
    /// Lookup of variable names; `None` if messages have no references to variables (FMI 3.0).
    names: Option<Names>,
    messages: Mutex<VecDeque<String>>,
}

impl Sink {
    pub(super) fn new(place: &Arc<Place>, names: Option<Names>) -> Arc<Self> {
        let sink = Arc::new(Self { place: place.clone(), names, messages: Mutex::default() });
        let mut sinks = SINKS.write().unwrap_or_else(PoisonError::into_inner);
        sinks.retain(|sink| sink.strong_count() > 0);
        sinks.push(Arc::downgrade(&sink));
        sink
    }

    /// Returns whether no message has been kept since the last [`Sink::take`].
    pub(super) fn is_empty(&self) -> bool {
        self.messages.lock().is_ok_and(|messages| messages.is_empty())
    }

    /// Returns and clears the kept messages.
    pub(super) fn take(&self) -> Vec<String> {
        let messages = self.messages.lock().map(|mut messages| std::mem::take(&mut *messages));
        messages.map(Vec::from).unwrap_or_default()
    }

    /// Logs a message, with names in place of value references, and keeps the message for the next error.
    pub(super) fn receive(&self, status: c_int, category: &str, text: &str) {
        let text = match &self.names {
            Some(names) => with_names(text, &**names),
            None => text.to_owned(),
        };
        let (instance, time) = (self.place.instance(), Some(self.place.time()));
        log_message(level_of(status), instance, category, time, &text);
        if let Ok(mut messages) = self.messages.lock() {
            if messages.len() == KEPT {
                messages.pop_front();
            }
            messages.push_back(text);
        }
    }
}

/// Returns the level at which a message with this status is logged.
fn level_of(status: c_int) -> Level {
    match Status::from_c(status) {
        Some(Status::OK) => Level::INFO,
        Some(Status::Warning | Status::Discard | Status::Pending) => Level::WARN,
        _ => Level::ERROR,
    }
}

/// Logs a message of an FMU; `time` is the time of the instance in s, if it is known.
pub(crate) fn log_message(
    level: Level,
    instance: &str,
    category: &str,
    time: Option<f64>,
    text: &str,
) {
    match level {
        Level::ERROR => tracing::error!(target: "fmu", instance, category, time, "{text}"),
        Level::WARN => tracing::warn!(target: "fmu", instance, category, time, "{text}"),
        Level::INFO => tracing::info!(target: "fmu", instance, category, time, "{text}"),
        Level::DEBUG => tracing::debug!(target: "fmu", instance, category, time, "{text}"),
        Level::TRACE => tracing::trace!(target: "fmu", instance, category, time, "{text}"),
    }
}

/// Replaces `#r12#` by the name of the variable and `##` by `#` (FMI 2.0.5, section 2.1.5). A reference
/// without a name and other text with a `#` are not changed.
fn with_names(text: &str, name: &dyn Fn(char, u32) -> Option<String>) -> String {
    let mut done = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('#') {
        done.push_str(before);
        if let Some(after) = after.strip_prefix('#') {
            done.push('#');
            rest = after;
            continue;
        }
        let variable = after.split_once('#').and_then(|(inner, after)| {
            let kind = inner.chars().next().filter(|kind| "ribs".contains(*kind))?;
            Some((name(kind, inner[1..].parse().ok()?)?, after))
        });
        rest = if let Some((name, after)) = variable {
            done.push_str(&name);
            after
        } else {
            done.push('#');
            after
        };
    }
    done.push_str(rest);
    done
}

/// Returns the first sink for which `matches` is true.
fn find(matches: impl Fn(&Sink) -> bool) -> Option<Arc<Sink>> {
    let sinks = SINKS.read().unwrap_or_else(PoisonError::into_inner);
    sinks.iter().filter_map(Weak::upgrade).find(|sink| matches(sink))
}

/// Receives a message whose environment matches no sink, for the instance that this thread called last, otherwise for
/// the instance named `instance`.
fn receive_unmatched(instance: Option<&str>, status: c_int, category: &str, text: &str) {
    let sink = find(|sink| sink.place.is_at(last_of_this_thread()))
        .or_else(|| find(|sink| Some(sink.place.instance()) == instance));
    match sink {
        Some(sink) => sink.receive(status, category, text),
        None => {
            log_message(level_of(status), instance.unwrap_or("an FMU"), category, None, text);
        }
    }
}

/// Receives a formatted message from `logger.c`.
///
/// # Safety
///
/// `text` is terminated. The FMU supplies the other pointers; if `environment` is the address of a
/// sink, `category` is null or terminated.
#[unsafe(no_mangle)]
unsafe extern "C" fn master_receive(
    environment: *mut c_void,
    instance: *const c_char,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the caller's promise.
    let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
    let Some(sink) = find(|sink| std::ptr::from_ref(sink).addr() == environment.addr()) else {
        let category = foreign::text(category).unwrap_or_default();
        return receive_unmatched(foreign::text(instance).as_deref(), status, &category, &text);
    };
    // SAFETY: the FMU passed the environment that the standard requires; its category is null or
    // terminated.
    let category = unsafe { category.as_ref().map(|category| CStr::from_ptr(category)) };
    sink.receive(status, &category.map(CStr::to_string_lossy).unwrap_or_default(), &text);
}

/// Receives a message of an FMU of FMI 3.0.
pub(super) unsafe extern "C" fn receive_message(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    let category = foreign::text(category).unwrap_or_default();
    let Some(sink) = find(|sink| std::ptr::from_ref(sink).addr() == environment.addr()) else {
        let text = foreign::text(message).unwrap_or_default();
        return receive_unmatched(None, status, &category, &text);
    };
    // SAFETY: the FMU passed the environment that the standard requires; its message is null or
    // terminated.
    let text = unsafe { message.as_ref().map(|message| CStr::from_ptr(message)) };
    sink.receive(status, &category, &text.map(CStr::to_string_lossy).unwrap_or_default());
}

/// Returns the logger callback that `logger.c` defines.
pub(super) fn logger() -> fmi2CallbackLogger {
    // SAFETY: both types are pointers to functions; C calls the function with the signature of the logger.
    unsafe { std::mem::transmute::<unsafe extern "C" fn(), fmi2CallbackLogger>(master_logger) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_references_in_messages_become_names_and_two_hashes_become_one() {
        let name = |kind, reference| match (kind, reference) {
            ('r', 12) => Some("tank.level".to_owned()),
            ('b', 0) => Some("pump on".to_owned()),
            _ => None,
        };
        for (text, expected) in [
            ("#r12# is negative", "tank.level is negative"),
            ("#b0#: #r12##r12#", "pump on: tank.leveltank.level"),
            ("50 ## of ##r12##", "50 # of #r12#"),
            ("no #r13#, no #q1#, #r#, #1, C#", "no #r13#, no #q1#, #r#, #1, C#"),
            ("#é1# #r-1# #r99999999999#", "#é1# #r-1# #r99999999999#"),
            ("", ""),
        ] {
            assert_eq!(with_names(text, &name), expected);
        }
    }
}
