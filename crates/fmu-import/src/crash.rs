//! Crash reports for an FMU that ends the process by a fatal signal or by `exit`, or that blocks it in a call that
//! does not return.
//!
//! [`watch`] is for programs, not for libraries: it installs signal handlers. Afterwards a crash or an
//! `exit` of an FMU in this process calls a function of the program in a separate thread, while the
//! thread of the FMU waits. That function can log, write pending results and remove files. The process
//! then ends with the exit status that the function returns.

mod limit;
mod place;
#[cfg(unix)]
mod signals;

use std::fmt;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread::Thread;
use std::time::Duration;

use fmu_description::number::write_seconds;

pub(crate) use limit::Limit;
pub use place::Name;
#[cfg(target_os = "linux")]
pub(crate) use place::observe;
pub(crate) use place::{Place, RECORD, Slot, last_of_this_thread};
#[cfg(target_os = "linux")]
pub(crate) use signals::{ENDING_SIGNALS, handle, ignores_hangup};
#[cfg(unix)]
pub use signals::{end_copy, leave_file, on_ending_signal};

/// Time limit for the program's crash function.
const REPORT_LIMIT: Duration = Duration::from_secs(5);

/// Whether the end of the process has started.
static ENDING: AtomicBool = AtomicBool::new(false);
/// The cause of the end: the number of a signal, [`EXIT`], [`GIVEN_UP`], [`UNWOUND`] or [`OVERDUE`]; 0 before.
static CAUSE: AtomicI32 = AtomicI32::new(0);
const EXIT: i32 = -1;
const GIVEN_UP: i32 = -2;
const UNWOUND: i32 = -3;
const OVERDUE: i32 = -4;
/// The argument of `exit`, for the report of an unexpected `exit`.
static STATUS: AtomicI32 = AtomicI32::new(0);
/// The time in ms that [`give_up`] states; 0 without such a time.
static WAITED: AtomicU64 = AtomicU64::new(0);
/// The address of the slot that the crashed thread entered last.
static PLACE: AtomicUsize = AtomicUsize::new(0);
/// The name in reports of an activity that is no function of the standard. The dynamic linker is locked during this
/// activity: no other thread can start or register destructors of thread-local data.
pub(crate) const LOADING: &str = "loading the library";
/// The name of unloading in reports, used like [`LOADING`].
pub(crate) const UNLOADING: &str = "unloading the library";

/// The thread that runs the program's crash function.
static REPORTER: OnceLock<Thread> = OnceLock::new();

/// The last failure of a call, for the report of a crash that precedes the program's own report of this failure.
static LAST_FAILURE: Mutex<Option<String>> = Mutex::new(None);

/// Records a failure that the program is about to report, so that a crash report includes it: an FMU that crashes
/// when it is freed would otherwise hide the failure.
pub fn note(failure: String) {
    *LAST_FAILURE.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
}

/// Advice for the line on standard error if the program's crash function fails.
static ADVICE: OnceLock<&'static str> = OnceLock::new();

/// A call of a function of an FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The instance.
    pub instance: Name,
    /// The function of the standard, or another activity such as loading the library.
    pub function: &'static str,
    /// Time of the instance in s.
    pub time: f64,
    /// Number of the call within its instance, to distinguish calls of the same function at the same time.
    number: u64,
}

/// The cause of the end of the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A fatal signal, with its number.
    Signal(i32),
    /// A call of `exit`, with its status if it is known.
    Exit(Option<i32>),
    /// A call of [`give_up`], with the time since the ending signal, if there was one.
    GivenUp(Option<Duration>),
    /// Unloading the library of an FMU took longer than its time limit.
    Overdue,
    /// A function of an FMU did not return: an exception, `pthread_exit` or a cancellation ended the function.
    Unwound,
}

/// The cause of the end of the process and the FMU calls involved.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// The cause.
    pub cause: Cause,
    /// The call that caused the end; if unknown, all calls that had not returned.
    pub calls: Vec<Call>,
    /// The last failure that [`note`] recorded before the end, a possible reason.
    pub before: Option<String>,
}

impl fmt::Display for Call {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.instance)?;
        // Loading and unloading a library have no time.
        if ![LOADING, UNLOADING].contains(&self.function) {
            formatter.write_str(" at t = ")?;
            write_seconds(formatter, self.time)?;
            formatter.write_str(" s")?;
        }
        write!(formatter, ": {}", self.function)
    }
}

