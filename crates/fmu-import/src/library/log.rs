//! The messages of an instance: to `tracing` as they come, the last ones kept for errors.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::{Arc, Mutex, PoisonError, RwLock, Weak};

use fmu_description::abi::{Status, fmi2CallbackLogger};

use super::foreign;
use crate::crash::{Place, last_of_this_thread};

/// Most messages that are kept for an error.
const KEPT: usize = 10;

/// The receivers of all instances of this process.
static SINKS: RwLock<Vec<Weak<Sink>>> = RwLock::new(Vec::new());

unsafe extern "C" {
    fn master_logger();
}

/// Names of variables: of a letter for the type (r, i, b, s) and a value reference.
pub(crate) type Names = Arc<dyn Fn(char, u32) -> Option<String> + Send + Sync>;

/// Receives the messages of one instance. Its address is the environment that the FMU is given, and
/// is never used but to be compared: FMUs hand over others, and null.
pub(super) struct Sink {
    place: Arc<Place>,
    names: Names,
    messages: Mutex<VecDeque<String>>,
}

impl Sink {
    pub(super) fn new(place: &Arc<Place>, names: Names) -> Arc<Self> {
        let sink = Arc::new(Self { place: place.clone(), names, messages: Mutex::default() });
        let mut sinks = SINKS.write().unwrap_or_else(PoisonError::into_inner);
        sinks.retain(|sink| sink.strong_count() > 0);
        sinks.push(Arc::downgrade(&sink));
        sink
    }

    /// The last messages since this was last asked.
    pub(super) fn take(&self) -> Vec<String> {
        let kept = self.messages.lock().map(|mut kept| std::mem::take(&mut *kept));
        kept.map(Vec::from).unwrap_or_default()
    }

    fn hear(&self, status: c_int, category: &str, text: &str) {
        let text = with_names(text, &*self.names);
        say(self.place.instance(), Some(self.place.time()), status, category, &text);
        if let Ok(mut kept) = self.messages.lock() {
            if kept.len() == KEPT {
                kept.pop_front();
            }
            kept.push_back(text);
        }
    }
}

fn say(instance: &str, time: Option<f64>, status: c_int, category: &str, text: &str) {
    match Status::from_c(status) {
        Some(Status::OK) => {
            tracing::info!(target: "fmu", instance, category, time, "{text}");
        }
        Some(Status::Warning | Status::Discard | Status::Pending) => {
            tracing::warn!(target: "fmu", instance, category, time, "{text}");
        }
        _ => tracing::error!(target: "fmu", instance, category, time, "{text}"),
    }
}

/// Puts the names of variables for `#r12#` and a `#` for `##` (FMI 2.0.5, section 2.1.5). Anything
/// else with a `#` stays as it is.
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

/// The sink of which `is_wanted` is true.
fn find(is_wanted: impl Fn(&Sink) -> bool) -> Option<Arc<Sink>> {
    let sinks = SINKS.read().unwrap_or_else(PoisonError::into_inner);
    sinks.iter().filter_map(Weak::upgrade).find(|sink| is_wanted(sink))
}

/// A message with an environment that is no sink's: of the instance whose call this thread is in, or
/// else of the instance of that name.
fn hear_stranger(instance: Option<&str>, status: c_int, category: &str, text: &str) {
    let sink = find(|sink| sink.place.is_at(last_of_this_thread()))
        .or_else(|| find(|sink| Some(sink.place.instance()) == instance));
    match sink {
        Some(sink) => sink.hear(status, category, text),
        None => say(instance.unwrap_or("an FMU"), None, status, category, text),
    }
}

/// What `logger.c` calls.
///
/// # Safety
///
/// `text` is terminated. The other pointers are the FMU's; where the environment is that of an
/// instance, the category is terminated or null.
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
        return hear_stranger(foreign::text(instance).as_deref(), status, &category, &text);
    };
    // SAFETY: of an FMU that does as the standard says: terminated or null.
    let category = unsafe { category.as_ref().map(|category| CStr::from_ptr(category)) };
    sink.hear(status, &category.map(CStr::to_string_lossy).unwrap_or_default(), &text);
}

/// The callback of `logger.c`.
pub(super) fn logger() -> fmi2CallbackLogger {
    // SAFETY: both are pointers to functions; C calls it with the logger's signature.
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
