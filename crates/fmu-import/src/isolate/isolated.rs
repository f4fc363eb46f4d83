//! The master's side of an isolated instance.

use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use fmu_description::package::Unpacked;

use super::channel::{Channel, Side, WaitResult};
use super::command::{Command, DONE, FAILED, INSTANTIATED, NOT_PRELOADED, function_at, read_error};
use super::layout::Shared;
use super::log::Inbox;
use super::process::Process;
use super::words::{Reader, Writer};
use super::worker::refuse_in_worker;
use super::{IsolateError, Options};
use crate::crash::Place;
use slave::{CallError, Failure};

/// Longest wait between two checks of messages and time limits.
const SLICE: Duration = Duration::from_millis(100);
/// Time limit for the end of a worker that has closed the connection.
const END_LIMIT: Duration = Duration::from_secs(2);
/// Time limit of `fmi2FreeInstance` if the calls have no limit.
const FREE_LIMIT: Duration = Duration::from_secs(10);
/// Time limit for a new process to become a worker.
const START_LIMIT: Duration = Duration::from_secs(20);
/// Maximum number of bytes of an answer.
const MAX_ANSWER: usize = u32::MAX as usize;

/// An instance in a process of its own.
///
/// After a call that ended the process every further call returns the same error.
pub struct Isolated {
    channel: Channel,
    process: Process,
    inbox: Inbox,
    /// The current function and time of the instance, for a report if this process ends during a call.
    pub(super) place: Arc<Place>,
    /// The last known turn: odd while a command is pending.
    turn: u64,
    /// When the pending command of [`Isolated::start_timer`] was posted, if there is a time limit.
    posted_at: Option<Instant>,
    /// Why the worker ended; `None` while it runs.
    ended: Option<Failure>,
    /// Whether `fmi2FreeInstance` has been called.
    freed: bool,
    time_limit: Option<Duration>,
    memory_limit: Option<u64>,
    slice: Duration,
    started: Instant,
    /// The unpacked FMU, removed with its last instance.
    pub(super) package: Arc<Unpacked>,
}

impl Isolated {
    /// Starts a worker, which loads and instantiates the FMU.
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
        let (shared, memory) =
            Shared::create(count).map_err(system("cannot create shared memory"))?;
        let (here, there) = UnixStream::pair().map_err(system("cannot create a connection"))?;
        let slice = options.time_limit.map_or(SLICE, |limit| (limit / 8).min(SLICE));
        let slice = slice.max(Duration::from_millis(1));
        here.set_read_timeout(Some(slice)).map_err(system("cannot set a time limit"))?;
        here.set_write_timeout(Some(slice)).map_err(system("cannot set a time limit"))?;
        let executable = options.executable.clone().map_or_else(std::env::current_exe, Ok);
        let executable = executable.map_err(system("cannot find this program's file"))?;
        let process = Process::start(&executable, name, there, memory).map_err(|source| {
            let (executable, instance) = (executable.clone(), name.to_owned());
            IsolateError::Start { executable, instance, source }
        })?;
        let mut isolated = Self {
            channel: Channel::new(Arc::new(shared), here, Side::Master),
            process,
            inbox: Inbox::new(name),
            place: Place::new(name),
            turn: 0,
            posted_at: None,
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
        let started = check_outcome(name, opened).map(|()| isolated);
        started.map_err(|error| error.with_limit(options.memory_limit))
    }

    /// Returns whether the process has become a worker.
    fn is_attached(&self) -> bool {
        self.channel.shared.attached().load(Ordering::Relaxed) != 0
    }