impl fmt::Display for Ending {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_ending(formatter, self.calls.iter().cloned(), self.cause)?;
        self.before.as_ref().map_or(Ok(()), |before| write!(formatter, "; before that, {before}"))
    }
}

/// Writes the cause of the end and the calls involved, without heap allocation.
fn write_ending(
    out: &mut impl fmt::Write,
    calls: impl Iterator<Item = Call>,
    cause: Cause,
) -> fmt::Result {
    let mut has_call = false;
    for call in calls {
        write!(out, "{}{call}", if has_call { ", or " } else { "" })?;
        has_call = true;
    }
    if !has_call {
        out.write_str("outside of the calls of FMUs the program or a thread of an FMU")?;
    }
    match cause {
        Cause::Signal(signal) => {
            write!(out, " crashed with signal {signal} ({})", signal_text(signal))
        }
        Cause::Exit(Some(status)) => write!(out, " ended the process by exit({status})"),
        Cause::Exit(None) => out.write_str(" ended the process by exit"),
        Cause::GivenUp(None) => out.write_str(" had not returned"),
        Cause::GivenUp(Some(waited)) => {
            let waited = waited.as_secs_f64();
            write!(out, " has not returned within {waited} s after the signal")
        }
        Cause::Overdue => out.write_str(" does not end: a destructor or an exit handler hangs"),
        Cause::Unwound => out.write_str(
            " was left by an exception of C++, by pthread_exit or by the cancellation of its thread, which \
             no function of an FMU may let out",
        ),
    }
}

/// Returns the name and the meaning of a fatal signal; "no common one" for others.
#[cfg(unix)]
fn signal_text(signal: i32) -> &'static str {
    signals::FATAL.iter().find(|(known, _)| *known == signal).map_or("no common one", |(_, t)| *t)
}

#[cfg(not(unix))]
fn signal_text(_: i32) -> &'static str {
    "no common one"
}

/// Installs `last` as the crash function of this process.
///
/// A fatal signal or an unexpected `exit` then runs `last` in a separate thread, and the process ends
/// with the status that `last` returns. [`give_up`], [`Cause::Overdue`] and [`Cause::Unwound`] run `last` as well, also
/// on systems other than Unix, where signals and `exit` are not handled. If `last` itself crashes, because the FMU
/// overwrote the memory of the program, or does not return in time after a signal or `exit`, one line with the cause
/// and `advice` goes to standard error. Only the first call of `watch` has an effect.
///
/// The separate thread calls `prepare` at its start. `prepare` should use all thread-local data that `last` uses: the
/// first use takes a lock of the dynamic linker, which an FMU that crashes in a constructor of its library holds.
///
/// # Errors
///
/// [`io::Error`] if the operating system refuses the thread or a signal handler.
pub fn watch(
    advice: &'static str,
    prepare: impl FnOnce() + Send + 'static,
    last: impl FnOnce(&Ending) -> u8 + Send + 'static,
) -> io::Result<()> {
    if REPORTER.get().is_some() {
        return Ok(());
    }
    ADVICE.get_or_init(|| advice);
    let (ready, started) = std::sync::mpsc::channel();
    let report = move || {
        #[cfg(unix)]
        signals::mark_reporter();
        prepare();
        // Fails only if `watch` has returned.
        let _ = ready.send(());
        while CAUSE.load(Ordering::Acquire) == 0 {
            std::thread::park();
        }
        leave(last(&ending()));
    };
    let reporter = std::thread::Builder::new().name("crash-report".to_owned()).spawn(report)?;
    if REPORTER.set(reporter.thread().clone()).is_err() {
        return Ok(());
    }
    // Waits for the thread: none can start later, while a library that crashes is being loaded.
    let _ = started.recv();
    #[cfg(unix)]
    signals::install()?;
    Ok(())
}

/// Collects the cause of the end, the calls involved and the last failure.
fn ending() -> Ending {
    let calls = place::calls(PLACE.load(Ordering::Relaxed)).collect();
    // A thread that will never continue may hold the lock.
    let before = LAST_FAILURE.try_lock().ok().and_then(|mut before| before.take());
    Ending { cause: cause(), calls, before }
}

