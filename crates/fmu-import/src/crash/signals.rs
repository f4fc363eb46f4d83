//! The handlers of fatal signals and of `exit`.
//!
//! The handlers are async-signal-safe: they use atomics, `nanosleep`, `open`, `write`, `close`, `_exit`, formatting on
//! the stack, and `unpark`, which is an atomic exchange and one system call.
#![expect(unsafe_code, reason = "signal handlers")]

use std::cell::Cell;
use std::ffi::CString;
use std::fmt::{self, Write as _};
use std::io;
use std::mem::MaybeUninit;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicI32, AtomicU32, AtomicUsize, Ordering};
use std::thread::Thread;
use std::time::Duration;

use libc::{c_int, c_void, siginfo_t};

use super::{
    ADVICE, Cause, EXIT, PLACE, RECORD, REPORT_LIMIT, STATUS, cause, has_begun_steps,
    last_of_this_thread, place, start_report, write_ending,
};

/// The signals of a crash, each with its name and meaning.
pub(super) const FATAL: [(c_int, &str); 6] = [
    (libc::SIGSEGV, "SIGSEGV: an invalid access to memory or a stack overflow"),
    (libc::SIGBUS, "SIGBUS: an invalid access to memory"),
    (libc::SIGFPE, "SIGFPE: an invalid arithmetic operation"),
    (libc::SIGILL, "SIGILL: an invalid instruction"),
    (libc::SIGABRT, "SIGABRT: abort was called"),
    (libc::SIGSYS, "SIGSYS: an invalid system call"),
];
/// The ending signals: signals by which users and systems end a program or announce its end.
pub(crate) const ENDING_SIGNALS: [c_int; 7] = [
    libc::SIGINT,
    libc::SIGTERM,
    libc::SIGHUP,
    libc::SIGUSR1,
    libc::SIGUSR2,
    libc::SIGXCPU,
    libc::SIGALRM,
];
/// Size in bytes of the alternate signal stack, which serves after a stack overflow.
const STACK: usize = 1 << 16;

thread_local! {
    /// Whether this thread runs the program's crash function.
    static IS_REPORTER: Cell<bool> = const { Cell::new(false) };
}

/// Identifier of the process that called `watch`; processes forked by an FMU are not handled.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Address of the slot that the forking thread had entered last, in a copy of the process made by `fork`; otherwise
/// [`NOT_FORKED`].
static FORKED_BY: AtomicUsize = AtomicUsize::new(NOT_FORKED);
const NOT_FORKED: usize = usize::MAX;

/// Returns whether this process is a copy that `fork` has made.
fn is_forked() -> bool {
    std::process::id() != PROCESS.load(Ordering::Relaxed)
}

/// Whether the program has finished its work.
fn is_done() -> bool {
    RECORD.done.load(Ordering::Acquire) != 0
}

/// Returns whether SIGHUP is ignored, as under `nohup`.
pub(crate) fn ignores_hangup() -> bool {
    handler_of(libc::SIGHUP).is_ok_and(|handler| handler == libc::SIG_IGN)
}

/// Returns the present handler of a signal.
fn handler_of(signal: c_int) -> io::Result<libc::sighandler_t> {
    let mut action = MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: with a null action the function only queries.
    check(unsafe { libc::sigaction(signal, null(), action.as_mut_ptr()) })?;
    // SAFETY: all zeros is a valid value of the structure.
    Ok(unsafe { action.assume_init() }.sa_sigaction)
}

/// The last ending signal that the thread of [`on_ending_signal`] has not seen yet; 0: none.
static ARRIVED: AtomicI32 = AtomicI32::new(0);
/// The thread of [`on_ending_signal`].
static SIGNAL_THREAD: OnceLock<Thread> = OnceLock::new();

/// Calls `react` with the number of each signal that ends a program or announces its end, in a separate thread. Of
/// several signals that arrive before `react` is called only the last one counts; SIGHUP does not count if it is
/// ignored. No file descriptor is involved, because an FMU may close those that it did not open. Only the first call
/// has an effect.
///
/// # Errors
///
/// [`io::Error`] if the operating system refuses the thread or a signal handler.
pub fn on_ending_signal(react: impl Fn(c_int) + Send + 'static) -> io::Result<()> {
    let wait = move || {
        loop {
            match ARRIVED.swap(0, Ordering::AcqRel) {
                0 => std::thread::park(),
                signal => react(signal),
            }
        }
    };
    let thread = std::thread::Builder::new().name("signals".to_owned()).spawn(wait)?;
    if SIGNAL_THREAD.set(thread.thread().clone()).is_err() {
        return Ok(());
    }
    let is_handled = |signal: &&c_int| **signal != libc::SIGHUP || !ignores_hangup();
    for signal in ENDING_SIGNALS.iter().filter(is_handled) {
        // SAFETY: the handler uses atomics and wakes a thread.
        unsafe { handle(*signal, on_arrival, libc::SA_RESTART) }?;
    }
    Ok(())
}

