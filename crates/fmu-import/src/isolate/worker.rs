//! The main loop of a worker process: setup, commands of the master, end.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, stderr, stdin, stdout};
use std::mem::take;
use std::os::fd::AsFd as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, Signal, getppid, kill_current_process_group};
use rustix::stdio::{dup2_stdin, dup2_stdout};

use super::channel::{Channel, Side, WaitResult};
use super::function::Function;
use super::layout::Shared;
use super::log::Forward;
use super::message::{Opening, decode};
use super::perform::{
    CommandResult, Executor, MESSAGE, Maker, VALUES, invalid, invalid_command, reply,
};
use super::request::{Open, Request};
use super::words::{Reader, Writer};
use super::{Integrator, IsolateError, STARTED_BY, WorkerError, memory};
use crate::Fmu;
use crate::crash::observe;
use crate::library::Surroundings;
use slave::CallError;

/// Whether this process has become a worker.
static IS_WORKER: AtomicBool = AtomicBool::new(false);

/// Interval between two checks whether the master lives, if the FMU has closed the connection.
const PARENT_CHECK: Duration = Duration::from_millis(100);

const NO_INTEGRATOR: &str = "this program cannot integrate model-exchange FMUs in separate processes: \
    its `main` must call `fmu_import::isolate::worker_with` where it calls `worker`";

/// Number of bytes that stay allocated for the next request and for its answer.
const BUFFER: usize = 1 << 16;

/// Runs the worker. The master passes the shared memory as standard output and the connection as standard input.
pub(super) fn run(integrator: Option<Integrator>) -> Result<(), WorkerError> {
    IS_WORKER.store(true, Ordering::Relaxed);
    let error = |what| move |source| WorkerError::Alone { what, source };
    let memory = stdout().as_fd().try_clone_to_owned().map_err(error("no shared memory"))?;
    let shared = Arc::new(Shared::attach(&File::from(memory)).map_err(error("no shared memory"))?);
    let socket = stdin().as_fd().try_clone_to_owned().map_err(error("no connection"))?;
    let socket = UnixStream::from(socket);
    socket.peer_addr().map_err(error("no connection"))?;
    redirect_standard_streams().map_err(error("no standard streams"))?;
    end_with_master(&socket).map_err(error("no thread to watch the connection"))?;
    // Fails only if the program has set a subscriber, which then receives the messages.
    let _ = tracing::subscriber::set_global_default(Forward::new(shared.clone()));
    let observed = shared.clone();
    observe(move |name| observed.set_function(name));
    shared.attached().store(1, Ordering::Relaxed);
    serve(&mut Channel::new(shared, socket, Side::Worker), integrator)
}

/// Returns an error if this process was started as a worker but did not become one. Otherwise a program that ignores
/// its argument would start itself again and again.
pub(super) fn refuse_in_worker() -> Result<(), IsolateError> {
    let started_by = std::env::var(STARTED_BY).ok().and_then(|number| number.parse().ok());
    let parent = getppid().map(Pid::as_raw_pid);
    if started_by.is_some() && started_by == parent && !IS_WORKER.load(Ordering::Relaxed) {
        return Err(IsolateError::InWorker);
    }
    Ok(())
}

/// Redirects standard input to `/dev/null` and standard output to standard error.
fn redirect_standard_streams() -> io::Result<()> {
    dup2_stdin(File::open("/dev/null")?)?;
    dup2_stdout(stderr())?;
    Ok(())
}

/// Starts a thread that kills this process group as soon as the master has ended.
fn end_with_master(socket: &UnixStream) -> io::Result<()> {
    let (socket, master) = (socket.try_clone()?, getppid());
    let watch = move || {
        // With no requested events, `poll` reports only the end of the connection.
        let mut ends = [PollFd::new(&socket, PollFlags::empty())];
        while poll(&mut ends, None).is_err() {}
        // NVAL: the FMU has closed the connection. Then the parent process shows whether the master lives.
        while ends[0].revents().contains(PollFlags::NVAL) && getppid() == master {
            std::thread::sleep(PARENT_CHECK);
        }
        let _ = kill_current_process_group(Signal::KILL);
    };
    std::thread::Builder::new().name("master".to_owned()).spawn(watch).map(|_| ())
}

/// Executes the commands of the master until it frees the instance.
fn serve(channel: &mut Channel, integrator: Option<Integrator>) -> Result<(), WorkerError> {
    let mut worker = Worker {
        shared: channel.shared.clone(),
        integrator,
        executor: None,
        request: Vec::new(),
        before: Surroundings::now(),
        answer: Vec::new(),
        freed: false,
    };
    let mut turn = 0_u64;
    while !worker.freed {
        match channel.wait(turn) {
            WaitResult::Turn(posted) if posted == turn.wrapping_add(1) => {}
            WaitResult::Turn(word) => return Err(WorkerError::Corrupted { actual: word }),
            WaitResult::TimedOut => continue,
            WaitResult::Closed => return Ok(()),
        }
        let word = worker.shared.command().load(Ordering::Relaxed);
        let function = Function::from_word(word).ok_or(WorkerError::Corrupted { actual: word })?;
        worker.perform(function);
        turn = turn.wrapping_add(2);
        channel.post(turn);
    }
    Ok(())
}

/// The state of a worker between two commands.
struct Worker {
    shared: Arc<Shared>,
    integrator: Option<Integrator>,
    executor: Option<Executor>,
    /// The parts of the next request that have arrived so far, joined.
    request: Vec<u8>,
    /// The process-wide settings before the FMU was loaded.
    before: Surroundings,
    /// The bytes of the last answer.
    answer: Vec<u8>,
    /// Whether the master has ended the work of this process by [`Request::Free`].
    freed: bool,
}

