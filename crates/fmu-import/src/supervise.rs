//! Supervision: the program works in a child process; this process waits for the child and reports its end.
//!
//! [`split`] is for programs, before they start a thread. An FMU can end its process by `_exit`, or install a signal
//! handler of its own; the supervisor can still name the FMU, its last function and the time.
#![expect(unsafe_code, reason = "fork, signals, and a page of memory that two processes share")]

use std::fmt;
use std::io;
use std::mem::MaybeUninit;
use std::ptr::{from_ref, null_mut};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use libc::{c_int, siginfo_t, sigset_t};
use rustix::io::Errno;
use rustix::process::{
    Pid, Signal, WaitOptions, getpgid, getpgrp, getpid, getppid, kill_process,
    set_parent_process_death_signal, waitpid,
};

use crate::crash::{self, Call, ENDING_SIGNALS, RECORD, ignores_hangup};

/// Time limit for the child to end after the work of the program: on a machine with other work, the exit handlers of a
/// runtime, such as Python's, take seconds.
const AFTER_WORK: Duration = Duration::from_secs(5);
/// Time after an ending signal for which the child may stay in the same calls of FMUs before it is killed.
const AFTER_SIGNAL: Duration = Duration::from_secs(8);
/// Interval between two checks of these time limits.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Number of 64-bit words that both processes share for the program: 2 MiB, of which the system allocates only the
/// pages that are used.
const WORDS: usize = 1 << 18;
/// The memory that the program and its supervisor share.
static MEMORY: OnceLock<&'static [AtomicU64]> = OnceLock::new();

/// The end of the process of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The process exited with this status; -1 if the system does not know it.
    Exited(i32),
    /// This signal ended the process.
    Killed(i32),
    /// The supervisor killed the process because an FMU kept it from ending.
    Stuck,
}

impl fmt::Display for End {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            End::Exited(status) => write!(formatter, "ended the process with exit status {status}"),
            End::Killed(signal) => {
                write!(formatter, "ended the process by signal {signal} ({})", signal_name(*signal))
            }
            End::Stuck => formatter.write_str("kept the process from ending, and was killed"),
        }
    }
}

/// The end of the program's process and its state at this time.
#[derive(Clone, Debug)]
pub struct Ended {
    /// Cause of the end.
    pub end: End,
    /// The exit status that the program chose; `None` if the process ended before.
    pub status: Option<u8>,
    /// The calls of FMUs that had not returned at the end.
    pub calls: Vec<Call>,
    /// Whether the first communication step had started.
    pub has_begun_steps: bool,
}

/// Splits the program into two processes. In the child, which does the work, returns `None` at once. In the
/// supervisor, waits for the child and returns how it ended. Call this function before the program starts a thread.
///
/// # Errors
///
/// [`io::Error`] if the operating system refuses the memory, the signal mask or the process. The program can then work
/// without a supervisor.
pub fn split() -> io::Result<Option<Ended>> {
    share_record()?;
    share_memory()?;
    let signals = Signals::block()?;
    let supervisor = getpid();
    // SAFETY: this process has one thread.
    let child = unsafe { libc::fork() };
    if child < 0 {
        let error = io::Error::last_os_error();
        signals.restore();
        return Err(error);
    }
    if let Some(child) = Pid::from_raw(child) {
        return Ok(Some(Watch { child, signals, standstill: None }.end()));
    }
    signals.restore();
    crash::be_supervised(supervisor.as_raw_pid());
    end_with(supervisor);
    Ok(None)
}

/// Replaces the pages of [`RECORD`], which are still zero, by memory that a forked process shares.
fn share_record() -> io::Result<()> {
    let (protection, flags) = (
        libc::PROT_READ | libc::PROT_WRITE,
        libc::MAP_SHARED | libc::MAP_ANONYMOUS | libc::MAP_FIXED,
    );
    let (address, length) = (from_ref(&RECORD).cast_mut().cast(), size_of_val(&RECORD));
    // SAFETY: the pages of a static that is aligned to pages and fills them, and of which no thread holds a
    // reference yet; its fields are atomics, for which zeros are the values that they have.
    let mapped = unsafe { libc::mmap(address, length, protection, flags, -1, 0) };
    if mapped == libc::MAP_FAILED { Err(io::Error::last_os_error()) } else { Ok(()) }
}

