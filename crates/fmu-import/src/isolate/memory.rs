//! The memory limit of a worker, and the detection of a crash after a failed allocation.
#![expect(unsafe_code, reason = "signal handlers")]

use std::io;
use std::sync::atomic::Ordering;
use std::sync::{Arc, OnceLock};

use libc::{c_int, c_void, siginfo_t};
use rustix::process::{Resource, Rlimit, setrlimit};

use super::layout::Shared;
use crate::crash::handle;

/// The memory in which a crash is recorded.
static SHARED: OnceLock<Arc<Shared>> = OnceLock::new();

/// Limits the address space of this process, and records a later crash after a failed allocation.
pub(super) fn limit(shared: &Arc<Shared>, bytes: u64) -> io::Result<()> {
    if SHARED.set(shared.clone()).is_ok() {
        for signal in [libc::SIGSEGV, libc::SIGBUS, libc::SIGABRT] {
            // RESETHAND restores the default action, which ends the process as the crash would have.
            // SAFETY: the handler uses atomics, `errno` and `raise` only.
            unsafe { handle(signal, on_signal, libc::SA_RESETHAND) }?;
        }
    }
    let limit = Rlimit { current: Some(bytes), maximum: Some(bytes) };
    Ok(setrlimit(Resource::As, limit)?)
}

/// Records the crash if `errno` is ENOMEM. A failed `malloc` sets `errno`, and successful calls do not change it: the
/// FMU most likely used a null pointer from `malloc`.
extern "C" fn on_signal(signal: c_int, _: *mut siginfo_t, _: *mut c_void) {
    if io::Error::last_os_error().raw_os_error() == Some(libc::ENOMEM)
        && let Some(shared) = SHARED.get()
    {
        shared.no_memory().store(1, Ordering::Relaxed);
    }
    // On return the processor repeats an invalid access, but a signal that a process sent is lost: raise it again.
    // SAFETY: no conditions.
    unsafe { libc::raise(signal) };
}