    /// Frees the instance and creates the instance `name` in the same process with the same library.
    ///
    /// # Errors
    ///
    /// [`IsolateError::Refused`] if the FMU does not instantiate; [`IsolateError::Call`] if the worker
    /// ends or does not answer.
    pub fn renew(&mut self, name: &str, options: &Options) -> Result<(), IsolateError> {
        let write = |writer: &mut Writer<'_>| {
            writer.put_bytes(name.as_bytes());
            writer.put(options.logging);
        };
        let done = self.call(Command::Renew, write, read_outcome);
        self.inbox.rename(name);
        self.place = Place::new(name);
        check_outcome(name, done)
    }

    /// Lets the worker load and instantiate the FMU; returns the outcome and its reason.
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
        self.call(Command::Open, write, read_outcome)
    }

    /// Posts `command` with the arguments that `write` writes; returns the results that `read` reads.
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

    /// Posts `command` with the arguments that `write` writes. Waits for a pending command first and
    /// discards its answer.
    #[inline]
    pub(super) fn post(
        &mut self,
        command: Command,
        write: impl FnOnce(&mut Writer<'_>),
    ) -> Result<(), CallError> {
        if let Some(failure) = &self.ended {
            return Err(error(command, failure.clone()));
        }
        if self.is_pending()
            && let Err(failure) = self.wait()
        {
            return Err(self.abandon(command, failure));
        }
        self.inbox.clear();
        let shared = &self.channel.shared;
        let mut writer = Writer::new(shared.area());
        write(&mut writer);
        if !writer.fits() {
            return Err(protocol_error(
                command,
                "needs more arguments than the shared memory holds",
            ));
        }
        shared.command().store(command.to_word(), Ordering::Relaxed);
        shared.place().store(command.to_word(), Ordering::Relaxed);
        self.place.enter(command.name());
        self.turn = self.turn.wrapping_add(1);
        self.channel.post(self.turn);
        Ok(())
    }

    /// Returns whether a command is pending.
    fn is_pending(&self) -> bool {
        self.turn % 2 == 1
    }

    /// Starts the time limit of the posted command now, because its answer is awaited later.
    #[inline]
    pub(super) fn start_timer(&mut self) {
        self.posted_at = self.time_limit.map(|_| Instant::now());
    }

    /// Waits for the answer to `command`; returns the results that `read` reads.
    #[inline]
    pub(super) fn answer<T>(
        &mut self,
        command: Command,
        read: impl FnOnce(&mut Reader<'_>) -> Option<T>,
    ) -> Result<T, CallError> {
        if let Some(failure) = &self.ended {
            return Err(error(command, failure.clone()));
        }
        if !self.is_pending() {
            return Err(protocol_error(command, "was not started before it was finished"));
        }
        if let Err(failure) = self.wait() {
            return Err(self.abandon(command, failure));
        }
        self.place.leave();
        self.inbox.drain(&self.channel.shared);
        let mut reader = Reader::new(self.channel.shared.area());
        let answer = match reader.take() {
            Some(DONE) => read(&mut reader).map(Ok),
            Some(FAILED) => read_error(command, &mut reader).map(Err),
            _ => None,
        };
        answer.unwrap_or_else(|| Err(self.invalid_answer(command)))
    }

    /// Waits until the worker has answered.
    #[inline]
    fn wait(&mut self) -> Result<(), Failure> {
        let (posted, mut start) = (self.turn, self.posted_at.take());
        loop {
            match self.channel.wait(posted) {
                WaitResult::Turn(turn) if turn == posted.wrapping_add(1) => {
                    self.turn = turn;
                    return Ok(());
                }
                result => self.check_timeout(result, &mut start)?,
            }
        }
    }

    /// Returns why no answer can come, or `Ok` if the wait may go on. Sets `start` to the start of the
    /// wait if it is unknown.
    #[cold]
    fn check_timeout(
        &mut self,
        result: WaitResult,
        start: &mut Option<Instant>,
    ) -> Result<(), Failure> {
        let broken = |what: &str| Failure::InvalidAnswer(what.to_owned());
        if let WaitResult::Turn(_) = result {
            return Err(broken("is lost: its process wrote over shared memory"));
        }
        if result == WaitResult::Closed {
            let ended = self.process.wait_for_end(END_LIMIT);
            return Err(ended.unwrap_or_else(|| broken("closed the connection to the master")));
        }
        self.inbox.drain(&self.channel.shared);
        if let Some(failure) = self.process.ended() {
            return Err(failure);
        }
        // The first check happens one slice after the start.
        let now = Instant::now();
        let start = *start.get_or_insert(now.checked_sub(self.slice).unwrap_or(now));
        if !self.is_attached() && self.started.elapsed() > START_LIMIT {
            return Err(Failure::TimedOut(START_LIMIT.as_secs_f64()));
        }
        match self.time_limit {
            Some(limit) if now.duration_since(start) >= limit => {
                Err(Failure::TimedOut(limit.as_secs_f64()))
            }
            _ => Ok(()),
        }
    }

    /// Kills the worker after a failure; returns the error of `command`.
    #[cold]
    fn abandon(&mut self, command: Command, failure: Failure) -> CallError {
        self.process.kill();
        self.place.leave();
        let shared = &self.channel.shared;
        self.inbox.drain(shared);
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

    /// Sends `bytes` to the worker for the next command.
    pub(super) fn upload(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let most = 8 * self.channel.shared.area().len().saturating_sub(2);
        let mut first = true;
        for piece in bytes.chunks(most) {
            let write = |writer: &mut Writer<'_>| {
                writer.put(first);
                writer.put_bytes(piece);
            };
            self.call(Command::Upload, write, |_| Some(()))?;
            first = false;
        }
        Ok(())
    }

    /// Receives the `total` bytes that the worker holds after `command`.
    pub(super) fn download(
        &mut self,
        command: Command,
        total: usize,
    ) -> Result<Vec<u8>, CallError> {
        let mut bytes = Vec::new();
        let limit = total.min(MAX_ANSWER);
        while bytes.len() < limit {
            let (before, offset) = (bytes.len(), bytes.len());
            let write = |writer: &mut Writer<'_>| writer.put(offset);
            self.call(Command::Download, write, |reader| reader.take_bytes(&mut bytes))?;
            if bytes.len() == before {
                break;
            }
        }
        if bytes.len() != total {
            let what = format!("announced {total} bytes and sent {}", bytes.len());
            return Err(self.abandon(command, Failure::InvalidAnswer(what)));
        }
        Ok(bytes)
    }

    /// Kills the worker because its answer to `command` cannot be decoded; returns the error.
    pub(super) fn invalid_answer(&mut self, command: Command) -> CallError {
        let what = "returned an invalid answer: its process wrote over shared memory";
        self.abandon(command, Failure::InvalidAnswer(what.to_owned()))
    }

    /// Returns the process identifier of the worker.
    #[must_use]
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }
}