/// Sets [`MEMORY`] to new memory of zeros that a forked process shares.
fn share_memory() -> io::Result<()> {
    let (protection, flags) =
        (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_SHARED | libc::MAP_ANONYMOUS);
    let length = WORDS * size_of::<AtomicU64>();
    // SAFETY: a new mapping at an address that the system chooses.
    let mapped = unsafe { libc::mmap(null_mut(), length, protection, flags, -1, 0) };
    if mapped == libc::MAP_FAILED {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: a mapping of this length, aligned to pages and never unmapped; both processes access it by
    // atomics only, for which zeros are valid.
    let words = unsafe { std::slice::from_raw_parts(mapped.cast::<AtomicU64>(), WORDS) };
    // Set once: a program splits once.
    let _ = MEMORY.set(words);
    Ok(())
}

/// Returns memory of zeros that the process of the program and its supervisor share, for the program's use;
/// `None` in a program that was not split.
#[must_use]
pub fn memory() -> Option<&'static [AtomicU64]> {
    MEMORY.get().copied()
}

/// Lets the system kill this process when `supervisor` ends; ends it at once if its parent is another process.
fn end_with(supervisor: Pid) {
    // Fails only for an invalid signal.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    if getppid() != Some(supervisor) {
        crash::leave(1);
    }
}

/// The blocked signals for which the supervisor waits.
struct Signals {
    set: sigset_t,
    /// The signals that were blocked before, to be restored.
    former_mask: sigset_t,
}

impl Signals {
    /// Blocks the ending signals (SIGHUP only if it is not ignored), SIGCHLD and SIGTSTP.
    fn block() -> io::Result<Self> {
        let (mut set, mut former_mask) = (MaybeUninit::zeroed(), MaybeUninit::zeroed());
        let ignores_hangup = ignores_hangup();
        // SAFETY: sets of signals to write to, and numbers of signals.
        unsafe {
            libc::sigemptyset(set.as_mut_ptr());
            let ending = ENDING_SIGNALS.into_iter();
            let ending = ending.filter(|signal| *signal != libc::SIGHUP || !ignores_hangup);
            for signal in ending.chain([libc::SIGCHLD, libc::SIGTSTP]) {
                libc::sigaddset(set.as_mut_ptr(), signal);
            }
            if libc::sigprocmask(libc::SIG_BLOCK, set.as_ptr(), former_mask.as_mut_ptr()) != 0 {
                return Err(io::Error::last_os_error());
            }
            Ok(Self { set: set.assume_init(), former_mask: former_mask.assume_init() })
        }
    }

    fn restore(&self) {
        // SAFETY: a set of signals to read, and no set to write to.
        unsafe { libc::sigprocmask(libc::SIG_SETMASK, &raw const self.former_mask, null_mut()) };
    }

    /// Waits for one of the signals, up to `limit` if there is one. Returns its number and whether the kernel sent it,
    /// as it does to the whole process group for the keys of a terminal; `None` after the limit.
    fn wait(&self, limit: Option<Duration>) -> Option<(c_int, bool)> {
        let mut info = MaybeUninit::<siginfo_t>::zeroed();
        let time = limit.map(|limit| libc::timespec {
            tv_sec: limit.as_secs().cast_signed(),
            tv_nsec: limit.subsec_nanos().into(),
        });
        let time = time.as_ref().map_or(std::ptr::null(), from_ref);
        // SAFETY: a set, a structure to write to, and null or a time.
        let signal = unsafe { libc::sigtimedwait(&raw const self.set, info.as_mut_ptr(), time) };
        // SAFETY: all zeros is a valid value of the structure.
        let by_kernel = unsafe { info.assume_init() }.si_code > 0;
        (signal > 0).then_some((signal, by_kernel))
    }
}

/// The supervision of one process.
struct Watch {
    child: Pid,
    signals: Signals,
    /// The calls of the process; `None` until an ending signal arrives.
    standstill: Option<Standstill>,
}

