//! The master's side of an isolated instance: what passes between it and the worker.

use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use fmu_description::package::Unpacked;

use super::command::{Command, DONE, FAILED, INSTANTIATED, NOT_PRELOADED, function_at, read_error};
use super::layout::Shared;
use super::line::{Line, Seen, Side};
use super::log::Inbox;
use super::process::Process;
use super::words::{Reader, Writer};
use super::worker::refuse_in_worker;
use super::{IsolateError, Options};
use crate::crash::Place;
use slave::{CallError, Failure};

/// Longest sleep between two looks at the messages and at the clock.
const SLICE: Duration = Duration::from_millis(100);
/// How long a worker whose connection has ended may take to end.
const ENDING: Duration = Duration::from_secs(2);
/// How long `fmi2FreeInstance` may take where the calls have no limit.
const FREEING: Duration = Duration::from_secs(10);
/// How long a process may take to become a worker.
const ATTACHING: Duration = Duration::from_secs(20);
/// Most bytes that a worker may answer.
const MOST: usize = u32::MAX as usize;

/// An instance in a process of its own.
///
/// After a call that ended its process every further call gives the same error.
pub struct Isolated {
    line: Line,
    process: Process,
    inbox: Inbox,
    /// Where the instance is, for the end of this process in the midst of a call.
    pub(super) place: Arc<Place>,
    /// The last turn that this side knows of: odd while the worker acts.
    turn: u64,
    /// When the worker was asked for what is not waited for yet, where that matters.
    asked: Option<Instant>,
    /// Why there is no worker any more.
    ended: Option<Failure>,
    /// `fmi2FreeInstance` has been called.
    freed: bool,
    time_limit: Option<Duration>,
    memory_limit: Option<u64>,
    slice: Duration,
    started: Instant,
    /// The unpacked FMU: removed when no instance needs it.
    pub(super) package: Arc<Unpacked>,
}

impl Isolated {
    /// Starts a worker and has it instantiate the FMU.
    pub(super) fn start(
        package: Arc<Unpacked>,
        name: &str,
        options: &Options,
    ) -> Result<Self, IsolateError> {
        let system = |what| {
            let instance = name.to_owned();
            move |source| IsolateError::System { what, instance, source }
        };
        let count = package.description.variables.len();
        refuse_in_worker()?;
        let (shared, memory) = Shared::create(count).map_err(system("no shared memory"))?;
        let (here, there) = UnixStream::pair().map_err(system("no connection"))?;
        let slice = options.time_limit.map_or(SLICE, |limit| (limit / 8).min(SLICE));
        let slice = slice.max(Duration::from_millis(1));
        here.set_read_timeout(Some(slice)).map_err(system("no time limit"))?;
        here.set_write_timeout(Some(slice)).map_err(system("no time limit"))?;
        let executable = options.executable.clone().map_or_else(std::env::current_exe, Ok);
        let executable = executable.map_err(system("no program"))?;
        let process = Process::start(&executable, name, there, memory).map_err(|source| {
            let (executable, instance) = (executable.clone(), name.to_owned());
            IsolateError::Start { executable, instance, source }
        })?;
        let mut isolated = Self {
            line: Line::new(Arc::new(shared), here, Side::Master),
            process,
            inbox: Inbox::new(name),
            place: Place::new(name),
            turn: 0,
            asked: None,
            ended: None,
            freed: false,
            time_limit: options.time_limit,
            memory_limit: options.memory_limit,
            slice,
            started: Instant::now(),
            package,
        };
        let opened = isolated.open(name, options);
        if let (Err(CallError { failure, .. }), false) = (&opened, isolated.is_attached()) {
            let (instance, failure) = (name.to_owned(), failure.clone());
            return Err(IsolateError::NoWorker { executable, instance, failure });
        }
        let made = made(name, opened).map(|()| isolated);
        made.map_err(|error| error.with_limit(options.memory_limit))
    }

    /// Whether the other process has become a worker.
    fn is_attached(&self) -> bool {
        self.line.shared.attached().load(Ordering::Relaxed) != 0
    }

