//! The master's side of an isolated instance.

use std::collections::HashMap;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use fmu_description::package::Unpacked;
use fmu_description::{Causality, ModelDescription, Version};

use super::channel::{Channel, Side, WaitResult};
use super::function::Function;
use super::layout::Shared;
use super::log::Inbox;
use super::message::Opening;
use super::perform::VALUES;
use super::process::Process;
use super::request::{Open, Request};
use super::words::{Reader, Writer};
use super::worker::refuse_in_worker;
use super::{IsolateError, Options};
use crate::crash::Place;
use crate::fmu::scalar_description;
use slave::{CallError, Failure};

/// Longest wait between two checks of messages and time limits.
const SLICE: Duration = Duration::from_millis(100);
/// Time limit for the end of a worker that has closed the connection.
const END_LIMIT: Duration = Duration::from_secs(2);
/// Time limit of `fmi2FreeInstance` if the calls of the instance have no limit.
const FREE_LIMIT: Duration = Duration::from_secs(10);
/// Time limit for a new process to become a worker.
const START_LIMIT: Duration = Duration::from_secs(20);
/// Least number of variables for which the shared memory has room, if structural parameters may enlarge arrays.
const ROOM_FOR_ARRAYS: usize = 1 << 16;

/// An instance in a separate process.
///
/// After a call that ended the process, every further call returns the same failure.
pub struct Isolated {
    pub(super) channel: Channel,
    process: Process,
    inbox: Inbox,
    /// The current function and time of the instance, for a report if this process ends during a call.
    pub(super) place: Arc<Place>,
    /// The last known turn: odd while a command is pending.
    turn: u64,
    /// Start of the time limit of the next wait; `None` if the limit starts with the wait.
    posted_at: Option<Instant>,
    /// The cause of the worker's end; `None` while the worker runs.
    ended: Option<Failure>,
    /// Whether the worker has been asked to free the instance.
    freed: bool,
    time_limit: Option<Duration>,
    memory_limit: Option<u64>,
    /// Longest wait between two checks: the read timeout of the socket.
    slice: Duration,
    /// Time at which the process was started.
    started: Instant,
    /// The bytes of a request or an answer, kept so that small messages need no allocation.
    pub(super) message: Vec<u8>,
    /// The unpacked FMU, whose files are removed with the last instance.
    pub(super) package: Arc<Unpacked>,
    /// The version of the FMU, for the names of functions.
    pub(super) version: Version,
    /// The description of the instance if it differs from the description of the package.
    pub(super) description: Option<ModelDescription>,
    /// [`Integration::describe`](super::Integration::describe) of an instance for model exchange.
    pub(super) describe: Option<Describe>,
    /// Values of structural parameters, by value reference.
    pub(super) sizes: HashMap<u32, u64>,
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
        let stated = &package.description;
        let (version, sizes) = (stated.version(), HashMap::new());
        let describe = options.integration.as_ref().map(|integration| integration.describe);
        let description = description_of_instance(stated, &sizes, describe)
            .map_err(|reason| IsolateError::Refused { instance: name.to_owned(), reason })?;
        let count = room_of(description.as_ref().unwrap_or(stated));
        refuse_in_worker()?;
        let (shared, memory) =
            Shared::create(count).map_err(system("cannot create shared memory"))?;
        let (socket, worker_socket) =
            UnixStream::pair().map_err(system("cannot create a connection"))?;
        let slice = options.time_limit.map_or(SLICE, |limit| (limit / 8).min(SLICE));
        let slice = slice.max(Duration::from_millis(1));
        socket.set_read_timeout(Some(slice)).map_err(system("cannot set a time limit"))?;
        socket.set_write_timeout(Some(slice)).map_err(system("cannot set a time limit"))?;
        let executable = options.executable.clone().map_or_else(std::env::current_exe, Ok);
        let executable = executable.map_err(system("cannot find this program's file"))?;
        let process =
            Process::start(&executable, name, worker_socket, memory).map_err(|source| {
                let (executable, instance) = (executable.clone(), name.to_owned());
                IsolateError::Start { executable, instance, source }
            })?;
        let mut isolated = Self {
            channel: Channel::new(Arc::new(shared), socket, Side::Master),
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
            message: Vec::new(),
            version,
            description,
            describe,
            sizes,
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

    /// Frees the instance and creates the instance `name` in the same process with the same library. Of `options` only
    /// [`Options::logging`] has an effect.
    ///
    /// # Errors
    ///
    /// [`IsolateError::Refused`] if the FMU does not instantiate; [`IsolateError::Call`] if the worker
    /// ends or does not answer.
    pub fn renew(&mut self, name: &str, options: &Options) -> Result<(), IsolateError> {
        let done = self.request(&Request::Renew { name, logging: options.logging });
        self.inbox.rename(name);
        self.place = Place::new(name);
        check_outcome(name, done)
    }

    /// Lets the worker load and instantiate the FMU.
    fn open(&mut self, name: &str, options: &Options) -> Result<Opening, CallError> {
        let package = self.package.clone();
        // The time limit starts one slice from now, when the process has usually become a worker.
        self.posted_at = Some(Instant::now() + self.slice);
        self.request(&Request::Open(Open {
            folder: package.folder().as_os_str().as_bytes(),
            name,
            logging: options.logging,
            strict_binding: options.strict_binding,
            guard_arrays: options.guard_arrays,
            memory_limit: options.memory_limit.unwrap_or(0),
            preload: options.preload.iter().map(|library| library.as_bytes()).collect(),
            integration: options
                .integration
                .as_ref()
                .map(|integration| integration.options.as_str()),
        }))
    }

    /// Posts `function` with the arguments that `write` writes; returns the results that `read` reads.
    #[inline]
    pub(super) fn call<T>(
        &mut self,
        function: Function,
        write: impl FnOnce(&mut Writer<'_>),
        read: impl FnOnce(&mut Reader<'_>) -> Option<T>,
    ) -> Result<T, CallError> {
        self.post(function, write)?;
        self.answer(function, read)
    }

    /// Posts `function` with the arguments that `write` writes. Waits for a pending command first and
    /// discards its answer.
    #[inline]
    pub(super) fn post(
        &mut self,
        function: Function,
        write: impl FnOnce(&mut Writer<'_>),
    ) -> Result<(), CallError> {
        if let Some(failure) = &self.ended {
            return Err(self.error(function, failure.clone()));
        }
        if self.is_pending()
            && let Err(failure) = self.wait()
        {
            return Err(self.abandon(function, failure));
        }
        self.inbox.clear();
        let shared = &self.channel.shared;
        let mut writer = Writer::new(shared.area());
        write(&mut writer);
        if !writer.fits() {
            return Err(
                self.protocol_error(function, "needs more arguments than the shared memory holds")
            );
        }
        shared.command().store(function.to_word(), Ordering::Relaxed);
        shared.place().store(function.to_word(), Ordering::Relaxed);
        self.place.enter(function.static_name(self.version));
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

    /// Waits for the answer to `function`; returns the results that `read` reads, or the error that the worker sent.
    #[inline]
    pub(super) fn answer<T>(
        &mut self,
        function: Function,
        read: impl FnOnce(&mut Reader<'_>) -> Option<T>,
    ) -> Result<T, CallError> {
        self.wait_for_answer(function)?;
        match self.values(read) {
            Some(values) => Ok(values),
            None => Err(self.receive_error(function)),
        }
    }

    /// Waits until the worker has answered `function`, and logs the messages of the FMU.
    #[inline]
    pub(super) fn wait_for_answer(&mut self, function: Function) -> Result<(), CallError> {
        if let Some(failure) = &self.ended {
            return Err(self.error(function, failure.clone()));
        }
        if !self.is_pending() {
            return Err(self.protocol_error(function, "was not started before it was finished"));
        }
        if let Err(failure) = self.wait() {
            return Err(self.abandon(function, failure));
        }
        self.place.leave();
        self.inbox.drain(&self.channel.shared);
        Ok(())
    }

    /// Returns the results that `read` reads from an answer of words; `None` for an encoded answer.
    #[inline]
    pub(super) fn values<T>(&self, read: impl FnOnce(&mut Reader<'_>) -> Option<T>) -> Option<T> {
        let mut reader = Reader::new(self.channel.shared.area());
        if reader.take::<u64>()? == VALUES { read(&mut reader) } else { None }
    }

    /// Waits until the worker has answered. On failure returns why no answer can come.
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

    /// Checks after a wait without an answer whether an answer can still come; the error states why not. Sets `start`
    /// to the start of the wait if it is `None`.
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
        if !self.is_attached() {
            // The time limit starts at the next check: the process may then have become a worker.
            *start = Some(Instant::now() + self.slice);
            let is_late = self.started.elapsed() > START_LIMIT;
            let late = Failure::TimedOut(START_LIMIT.as_secs_f64());
            return if is_late { Err(late) } else { Ok(()) };
        }
        // Without `start` this is the first check, one slice after the start of the wait.
        let now = Instant::now();
        let start = *start.get_or_insert(now.checked_sub(self.slice).unwrap_or(now));
        match self.time_limit {
            Some(limit) if now.duration_since(start) >= limit => {
                Err(Failure::TimedOut(limit.as_secs_f64()))
            }
            _ => Ok(()),
        }
    }

    /// Kills the worker after a failure. Returns the error with the name of the C function that the worker called or,
    /// if the worker called none, the name of the command.
    #[cold]
    pub(super) fn abandon(&mut self, function: Function, failure: Failure) -> CallError {
        self.process.kill();
        self.place.leave();
        let shared = &self.channel.shared;
        self.inbox.drain(shared);
        let place = Function::from_word(shared.place().load(Ordering::Relaxed));
        let command = place.unwrap_or(function).name(self.version);
        let function = shared.function().unwrap_or(command);
        let failure = match self.memory_limit {
            Some(limit) if shared.no_memory().load(Ordering::Relaxed) != 0 => {
                Failure::OutOfMemory(limit)
            }
            _ => failure,
        };
        self.ended = Some(failure.clone());
        CallError { function, failure, messages: self.inbox.take() }
    }

    fn error(&self, function: Function, failure: Failure) -> CallError {
        CallError { function: function.name(self.version), failure, messages: Vec::new() }
    }

    #[cold]
    fn protocol_error(&self, function: Function, what: &str) -> CallError {
        self.error(function, Failure::InvalidAnswer(what.to_owned()))
    }

    /// Returns the process identifier of the worker.
    #[must_use]
    pub fn process_id(&self) -> u32 {
        self.process.id()
    }

    /// Lets the worker free the instance and end. Does nothing if this was requested before or the worker has ended.
    pub(super) fn free_instance(&mut self) -> Result<(), CallError> {
        if self.freed || self.ended.is_some() {
            return Ok(());
        }
        self.freed = true;
        self.time_limit = Some(self.time_limit.unwrap_or(FREE_LIMIT).min(FREE_LIMIT));
        self.request::<()>(&Request::Free)?;
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

/// Converts the answer to an instantiation to a result.
fn check_outcome(name: &str, answer: Result<Opening, CallError>) -> Result<(), IsolateError> {
    let instance = name.to_owned();
    match answer {
        Ok(Opening::Instantiated) => Ok(()),
        Ok(Opening::NotPreloaded(reason)) => Err(IsolateError::Preload { reason }),
        Ok(Opening::Refused(reason)) => Err(IsolateError::Refused { instance, reason }),
        Err(source) => Err(IsolateError::Call { instance, source }),
    }
}

/// Converts the description of a model-exchange instance to the description of the slave that integrates it.
pub(super) type Describe = fn(&ModelDescription) -> ModelDescription;

/// Returns the number of variables for which the shared memory has room. Unused pages take no memory.
fn room_of(description: &ModelDescription) -> usize {
    let (variables, structural) = (&description.variables, Causality::StructuralParameter);
    let resizes = variables.iter().any(|variable| variable.causality == structural);
    variables.len().max(if resizes { ROOM_FOR_ARRAYS } else { 0 })
}

/// Returns the description of an instance if it differs from the description of the FMU. On failure returns the reason.
pub(super) fn description_of_instance(
    description: &ModelDescription,
    sizes: &HashMap<u32, u64>,
    describe: Option<Describe>,
) -> Result<Option<ModelDescription>, String> {
    let scalar = scalar_description(description, sizes)?;
    let described = describe.map(|describe| describe(scalar.as_ref().unwrap_or(description)));
    Ok(described.or(scalar))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_that_a_structural_parameter_enlarges_is_set_in_one_call() {
        let xml = r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="t">
<CoSimulation modelIdentifier="M"/><ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
<UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="a" valueReference="2" causality="input" start="0"><Dimension valueReference="1"/></Float64>
</ModelVariables><ModelStructure/></fmiModelDescription>"#;
        let stated = ModelDescription::parse(xml).unwrap();
        let described = |sizes| description_of_instance(&stated, &sizes, None).unwrap().unwrap();
        let (shared, _) = Shared::create(room_of(&described(HashMap::new()))).unwrap();
        // Each element needs room for its value reference and its value.
        let all = described(HashMap::from([(1, 100_000)])).variables;
        let elements = all.iter().filter(|variable| variable.name.starts_with("a[")).count();
        assert_eq!(elements, 100_000);
        assert!(shared.area().len() >= 2 * elements, "{} words", shared.area().len());
    }
}