/// The FMU calls that have not returned, and the time since which this set of calls has not changed.
struct Standstill {
    since: Instant,
    calls: Vec<Call>,
}

impl Watch {
    /// Waits for the end of the process, and kills it if an FMU keeps it from ending.
    fn end(mut self) -> Ended {
        let mut finished_at: Option<Instant> = None;
        let end = loop {
            if let Some(end) = self.reap() {
                break end;
            }
            if chosen_status().is_some() && finished_at.is_none() {
                finished_at = Some(Instant::now());
            }
            let is_late = finished_at.is_some_and(|since| since.elapsed() > AFTER_WORK);
            if is_late || self.is_stuck() {
                self.send(Signal::KILL);
                while let Err(Errno::INTR) = waitpid(Some(self.child), WaitOptions::empty()) {}
                break End::Stuck;
            }
            let is_ending = finished_at.is_some() || self.standstill.is_some();
            let limit = is_ending.then_some(CHECK_INTERVAL);
            if let Some((signal, by_kernel)) = self.signals.wait(limit) {
                self.pass_on(signal, by_kernel);
            }
        };
        Ended {
            end,
            status: chosen_status(),
            calls: crash::calls(),
            has_begun_steps: crash::has_begun_steps(),
        }
    }

    /// Passes a signal on to the process, unless the terminal has sent it to both processes. SIGTSTP stops both
    /// processes.
    fn pass_on(&mut self, signal: c_int, by_kernel: bool) {
        match signal {
            libc::SIGCHLD => {}
            libc::SIGTSTP => {
                self.send(Signal::STOP);
                // This process stops until it gets SIGCONT.
                let _ = kill_process(getpid(), Signal::STOP);
                self.send(Signal::CONT);
            }
            _ => {
                let together = getpgid(Some(self.child)) == Ok(getpgrp());
                let by_terminal = by_kernel && [libc::SIGINT, libc::SIGHUP].contains(&signal);
                if let (false, Some(signal)) =
                    (by_terminal && together, Signal::from_named_raw(signal))
                {
                    self.send(signal);
                }
                let standstill = || Standstill { since: Instant::now(), calls: crash::calls() };
                self.standstill.get_or_insert_with(standstill);
            }
        }
    }

    /// Returns whether the process has been in the same calls for longer than [`AFTER_SIGNAL`] since an ending signal.
    fn is_stuck(&mut self) -> bool {
        let Some(standstill) = &mut self.standstill else { return false };
        let calls = crash::calls();
        if calls.is_empty() || calls != standstill.calls {
            *standstill = Standstill { since: Instant::now(), calls };
        }
        standstill.since.elapsed() > AFTER_SIGNAL
    }

    /// Sends a signal to the process, whose identifier is valid because it has not been reaped.
    fn send(&self, signal: Signal) {
        // Fails only if the process has ended.
        let _ = kill_process(self.child, signal);
    }

    /// Returns the cause of the end of the process; `None` while the process runs.
    fn reap(&self) -> Option<End> {
        let Ok(ended) = waitpid(Some(self.child), WaitOptions::NOHANG) else {
            return Some(End::Exited(-1));
        };
        let (_, status) = ended?;
        let killed = status.terminating_signal().map(End::Killed);
        killed.or_else(|| status.exit_status().map(End::Exited))
    }
}

/// Returns the exit status that the program chose; `None` before.
fn chosen_status() -> Option<u8> {
    u8::try_from(RECORD.done.load(Ordering::Acquire) - 1).ok()
}

/// Returns the name of a signal, or "no common one".
pub(crate) fn signal_name(signal: i32) -> &'static str {
    macro_rules! names {
        ($($name:ident)*) => {
            match signal {
                $(libc::$name => stringify!($name),)*
                _ => "no common one",
            }
        };
    }
    names! {
        SIGHUP SIGINT SIGQUIT SIGILL SIGTRAP SIGABRT SIGBUS SIGFPE SIGKILL SIGUSR1 SIGSEGV SIGUSR2 SIGPIPE SIGALRM
        SIGTERM SIGXCPU SIGXFSZ SIGVTALRM SIGPROF SIGIO SIGSYS
    }
}