/// Reads the cause of the end.
fn cause() -> Cause {
    match CAUSE.load(Ordering::Acquire) {
        EXIT if cfg!(all(target_os = "linux", target_env = "gnu")) => {
            Cause::Exit(Some(STATUS.load(Ordering::Relaxed)))
        }
        EXIT => Cause::Exit(None),
        GIVEN_UP => {
            let waited = WAITED.load(Ordering::Relaxed);
            Cause::GivenUp((waited > 0).then(|| Duration::from_millis(waited)))
        }
        UNWOUND => Cause::Unwound,
        OVERDUE => Cause::Overdue,
        signal => Cause::Signal(signal),
    }
}

/// Wakes the thread of [`watch`] to report the end. Does nothing if the end has started already or [`watch`] was not
/// called. Signal handlers call this function: therefore it neither allocates nor locks.
fn start_report(cause: i32, place: usize) {
    if let Some(reporter) = REPORTER.get()
        && !ENDING.swap(true, Ordering::AcqRel)
    {
        PLACE.store(place, Ordering::Relaxed);
        CAUSE.store(cause, Ordering::Release);
        reporter.unpark();
    }
}

/// Ends the process as after a crash, because a call of an FMU does not return. `waited` is the time since the ending
/// signal, if there was one. This function returns only if [`watch`] was not called.
pub fn give_up(waited: Option<Duration>) {
    if REPORTER.get().is_some() {
        let waited = waited.map_or(0, |waited| waited.as_millis());
        WAITED.store(u64::try_from(waited).unwrap_or(u64::MAX), Ordering::Relaxed);
        start_report(GIVEN_UP, 0);
        std::thread::sleep(REPORT_LIMIT);
        leave(1);
    }
}

/// Ends the process if a call of the instance that is about to be dropped has not returned. An exception or the end
/// of the thread is then unwinding the stack through that call, and the FMU must not be called any more. Does nothing
/// during a panic of this program.
pub(crate) fn check_returned(slot: &Slot) {
    if !slot.is_entered() || std::thread::panicking() {
        return;
    }
    let address = std::ptr::from_ref(slot).addr();
    if REPORTER.get().is_none() {
        let calls = place::calls(address).collect();
        eprintln!("error: {}", Ending { cause: Cause::Unwound, calls, before: None });
        std::process::abort();
    }
    start_report(UNWOUND, address);
    std::thread::sleep(REPORT_LIMIT);
    leave(1);
}

/// Marks the work of the program as finished with the exit status `status`: later signals and a later `exit` are not
/// reported. Does nothing in a copy of the process that `fork` has made.
pub fn done(status: u8) {
    #[cfg(unix)]
    if signals::is_copy() {
        return;
    }
    RECORD.done.store(i32::from(status) + 1, Ordering::Release);
    #[cfg(target_os = "linux")]
    wake_supervisor();
}

/// The process that supervises this one; 0 if none does.
#[cfg(target_os = "linux")]
static SUPERVISOR: AtomicI32 = AtomicI32::new(0);

/// Sets the process that gets a signal when the program has finished its work.
#[cfg(target_os = "linux")]
pub(crate) fn be_supervised(supervisor: i32) {
    SUPERVISOR.store(supervisor, Ordering::Relaxed);
}

/// Sends the awaited signal to the supervisor, if the supervisor is still the parent of this process.
#[cfg(target_os = "linux")]
fn wake_supervisor() {
    use rustix::process::{Signal, getppid, kill_process};
    let supervisor = SUPERVISOR.load(Ordering::Relaxed);
    if let Some(parent) = getppid().filter(|parent| parent.as_raw_pid() == supervisor) {
        // A parent that has ended needs no signal.
        let _ = kill_process(parent, Signal::CHILD);
    }
}

/// Records that the first step starts.
pub fn begin_steps() {
    RECORD.started.store(true, Ordering::Relaxed);
}

/// Whether the first step has started.
#[must_use]
pub fn has_begun_steps() -> bool {
    RECORD.started.load(Ordering::Relaxed)
}

/// Returns the FMU calls that have not returned.
#[must_use]
pub fn calls() -> Vec<Call> {
    place::calls(0).collect()
}

/// Returns the call of an FMU that this thread executes. In a thread that executes none, for example one that an FMU
/// started, returns the first unfinished call of any instance.
#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
pub(crate) fn call_of_this_thread() -> Option<Call> {
    place::calls(last_of_this_thread()).next()
}

/// Ends the process at once with this status. On Unix neither destructors nor exit handlers run.
pub fn leave(status: u8) -> ! {
    done(status);
    #[cfg(unix)]
    signals::leave(status.into());
    #[cfg(not(unix))]
    std::process::exit(status.into())
}