extern "C" fn on_arrival(signal: c_int, _: *mut siginfo_t, _: *mut c_void) {
    ARRIVED.store(signal, Ordering::Release);
    if let Some(thread) = SIGNAL_THREAD.get() {
        thread.unpark();
    }
}

/// Returns whether this process is a copy that `fork` has made.
#[inline]
pub(super) fn is_copy() -> bool {
    FORKED_BY.load(Ordering::Relaxed) != NOT_FORKED
}

/// Ends this process if it is a copy, made by an FMU with `fork`, that continues as the program.
#[inline]
pub fn end_copy() {
    if is_copy() {
        report_and_end_copy();
    }
}

/// Ends this copy of the process; the first copy prints a warning.
#[cold]
fn report_and_end_copy() -> ! {
    if RECORD.copies.fetch_add(1, Ordering::Relaxed) > 0 {
        leave(0);
    }
    let mut line = Line::new();
    let name = place::instance(FORKED_BY.load(Ordering::Relaxed));
    // A line that is too long is cut.
    let _ = write!(
        line,
        "warning: {}: the FMU has forked this process, and both went on with the run; the copy is ended, with all \
         that the FMU wanted in it",
        name.as_deref().unwrap_or("the program")
    );
    line.print();
    leave(0)
}

/// Marks this process as a copy; runs in each copy that `fork` has made.
extern "C" fn on_fork() {
    FORKED_BY.store(last_of_this_thread(), Ordering::Relaxed);
}

/// Marks the calling thread as the one that runs the program's crash function.
pub(super) fn mark_reporter() {
    IS_REPORTER.set(true);
}

/// Installs the handlers of signals, of `fork` and of `exit`, and an alternate signal stack for the calling thread.
/// SIGXFSZ is ignored: a write beyond the file size limit (`ulimit -f`) returns an error.
pub(super) fn install() -> io::Result<()> {
    PROCESS.store(std::process::id(), Ordering::Relaxed);
    // SAFETY: a function that may run in the copy of a process: it stores to an atomic.
    let error = unsafe { libc::pthread_atfork(None, None, Some(on_fork)) };
    if error != 0 {
        return Err(io::Error::from_raw_os_error(error));
    }
    let stack = Box::leak(vec![0_u8; STACK].into_boxed_slice());
    let stack = libc::stack_t { ss_sp: stack.as_mut_ptr().cast(), ss_flags: 0, ss_size: STACK };
    // SAFETY: the memory is never freed.
    check(unsafe { libc::sigaltstack(&raw const stack, null_mut()) })?;
    for (signal, _) in FATAL {
        // SAFETY: the handler calls async-signal-safe functions only.
        unsafe { handle(signal, on_signal, 0) }?;
    }
    // SAFETY: no handler is installed.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    on_end_of_process()
}

/// Installs a handler, which runs on the alternate stack if there is one.
///
/// # Safety
///
/// `handler` is async-signal-safe.
pub(crate) unsafe fn handle(
    signal: c_int,
    handler: extern "C" fn(c_int, *mut siginfo_t, *mut c_void),
    flags: c_int,
) -> io::Result<()> {
    // SAFETY: all zeros is a valid value of this structure.
    let mut action: libc::sigaction = unsafe { MaybeUninit::zeroed().assume_init() };
    action.sa_sigaction = handler as usize;
    action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK | flags;
    // SAFETY: the handler has the signature of SA_SIGINFO; the caller says that it is async-signal-safe.
    check(unsafe { libc::sigaction(signal, &raw const action, null_mut()) })
}

/// Restores the default action of `signal` and raises the signal again, in its handler.
fn act_as_by_default(signal: c_int) {
    // SAFETY: restores the default; the signal is delivered when the handler returns.
    unsafe {
        libc::signal(signal, libc::SIG_DFL);
        libc::raise(signal);
    }
}

