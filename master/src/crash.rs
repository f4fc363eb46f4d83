//! The end of a process in which FMUs run, where an FMU forces it: a fatal signal, `exit`, a call
//! that does not return.
//!
//! [`watch`] is for programs, not for libraries: it installs signal handlers. After it an FMU that
//! crashes in this process or calls `exit` is reported to a function of the program, which runs in a
//! thread of its own while the FMU's thread stands still: it can log, hand over what is still to be
//! written, and remove files. The process then ends with the exit status that it gives.

mod place;
#[cfg(unix)]
mod signals;

use std::fmt;
use std::io;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicUsize, Ordering};
use std::thread::Thread;
use std::time::Duration;

pub(crate) use place::{Place, Slot, last_of_this_thread};

/// How long the program's last function may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// The end of the process has begun.
static BEGUN: AtomicBool = AtomicBool::new(false);
/// The process may end by `exit`: its work is done.
static DONE: AtomicBool = AtomicBool::new(false);
/// What ends it: a signal's number, or one of the two below; 0 while nothing does.
static CAUSE: AtomicI32 = AtomicI32::new(0);
const EXIT: i32 = -1;
const GIVEN_UP: i32 = -2;
/// The status that `exit` was called with.
static STATUS: AtomicI32 = AtomicI32::new(0);
/// The place that the ending thread entered last.
static PLACE: AtomicUsize = AtomicUsize::new(0);
/// The thread that runs the program's last function.
static KEEPER: OnceLock<Thread> = OnceLock::new();

/// A call of a function of an FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The instance.
    pub instance: String,
    /// The function of the standard, or what else was being done.
    pub function: &'static str,
    /// Time in s at which the instance was.
    pub time: f64,
}

/// What ends the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A signal: its number.
    Signal(i32),
    /// `exit`, with that status where it is known.
    Exit(Option<i32>),
    /// [`give_up`].
    GivenUp,
}

/// How the process comes to its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// Why.
    pub cause: Cause,
    /// The call that caused it; where that is not known, all calls that have not returned.
    pub calls: Vec<Call>,
}

impl fmt::Display for Ending {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for Call { instance, function, time } in &self.calls {
            write!(formatter, "{separator}{instance} at t = {time} s: {function}")?;
            separator = ", or ";
        }
        if self.calls.is_empty() {
            formatter
                .write_str("outside of the calls of FMUs the program or a thread of an FMU")?;
        }
        match self.cause {
            Cause::Signal(signal) => {
                write!(formatter, " crashed with signal {signal} ({})", signal_text(signal))
            }
            Cause::Exit(Some(status)) => write!(formatter, " ended the process by exit({status})"),
            Cause::Exit(None) => formatter.write_str(" ended the process by exit"),
            Cause::GivenUp => formatter.write_str(" does not return"),
        }
    }
}

/// Name and meaning of a signal.
#[cfg(unix)]
fn signal_text(signal: i32) -> &'static str {
    signals::FATAL.iter().find(|(known, _)| *known == signal).map_or("no common one", |(_, t)| *t)
}

#[cfg(not(unix))]
fn signal_text(_: i32) -> &'static str {
    "no common one"
}

/// From now on a fatal signal and an unexpected `exit` in this process call `last` in a thread of
/// its own, and the process ends with the status that it returns. Signals are watched on Unix; on
/// other systems only [`give_up`] calls it. The first call counts.
///
/// # Errors
///
/// Where the thread or the signal handlers are refused.
pub fn watch(last: impl FnOnce(&Ending) -> u8 + Send + 'static) -> io::Result<()> {
    if KEEPER.get().is_some() {
        return Ok(());
    }
    let keep = move || {
        #[cfg(unix)]
        signals::keep();
        while CAUSE.load(Ordering::Acquire) == 0 {
            std::thread::park();
        }
        leave(last(&ending()));
    };
    let keeper = std::thread::Builder::new().name("keeper".to_owned()).spawn(keep)?;
    if KEEPER.set(keeper.thread().clone()).is_err() {
        return Ok(());
    }
    #[cfg(unix)]
    signals::install()?;
    Ok(())
}

/// What is known of the end.
fn ending() -> Ending {
    let cause = match CAUSE.load(Ordering::Acquire) {
        EXIT if cfg!(all(target_os = "linux", target_env = "gnu")) => {
            Cause::Exit(Some(STATUS.load(Ordering::Relaxed)))
        }
        EXIT => Cause::Exit(None),
        GIVEN_UP => Cause::GivenUp,
        signal => Cause::Signal(signal),
    };
    Ending { cause, calls: place::calls(PLACE.load(Ordering::Relaxed)) }
}

/// Hands the end over to the thread of [`watch`]. Nothing here allocates or takes a lock: signal
/// handlers call it. False where the end has begun already, or nobody watches.
fn begin(cause: i32, place: usize) -> bool {
    let Some(keeper) = KEEPER.get() else { return false };
    if BEGUN.swap(true, Ordering::AcqRel) {
        return false;
    }
    PLACE.store(place, Ordering::Relaxed);
    CAUSE.store(cause, Ordering::Release);
    keeper.unpark();
    true
}

/// Ends the process in the way of a crash: for a program whose FMU does not return. Returns only
/// where [`watch`] was not called.
pub fn give_up() {
    if KEEPER.get().is_some() {
        begin(GIVEN_UP, 0);
        std::thread::sleep(PATIENCE);
        leave(1);
    }
}

/// The work of the program is done: an `exit` from now on is its own.
pub fn done() {
    DONE.store(true, Ordering::Relaxed);
}

/// The calls of FMUs that have not returned.
#[must_use]
pub fn calls() -> Vec<Call> {
    place::calls(0)
}

/// Ends the process at once: no destructor runs, neither of this program nor of an FMU.
pub fn leave(status: u8) -> ! {
    #[cfg(unix)]
    signals::leave(status.into());
    #[cfg(not(unix))]
    std::process::exit(status.into())
}
