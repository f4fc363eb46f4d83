//! Signals and `exit`: the parts that the operating system calls.
//!
//! The handlers do only what is safe in a signal handler: atomics, `nanosleep`, `write`, `_exit`,
//! formatting on the stack, and `unpark`, which is an atomic exchange and one call of the kernel.
#![expect(unsafe_code, reason = "signal handlers")]

use std::cell::Cell;
use std::io;
use std::mem::MaybeUninit;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::Duration;

use libc::{c_int, c_void, siginfo_t};

use super::{DONE, EXIT, PATIENCE, STATUS, begin, last_of_this_thread, last_words};

/// The signals that end a process, each with its name.
pub(super) const FATAL: [(c_int, &str); 6] = [
    (libc::SIGSEGV, "SIGSEGV: an invalid access to memory or a stack overflow"),
    (libc::SIGBUS, "SIGBUS: an invalid access to memory"),
    (libc::SIGFPE, "SIGFPE: an invalid arithmetic operation"),
    (libc::SIGILL, "SIGILL: an invalid instruction"),
    (libc::SIGABRT, "SIGABRT: abort was called"),
    (libc::SIGSYS, "SIGSYS: an invalid system call"),
];
/// Bytes of the stack on which the handler runs where the thread's own has overflowed.
const STACK: usize = 1 << 16;

thread_local! {
    /// Whether this thread runs the program's last function.
    static IS_KEEPER: Cell<bool> = const { Cell::new(false) };
}

/// The process that is watched: what an FMU forks is not.
static PROCESS: AtomicI32 = AtomicI32::new(0);

/// Whether this is a process that an FMU forked off.
fn is_forked() -> bool {
    // SAFETY: no conditions.
    unsafe { libc::getpid() != PROCESS.load(Ordering::Relaxed) }
}

/// The calling thread is the one that runs the program's last function.
pub(super) fn keep() {
    IS_KEEPER.set(true);
}

/// Installs the handlers, for all threads; the calling one gets a stack for them. A file that grows
/// beyond a limit (`ulimit -f`) is an error of the write from now on, not a signal.
pub(super) fn install() -> io::Result<()> {
    // SAFETY: no conditions.
    PROCESS.store(unsafe { libc::getpid() }, Ordering::Relaxed);
    let stack = Box::leak(vec![0_u8; STACK].into_boxed_slice());
    let stack = libc::stack_t { ss_sp: stack.as_mut_ptr().cast(), ss_flags: 0, ss_size: STACK };
    // SAFETY: the memory is never freed.
    check(unsafe { libc::sigaltstack(&raw const stack, null_mut()) })?;
    // SAFETY: all zero is a value of this structure.
    let mut action: libc::sigaction = unsafe { MaybeUninit::zeroed().assume_init() };
    let handler: extern "C" fn(c_int, *mut siginfo_t, *mut c_void) = on_signal;
    action.sa_sigaction = handler as usize;
    action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
    for (signal, _) in FATAL {
        // SAFETY: the handler has the signature of SA_SIGINFO and does only what it may.
        check(unsafe { libc::sigaction(signal, &raw const action, null_mut()) })?;
    }
    // SAFETY: no handler of ours.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    on_end_of_process()
}

fn check(result: c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

extern "C" fn on_signal(signal: c_int, _: *mut siginfo_t, _: *mut c_void) {
    if is_forked() {
        // SAFETY: no handler of ours; the signal comes when this one returns.
        unsafe {
            libc::signal(signal, libc::SIG_DFL);
            libc::raise(signal);
        }
        return;
    }
    begin(signal, last_of_this_thread());
    wait();
}

/// Waits for the program's last function, which ends the process; it may itself have crashed.
fn wait() -> ! {
    if !IS_KEEPER.try_with(Cell::get).unwrap_or(false) {
        std::thread::sleep(PATIENCE + Duration::from_secs(1));
    }
    let line = last_words();
    // SAFETY: `line.length` bytes to read.
    unsafe { libc::write(libc::STDERR_FILENO, line.bytes.as_ptr().cast(), line.length) };
    leave(1)
}

pub(super) fn leave(status: c_int) -> ! {
    // SAFETY: no conditions.
    unsafe { libc::_exit(status) }
}

/// `exit` was called: by the program at its end, or by an FMU.
fn exit_called(status: c_int) {
    if DONE.load(Ordering::Relaxed) || is_forked() {
        return;
    }
    STATUS.store(status, Ordering::Relaxed);
    begin(EXIT, last_of_this_thread());
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