fn check(result: c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

extern "C" fn on_signal(signal: c_int, _: *mut siginfo_t, _: *mut c_void) {
    if is_forked() || is_done() {
        return act_as_by_default(signal);
    }
    start_report(signal, last_of_this_thread());
    wait();
}

/// Waits for the program's crash function, which ends the process. If that function does not return in time, or has
/// crashed and so called this function, writes the fallback message and ends the process.
fn wait() -> ! {
    if !IS_REPORTER.try_with(Cell::get).unwrap_or(false) {
        std::thread::sleep(REPORT_LIMIT + Duration::from_secs(1));
    }
    let mut line = Line::new();
    // A line that is too long is cut.
    let _ = write_fallback(&mut line);
    line.print();
    super::leave(1)
}

/// A line for standard error, built without heap allocation and cut at its capacity.
struct Line {
    bytes: [u8; 1024],
    length: usize,
}

impl Line {
    const fn new() -> Self {
        Self { bytes: [b'\n'; 1024], length: 0 }
    }

    /// Prints the line on standard error.
    fn print(&mut self) {
        self.length = (self.length + 1).min(self.bytes.len());
        // SAFETY: `length` bytes to read.
        unsafe { libc::write(libc::STDERR_FILENO, self.bytes.as_ptr().cast(), self.length) };
    }
}

impl fmt::Write for Line {
    fn write_str(&mut self, part: &str) -> fmt::Result {
        for byte in part.bytes() {
            *self.bytes.get_mut(self.length).ok_or(fmt::Error)? = byte;
            self.length += 1;
        }
        Ok(())
    }
}

/// Writes the text of the file of [`leave_file`]: cause, calls, and all FMUs of this process.
fn write_crash(line: &mut Line, signal: i32, place: usize) -> fmt::Result {
    line.write_str("aso_ftc: ")?;
    write_ending(line, place::calls(place), Cause::Signal(signal))?;
    line.write_str("; FMUs that ran in this process:")?;
    for name in place::instances() {
        write!(line, " {name}")?;
    }
    line.write_str("; isolate=True runs each FMU in a process of its own")
}

/// Writes the message that replaces the report if the crash function crashes or does not return.
fn write_fallback(line: &mut Line) -> fmt::Result {
    line.write_str("error: ")?;
    write_ending(line, place::calls(PLACE.load(Ordering::Relaxed)), cause())?;
    if has_begun_steps() {
        line.write_str("; this program could not shut down properly: the last rows may be lost")?;
    }
    line.write_str("; ")?;
    line.write_str(ADVICE.get().copied().unwrap_or_default())
}

/// The path of the file of [`leave_file`].
static CRASH_FILE: OnceLock<CString> = OnceLock::new();

/// Installs handlers that write a file `aso-ftc-crash-PID.txt` with FMU, function and time to `folder` if this
/// process crashes; then the signal acts as by default. For libraries inside other programs: a signal that the
/// program handles already keeps its handler. Only the first call has an effect, and none after [`super::watch`].
///
/// # Errors
///
/// [`io::Error`] if the operating system refuses a signal handler, or if the path of the folder has a NUL.
pub fn leave_file(folder: &Path) -> io::Result<()> {
    if super::REPORTER.get().is_some() {
        return Ok(());
    }
    let name = format!("aso-ftc-crash-{}.txt", std::process::id());
    let path = CString::new(folder.join(name).into_os_string().into_encoded_bytes())?;
    if CRASH_FILE.set(path).is_err() {
        return Ok(());
    }
    for (signal, _) in FATAL {
        if handler_of(signal)? == libc::SIG_DFL {
            // SAFETY: the handler calls async-signal-safe functions only.
            unsafe { handle(signal, write_file, 0) }?;
        }
    }
    Ok(())
}

/// Writes the file of [`leave_file`]; then the signal acts as by default.
extern "C" fn write_file(signal: c_int, _: *mut siginfo_t, _: *mut c_void) {
    if let Some(path) = CRASH_FILE.get().filter(|_| !is_copy()) {
        let mut line = Line::new();
        // A line that is too long is cut.
        let _ = write_crash(&mut line, signal, last_of_this_thread());
        line.print();
        let flags = libc::O_WRONLY | libc::O_CREAT | libc::O_TRUNC | libc::O_CLOEXEC;
        // SAFETY: a terminated path, and `length` bytes to read.
        unsafe {
            let file = libc::open(path.as_ptr(), flags, 0o666);
            if file >= 0 {
                libc::write(file, line.bytes.as_ptr().cast(), line.length);
                libc::close(file);
            }
        }
    }
    act_as_by_default(signal);
}

pub(super) fn leave(status: c_int) -> ! {
    // SAFETY: no conditions.
    unsafe { libc::_exit(status) }
}

/// Handles a call of `exit`. The call is reported unless the program has finished its work.
fn exit_called(status: c_int) {
    if is_done() || is_forked() {
        return;
    }
    STATUS.store(status, Ordering::Relaxed);
    start_report(EXIT, last_of_this_thread());
    wait();
}

/// Registers [`exit_called`] for calls of `exit`.
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

/// Registers [`exit_called`] for calls of `exit`; this system does not tell the exit status.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn on_end_of_process() -> io::Result<()> {
    extern "C" fn ended() {
        exit_called(0);
    }
    // SAFETY: a function without arguments.
    check(unsafe { libc::atexit(ended) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crash::Place;

    /// The crashed thread may hold the lock of the allocator.
    #[test]
    fn the_line_about_a_crash_needs_no_heap() {
        let instance = Place::new("tank");
        instance.set_time(0.1 + 0.2);
        instance.enter(&"fmi2DoStep");
        let (address, cause) = (last_of_this_thread(), Cause::Signal(libc::SIGSEGV));
        let mut line = Line::new();
        let counted = allocation_counter::measure(|| {
            write_ending(&mut line, place::calls(address), cause).unwrap();
        });
        let text = str::from_utf8(&line.bytes[..line.length]).unwrap();
        let expected = "tank at t = 0.3 s: fmi2DoStep crashed with signal 11 (SIGSEGV: ";
        assert!(text.starts_with(expected), "{text}");
        assert_eq!(counted.count_total, 0);
    }
}
