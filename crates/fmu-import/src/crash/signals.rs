//! The handlers of fatal signals and of `exit`.
//!
//! The handlers are async-signal-safe: they use atomics, `nanosleep`, `write`, `_exit`, formatting on
//! the stack, and `unpark`, which is an atomic exchange and one system call.
#![expect(unsafe_code, reason = "signal handlers")]

use std::cell::Cell;
use std::io;
use std::mem::MaybeUninit;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::Duration;

use libc::{c_int, c_void, siginfo_t};

use super::{
    DONE, EXIT, REPORT_LIMIT, STATUS, fallback_message, last_of_this_thread, start_report,
};

/// The signals that end a process, each with its name and meaning.
pub(super) const FATAL: [(c_int, &str); 6] = [
    (libc::SIGSEGV, "SIGSEGV: an invalid access to memory or a stack overflow"),
    (libc::SIGBUS, "SIGBUS: an invalid access to memory"),
    (libc::SIGFPE, "SIGFPE: an invalid arithmetic operation"),
    (libc::SIGILL, "SIGILL: an invalid instruction"),
    (libc::SIGABRT, "SIGABRT: abort was called"),
    (libc::SIGSYS, "SIGSYS: an invalid system call"),
];
/// Size in bytes of the alternate signal stack, which serves after a stack overflow.
const STACK: usize = 1 << 16;

thread_local! {
    /// Whether this thread runs the program's crash function.
    static IS_REPORTER: Cell<bool> = const { Cell::new(false) };
}

/// Identifier of the process that called `watch`; processes forked by an FMU are not handled.
static PROCESS: AtomicI32 = AtomicI32::new(0);

/// Returns whether an FMU forked this process.
fn is_forked() -> bool {
    // SAFETY: no conditions.
    unsafe { libc::getpid() != PROCESS.load(Ordering::Relaxed) }
}

/// Marks the calling thread as the one that runs the program's crash function.
pub(super) fn mark_reporter() {
    IS_REPORTER.set(true);
}

/// Installs the handlers for all threads, and an alternate signal stack for the calling thread.
/// SIGXFSZ is ignored: a write beyond the file size limit (`ulimit -f`) returns an error.
pub(super) fn install() -> io::Result<()> {
    // SAFETY: no conditions.
    PROCESS.store(unsafe { libc::getpid() }, Ordering::Relaxed);
    let stack = Box::leak(vec![0_u8; STACK].into_boxed_slice());
    let stack = libc::stack_t { ss_sp: stack.as_mut_ptr().cast(), ss_flags: 0, ss_size: STACK };
    // SAFETY: the memory is never freed.
    check(unsafe { libc::sigaltstack(&raw const stack, null_mut()) })?;
    // SAFETY: all zeros is a valid value of this structure.
    let mut action: libc::sigaction = unsafe { MaybeUninit::zeroed().assume_init() };
    let handler: extern "C" fn(c_int, *mut siginfo_t, *mut c_void) = on_signal;
    action.sa_sigaction = handler as usize;
    action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
    for (signal, _) in FATAL {
        // SAFETY: the handler has the signature of SA_SIGINFO and is async-signal-safe.
        check(unsafe { libc::sigaction(signal, &raw const action, null_mut()) })?;
    }
    // SAFETY: no handler is installed.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    on_end_of_process()
}

fn check(result: c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

extern "C" fn on_signal(signal: c_int, _: *mut siginfo_t, _: *mut c_void) {
    if is_forked() {
        // SAFETY: restores the default; the signal is delivered when this handler returns.
        unsafe {
            libc::signal(signal, libc::SIG_DFL);
            libc::raise(signal);
        }
        return;
    }
    start_report(signal, last_of_this_thread());
    wait();
}

/// Waits for the program's crash function, which ends the process. If that function has crashed or does
/// not return in time, writes the fallback message and ends the process.
fn wait() -> ! {
    if !IS_REPORTER.try_with(Cell::get).unwrap_or(false) {
        std::thread::sleep(REPORT_LIMIT + Duration::from_secs(1));
    }
    let line = fallback_message();
    // SAFETY: `line.length` bytes to read.
    unsafe { libc::write(libc::STDERR_FILENO, line.bytes.as_ptr().cast(), line.length) };
    leave(1)
}

pub(super) fn leave(status: c_int) -> ! {
    // SAFETY: no conditions.
    unsafe { libc::_exit(status) }
}

/// Handles a call of `exit`, by the program at its end or by an FMU.
fn exit_called(status: c_int) {
    if DONE.load(Ordering::Relaxed) || is_forked() {
        return;
    }
    STATUS.store(status, Ordering::Relaxed);
    start_report(EXIT, last_of_this_thread());
    wait();
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn on_end_of_process() -> io::Result<()> {
    unsafe extern "C" {
        fn on_exit(function: extern "C" fn(c_int, *mut c_void), argument: *mut c_void) -> c_int;
    }
    extern "C" fn ended(status: c_int, _: *mut c_void) {
        exit_called(status);
    }
    // SAFETY: the function has the signature that glibc calls.
    check(unsafe { on_exit(ended, null_mut()) })
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn on_end_of_process() -> io::Result<()> {
    extern "C" fn ended() {
        exit_called(0);
    }
    // SAFETY: a function without arguments.
    check(unsafe { libc::atexit(ended) })
}
