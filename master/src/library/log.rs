//! The messages of an instance: to `tracing` as they come, the last ones kept for errors.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use fmi2::abi::{Status, fmi2CallbackLogger};

/// Most messages that are kept for an error.
const KEPT: usize = 10;

unsafe extern "C" {
    fn master_logger();
}

/// Receives the messages of one instance; begins like `struct sink` of `logger.c`.
#[repr(C)]
pub(super) struct Sink {
    receive: unsafe extern "C" fn(*mut Sink, c_int, *const c_char, *const c_char),
    instance: String,
    /// Bits of the time at which the FMU is, in s.
    time: AtomicU64,
    messages: Mutex<VecDeque<String>>,
}

impl Sink {
    pub(super) fn new(instance: &str) -> Self {
        let instance = instance.to_owned();
        Self { receive, instance, time: AtomicU64::new(0), messages: Mutex::default() }
    }

    /// The time that messages belong to from now on.
    #[inline]
    pub(super) fn set_time(&self, time: f64) {
        self.time.store(time.to_bits(), Ordering::Relaxed);
    }

    /// The last messages since this was last asked.
    pub(super) fn take(&self) -> Vec<String> {
        let kept = self.messages.lock().map(|mut kept| std::mem::take(&mut *kept));
        kept.map(Vec::from).unwrap_or_default()
    }

    fn hear(&self, status: c_int, category: &str, text: String) {
        let time = f64::from_bits(self.time.load(Ordering::Relaxed));
        let instance = self.instance.as_str();
        match Status::from_c(status) {
            Some(Status::OK) => {
                tracing::info!(target: "fmu", instance, category, time, "{text}");
            }
            Some(Status::Warning | Status::Discard | Status::Pending) => {
                tracing::warn!(target: "fmu", instance, category, time, "{text}");
            }
            _ => tracing::error!(target: "fmu", instance, category, time, "{text}"),
        }
        if let Ok(mut kept) = self.messages.lock() {
            if kept.len() == KEPT {
                kept.pop_front();
            }
            kept.push_back(text);
        }
    }
}

unsafe extern "C" fn receive(
    sink: *mut Sink,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the logger hands back the sink that `Component` owns, and a terminated text; the
    // category is the FMU's, terminated or null.
    let (sink, category, text) = unsafe {
        let category = category.as_ref().map(|category| CStr::from_ptr(category));
        (&*sink, category, CStr::from_ptr(text))
    };
    let category = category.map(CStr::to_string_lossy).unwrap_or_default();
    sink.hear(status, &category, text.to_string_lossy().into_owned());
}

/// The callback of `logger.c`.
pub(super) fn logger() -> fmi2CallbackLogger {
    // SAFETY: both are pointers to functions; C calls it with the logger's signature.
    unsafe { std::mem::transmute::<unsafe extern "C" fn(), fmi2CallbackLogger>(master_logger) }
}