    /// Frees the instance and makes one called `name` in its place, in the same process with the same
    /// library.
    ///
    /// # Errors
    ///
    /// [`IsolateError::Refused`], [`IsolateError::Call`].
    pub fn renew(&mut self, name: &str, options: &Options) -> Result<(), IsolateError> {
        let write = |writer: &mut Writer<'_>| {
            writer.put_bytes(name.as_bytes());
            writer.put(options.logging);
        };
        let done = self.call(Command::Renew, write, outcome);
        self.inbox.rename(name);
        self.place = Place::new(name);
        made(name, done)
    }

    /// Has the worker load and instantiate the FMU: what came of it.
    fn open(&mut self, name: &str, options: &Options) -> Result<(u64, String), CallError> {
        let package = self.package.clone();
        let write = |writer: &mut Writer<'_>| {
            writer.put_bytes(package.folder().as_os_str().as_bytes());
            writer.put_bytes(name.as_bytes());
            writer.put(options.logging);
            writer.put(options.memory_limit.unwrap_or(0));
            writer.put(options.preload.len());
            for library in &options.preload {
                writer.put_bytes(library.as_bytes());
            }
        };
        self.call(Command::Open, write, outcome)
    }

    /// Posts `command` with what `write` writes, and gives what `read` makes of the answer.
    #[inline]
    pub(super) fn call<T>(
        &mut self,
        command: Command,
        write: impl FnOnce(&mut Writer<'_>),
        read: impl FnOnce(&mut Reader<'_>) -> Option<T>,
    ) -> Result<T, CallError> {
        self.post(command, write)?;
        self.answer(command, read)
    }

    /// Posts `command` with what `write` writes. An answer that nobody waited for is waited for and
    /// forgotten first.
    #[inline]
    pub(super) fn post(
        &mut self,
        command: Command,
        write: impl FnOnce(&mut Writer<'_>),
    ) -> Result<(), CallError> {
        if let Some(failure) = &self.ended {
            return Err(error(command, failure.clone()));
        }
        if self.acts()
            && let Err(failure) = self.wait()
        {
            return Err(self.lose(command, failure));
        }
        self.inbox.forget();
        let shared = &self.line.shared;
        let mut writer = Writer::new(shared.area());
        write(&mut writer);
        if !writer.fits() {
            return Err(nonsense(command, "was given more than its shared memory holds"));
        }
        shared.command().store(command.to_word(), Ordering::Relaxed);
        shared.place().store(command.to_word(), Ordering::Relaxed);
        self.place.enter(command.name());
        self.turn = self.turn.wrapping_add(1);
        self.line.post(self.turn);
        Ok(())
    }

    /// Whether the worker has been asked for what is not waited for yet.
    fn acts(&self) -> bool {
        self.turn % 2 == 1
    }

    /// The answer to what was posted will be waited for later: the time of the call runs from now.
    #[inline]
    pub(super) fn left_alone(&mut self) {
        self.asked = self.time_limit.map(|_| Instant::now());
    }

    /// Waits for the answer to `command`, and gives what `read` makes of it.
    #[inline]
    pub(super) fn answer<T>(
        &mut self,
        command: Command,
        read: impl FnOnce(&mut Reader<'_>) -> Option<T>,
    ) -> Result<T, CallError> {
        if let Some(failure) = &self.ended {
            return Err(error(command, failure.clone()));
        }
        if !self.acts() {
            return Err(nonsense(command, "was to be finished and had not been begun"));
        }
        if let Err(failure) = self.wait() {
            return Err(self.lose(command, failure));
        }
        self.place.leave();
        self.inbox.empty(&self.line.shared);
        let mut reader = Reader::new(self.line.shared.area());
        let answer = match reader.take() {
            Some(DONE) => read(&mut reader).map(Ok),
            Some(FAILED) => read_error(command, &mut reader).map(Err),
            _ => None,
        };
        answer.unwrap_or_else(|| Err(self.senseless(command)))
    }

    /// Waits until the worker has answered.
    #[inline]
    fn wait(&mut self) -> Result<(), Failure> {
        let (posted, mut begin) = (self.turn, self.asked.take());
        loop {
            match self.line.wait(posted) {
                Seen::Turn(turn) if turn == posted.wrapping_add(1) => {
                    self.turn = turn;
                    return Ok(());
                }
                seen => self.worry(seen, &mut begin)?,
            }
        }
    }

    /// Judges what was seen instead of an answer. `begin` is when the wait began, as soon as known.
    #[cold]
    fn worry(&mut self, seen: Seen, begin: &mut Option<Instant>) -> Result<(), Failure> {
        let broken = |what: &str| Failure::InvalidAnswer(what.to_owned());
        if let Seen::Turn(_) = seen {
            return Err(broken("is lost: its process wrote over shared memory"));
        }
        if seen == Seen::Closed {
            let ended = self.process.ends_within(ENDING);
            return Err(ended.unwrap_or_else(|| broken("closed the connection to the master")));
        }
        self.inbox.empty(&self.line.shared);
        if let Some(failure) = self.process.ended() {
            return Err(failure);
        }
        // The first look comes one slice after the begin.
        let now = Instant::now();
        let begin = *begin.get_or_insert(now.checked_sub(self.slice).unwrap_or(now));
        if !self.is_attached() && self.started.elapsed() > ATTACHING {
            return Err(Failure::TimedOut(ATTACHING.as_secs_f64()));
        }
        match self.time_limit {
            Some(limit) if now.duration_since(begin) >= limit => {
                Err(Failure::TimedOut(limit.as_secs_f64()))
            }
            _ => Ok(()),
        }
    }

    /// Gives the worker up: the error of `command`.
    #[cold]
    fn lose(&mut self, command: Command, failure: Failure) -> CallError {
        self.process.kill();
        self.place.leave();
        let shared = &self.line.shared;
        self.inbox.empty(shared);
        let place = shared.place().load(Ordering::Relaxed);
        let function = function_at(place).unwrap_or(command.function());
        let failure = match self.memory_limit {
            Some(limit) if shared.no_memory().load(Ordering::Relaxed) != 0 => {
                Failure::OutOfMemory(limit)
            }
            _ => failure,
        };
        self.ended = Some(failure.clone());
        CallError { function, failure, messages: self.inbox.take() }
    }

    /// Brings `bytes` to the worker, for the next command.
    pub(super) fn bring(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let most = 8 * self.line.shared.area().len().saturating_sub(2);
        let mut first = true;
        for piece in bytes.chunks(most) {
            let write = |writer: &mut Writer<'_>| {
                writer.put(first);
                writer.put_bytes(piece);
            };
            self.call(Command::Bring, write, |_| Some(()))?;
            first = false;
        }
        Ok(())
    }

    /// The `total` bytes that the answer to `command` left with the worker.
    pub(super) fn fetch(&mut self, command: Command, total: usize) -> Result<Vec<u8>, CallError> {
        let mut bytes = Vec::new();
        let limit = total.min(MOST);
        while bytes.len() < limit {
            let (before, offset) = (bytes.len(), bytes.len());
            let write = |writer: &mut Writer<'_>| writer.put(offset);
            self.call(Command::Fetch, write, |reader| reader.take_bytes(&mut bytes))?;
            if bytes.len() == before {
                break;
            }
        }
        if bytes.len() != total {
            let what = format!("announced {total} bytes and gave {}", bytes.len());
            return Err(self.lose(command, Failure::InvalidAnswer(what)));
        }
        Ok(bytes)
    }

    /// The error that the answer to `command` makes no sense.
    pub(super) fn senseless(&mut self, command: Command) -> CallError {
        let what = "left an answer that makes no sense: its process wrote over shared memory";
        self.lose(command, Failure::InvalidAnswer(what.to_owned()))
    }

    /// The process of the worker.
    #[must_use]
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }
}

impl Isolated {
    /// Has the worker free the instance and end, if it has not; one that does not is ended.
    pub(super) fn free_instance(&mut self) -> Result<(), CallError> {
        if self.freed || self.ended.is_some() {
            return Ok(());
        }
        self.freed = true;
        self.time_limit = Some(self.time_limit.unwrap_or(FREEING).min(FREEING));
        self.call(Command::Free, |_| (), |_| Some(()))?;
        self.process.ends_within(ENDING);
        Ok(())
    }
}

impl Drop for Isolated {
    fn drop(&mut self) {
        if let Err(error) = self.free_instance() {
            self.inbox.complain(&error);
        }
    }
}

/// What came of an instantiation, and the reason.
fn outcome(reader: &mut Reader<'_>) -> Option<(u64, String)> {
    let outcome: u64 = reader.take()?;
    let reason = if outcome == INSTANTIATED { String::new() } else { reader.take_text()? };
    Some((outcome, reason))
}

fn made(name: &str, answer: Result<(u64, String), CallError>) -> Result<(), IsolateError> {
    let instance = name.to_owned();
    match answer {
        Ok((INSTANTIATED, _)) => Ok(()),
        Ok((NOT_PRELOADED, reason)) => Err(IsolateError::Preload { reason }),
        Ok((_, reason)) => Err(IsolateError::Refused { instance, reason }),
        Err(source) => Err(IsolateError::Call { instance, source }),
    }
}

fn error(command: Command, failure: Failure) -> CallError {
    CallError { function: command.function(), failure, messages: Vec::new() }
}

#[cold]
fn nonsense(command: Command, what: &str) -> CallError {
    error(command, Failure::InvalidAnswer(what.to_owned()))
}