impl Isolated {
    /// Lets the worker free the instance and end. Does nothing if that has happened already.
    pub(super) fn free_instance(&mut self) -> Result<(), CallError> {
        if self.freed || self.ended.is_some() {
            return Ok(());
        }
        self.freed = true;
        self.time_limit = Some(self.time_limit.unwrap_or(FREE_LIMIT).min(FREE_LIMIT));
        self.call(Command::Free, |_| (), |_| Some(()))?;
        self.process.wait_for_end(END_LIMIT);
        Ok(())
    }
}

impl Drop for Isolated {
    fn drop(&mut self) {
        if let Err(error) = self.free_instance() {
            self.inbox.log_error(&error);
        }
    }
}

/// Reads the outcome of an instantiation and its reason.
fn read_outcome(reader: &mut Reader<'_>) -> Option<(u64, String)> {
    let outcome: u64 = reader.take()?;
    let reason = if outcome == INSTANTIATED { String::new() } else { reader.take_text()? };
    Some((outcome, reason))
}

/// Converts the outcome of an instantiation to a result.
fn check_outcome(name: &str, answer: Result<(u64, String), CallError>) -> Result<(), IsolateError> {
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
fn protocol_error(command: Command, what: &str) -> CallError {
    error(command, Failure::InvalidAnswer(what.to_owned()))
}