impl Worker {
    /// Executes a command and writes its answer.
    #[inline]
    fn perform(&mut self, function: Function) {
        let mut reader = Reader::new(self.shared.area());
        let mut writer = Writer::new(self.shared.area());
        let done = match (function, &mut self.executor) {
            (Function::Upload, _) => reader.take_bytes(&mut self.request).map(|()| {
                writer.put(VALUES);
                Ok(())
            }),
            (Function::Download, _) => download(&self.answer, &mut reader, &mut writer),
            (function, Some(executor)) if function.is_exchange() => {
                executor.exchange(function, &mut reader, &mut writer)
            }
            _ => return self.answer_request(function),
        };
        let mut done = done.unwrap_or_else(|| Err(invalid_command(function)));
        if done.is_ok() && !writer.fits() {
            done = Err(invalid(function, "returned more than the shared memory holds"));
        }
        if let Err(error) = done {
            reply(Err::<(), _>(error), &mut self.answer);
            self.send_answer();
        }
    }

    /// Reads the last part of a request, executes it and writes its answer.
    fn answer_request(&mut self, function: Function) {
        let mut bytes = take(&mut self.request);
        let whole = Reader::new(self.shared.area()).take_bytes(&mut bytes);
        self.answer.clear();
        self.answer.shrink_to(BUFFER);
        let request = whole.and_then(|()| decode(&bytes)).filter(Request::has_matching_lists);
        match (request, &mut self.executor) {
            (Some(Request::Open(arguments)), None) => {
                let opened = self.open(&arguments);
                reply(opened, &mut self.answer);
            }
            (Some(Request::Renew { name, logging }), Some(executor)) => {
                let maker = executor.maker.clone();
                self.record(Function::Free);
                self.executor = None;
                let renewed = self.create(maker, name, logging);
                reply(Ok(renewed), &mut self.answer);
            }
            (Some(Request::ProcessChanges), _) => {
                let changes = self.before.changes(&Surroundings::now());
                reply(Ok(changes), &mut self.answer);
            }
            (Some(Request::Free), executor) => {
                *executor = None;
                self.freed = true;
                reply(Ok(()), &mut self.answer);
            }
            (Some(request), Some(executor)) => {
                request.execute(executor.instance.as_mut(), &mut self.answer);
            }
            _ => reply(Err::<(), _>(invalid_command(function)), &mut self.answer),
        }
        bytes.clear();
        bytes.shrink_to(BUFFER);
        self.request = bytes;
        self.send_answer();
    }

    /// Loads and instantiates the FMU. Only a memory limit that cannot be set is an error; other failures are in the
    /// [`Opening`].
    fn open(&mut self, arguments: &Open<'_>) -> Result<Opening, CallError> {
        let Open { folder, name, logging, memory_limit, preload, integration, .. } = arguments;
        let guards = arguments.guard_arrays;
        if *memory_limit > 0
            && let Err(error) = memory::limit(&self.shared, *memory_limit)
        {
            let what = format!("cannot limit its memory to {memory_limit} bytes: {error}");
            return Err(invalid(Function::Load, &what));
        }
        self.record(Function::Load);
        for library in preload {
            if let Err(error) = crate::preload(OsStr::from_bytes(library)) {
                return Ok(Opening::NotPreloaded(with_causes(&error)));
            }
        }
        let integration = match (integration, self.integrator) {
            (None, _) => None,
            (Some(options), Some(integrator)) => Some((integrator, (*options).to_owned())),
            (Some(_), None) => return Ok(Opening::Refused(NO_INTEGRATOR.to_owned())),
        };
        let folder = Path::new(OsStr::from_bytes(folder));
        let opened = if arguments.strict_binding {
            Fmu::open_strictly(folder)
        } else {
            Fmu::open_quietly(folder)
        };
        Ok(match opened {
            Ok(fmu) => self.create(Maker { fmu, integration, guards }, name, *logging),
            Err(error) => Opening::Refused(with_causes(&error)),
        })
    }

    /// Stores the present part of a command, so that the master can name this part after a crash between two C calls.
    fn record(&self, function: Function) {
        self.shared.place().store(function.to_word(), Ordering::Relaxed);
    }

    /// Creates an instance, which executes the following requests.
    fn create(&mut self, maker: Maker, name: &str, logging: bool) -> Opening {
        self.record(Function::Instantiate);
        match maker.make(name) {
            Ok(instance) => {
                self.executor = Some(Executor::new(instance, maker, logging));
                Opening::Instantiated
            }
            Err(error) => Opening::Refused(with_causes(&error)),
        }
    }

    /// Writes the start of the encoded answer; the master downloads the rest.
    fn send_answer(&self) {
        let mut writer = Writer::new(self.shared.area());
        writer.put(MESSAGE);
        writer.put(self.answer.len() as u64);
        writer.put_part(&self.answer);
    }
}

/// Reads an offset and writes the bytes of `answer` from this offset on, as many as fit; `None` beyond the end.
fn download(answer: &[u8], reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> CommandResult {
    let offset = usize::try_from(reader.take::<u64>()?).ok()?;
    let rest = answer.get(offset..)?;
    writer.put(VALUES);
    writer.put_part(rest);
    Some(Ok(()))
}

/// Returns the text of an error and of its causes, without a cause whose text an earlier part contains.
fn with_causes(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.map(ToString::to_string).fold(error.to_string(), |text, cause| {
        if text.contains(&cause) { text } else { format!("{text}: {cause}") }
    })
}
