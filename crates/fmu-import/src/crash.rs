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

use std::fmt::{self, Write as _};
use std::io;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicUsize, Ordering};
use std::thread::Thread;
use std::time::Duration;

pub use place::Name;
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

/// What is advised where the program's last function cannot say it.
static ADVICE: OnceLock<&'static str> = OnceLock::new();

/// A call of a function of an FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The instance.
    pub instance: Name,
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

impl fmt::Display for Call {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} at t = {} s: {}", self.instance, self.time, self.function)
    }
}

impl fmt::Display for Ending {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        tell(formatter, self.calls.iter().cloned(), self.cause)
    }
}

/// Writes how the process comes to its end, without the heap.
fn tell(out: &mut impl fmt::Write, calls: impl Iterator<Item = Call>, cause: Cause) -> fmt::Result {
    let mut told = false;
    for call in calls {
        write!(out, "{}{call}", if told { ", or " } else { "" })?;
        told = true;
    }
    if !told {
        out.write_str("outside of the calls of FMUs the program or a thread of an FMU")?;
    }
    match cause {
        Cause::Signal(signal) => {
            write!(out, " crashed with signal {signal} ({})", signal_text(signal))
        }
        Cause::Exit(Some(status)) => write!(out, " ended the process by exit({status})"),
        Cause::Exit(None) => out.write_str(" ended the process by exit"),
        Cause::GivenUp => out.write_str(" does not return"),
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
/// other systems only [`give_up`] calls it. Where `last` itself crashes, because the FMU wrote over
/// the memory of the program, standard error gets one line about the end, with `advice`. The first
/// call counts.
///
/// # Errors
///
/// Where the thread or the signal handlers are refused.
pub fn watch(
    advice: &'static str,
    last: impl FnOnce(&Ending) -> u8 + Send + 'static,
) -> io::Result<()> {
    if KEEPER.get().is_some() {
        return Ok(());
    }
    ADVICE.get_or_init(|| advice);
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
    Ending { cause: cause(), calls: place::calls(PLACE.load(Ordering::Relaxed)).collect() }
}

/// What ends the process.
fn cause() -> Cause {
    match CAUSE.load(Ordering::Acquire) {
        EXIT if cfg!(all(target_os = "linux", target_env = "gnu")) => {
            Cause::Exit(Some(STATUS.load(Ordering::Relaxed)))
        }
        EXIT => Cause::Exit(None),
        GIVEN_UP => Cause::GivenUp,
        signal => Cause::Signal(signal),
    }
}

/// A line for standard error that is written without the heap; what is beyond its end is cut.
struct Line {
    bytes: [u8; 1024],
    length: usize,
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

/// What is said where the program's last function does not come to its end.
fn last_words() -> Line {
    let mut line = Line { bytes: [b'\n'; 1024], length: 0 };
    // A line that is too long is cut.
    let _ = write_last_words(&mut line);
    line.length = (line.length + 1).min(line.bytes.len());
    line
}

fn write_last_words(line: &mut Line) -> fmt::Result {
    line.write_str("error: ")?;
    tell(line, place::calls(PLACE.load(Ordering::Relaxed)), cause())?;
    line.write_str(", and this program could not end in order: the last results may be lost; ")?;
    line.write_str(ADVICE.get().copied().unwrap_or_default())
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
    place::calls(0).collect()
}

/// Ends the process at once: no destructor runs, neither of this program nor of an FMU.
pub fn leave(status: u8) -> ! {
    #[cfg(unix)]
    signals::leave(status.into());
    #[cfg(not(unix))]
    std::process::exit(status.into())
}
