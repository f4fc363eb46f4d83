//! The main loop of a worker process: setup, commands of the master, end.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, stderr, stdin, stdout};
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
use super::command::{
    Command, DONE, INSTANTIATED, LOADING, NOT_PRELOADED, REFUSED, place, write_error,
};
use super::layout::Shared;
use super::log::Forward;
use super::perform::Executor;
use super::words::{Reader, Writer};
use super::{IsolateError, STARTED_BY, WorkerError, memory};
use crate::{Fmu, FmuError, Instance};
use slave::{CallError, Failure};

/// Whether this process has become a worker.
static IS_WORKER: AtomicBool = AtomicBool::new(false);

/// Interval between two checks whether the master lives, if the connection has been closed locally.
const PARENT_CHECK: Duration = Duration::from_millis(100);

/// Runs this process as a worker of the master that started it. Returns when the master frees the
/// instance or ends. Standard output is redirected to standard error.
///
/// # Errors
///
/// [`WorkerError::Alone`] if no master started this process; [`WorkerError::Corrupted`] if the FMU
/// overwrote the shared memory.
pub fn worker() -> Result<(), WorkerError> {
    IS_WORKER.store(true, Ordering::Relaxed);
    let alone = |what| move |source| WorkerError::Alone { what, source };
    let memory = stdout().as_fd().try_clone_to_owned().map_err(alone("no shared memory"))?;
    let shared = Shared::attach(&File::from(memory)).map_err(alone("no shared memory"))?;
    let shared = Arc::new(shared);
    let socket = stdin().as_fd().try_clone_to_owned().map_err(alone("no connection"))?;
    let socket = UnixStream::from(socket);
    socket.peer_addr().map_err(alone("no connection"))?;
    redirect_standard_streams().map_err(alone("no standard streams"))?;
    end_with_master(&socket).map_err(alone("no thread to watch the connection"))?;
    // Fails only if the program has set a subscriber, which then receives the messages.
    let _ = tracing::subscriber::set_global_default(Forward::new(shared.clone()));
    shared.attached().store(1, Ordering::Relaxed);
    serve(&mut Channel::new(shared, socket, Side::Worker))
}

/// Returns an error if this process was started as a worker but did not become one. Without this check
/// a program that ignores the argument would start itself again and again.
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
fn serve(channel: &mut Channel) -> Result<(), WorkerError> {
    let (shared, mut executor, mut turn) = (channel.shared.clone(), None, 0_u64);
    loop {
        match channel.wait(turn) {
            WaitResult::Turn(posted) if posted == turn.wrapping_add(1) => {}
            WaitResult::Turn(found) => return Err(WorkerError::Corrupted { found }),
            WaitResult::TimedOut => continue,
            WaitResult::Closed => return Ok(()),
        }
        let found = shared.command().load(Ordering::Relaxed);
        let command = Command::from_word(found).ok_or(WorkerError::Corrupted { found })?;
        let mut reader = Reader::new(shared.area());
        let mut writer = Writer::new(shared.area());
        let done = match (command, &mut executor) {
            (Command::Open, executor @ None) => open(&shared, executor, &mut reader, &mut writer),
            (Command::Renew, executor @ Some(_)) => {
                renew(&shared, executor, &mut reader, &mut writer)
            }
            (Command::Free, executor) => {
                *executor = None;
                writer.put(DONE);
                Some(Ok(()))
            }
            (_, Some(executor)) => executor.perform(command, &shared, &mut reader, &mut writer),
            (_, None) => None,
        };
        let done = done.unwrap_or_else(|| Err(invalid_command(command)));
        if let Err(error) = done.and_then(|()| check_fit(command, &writer)) {
            write_error(&error, &mut Writer::new(shared.area()));
        }
        turn = turn.wrapping_add(2);
        channel.post(turn);
        if command == Command::Free {
            return Ok(());
        }
    }
}

/// Returns the error of a command whose arguments are invalid or that comes out of order.
#[cold]
fn invalid_command(command: Command) -> CallError {
    let what = "received an invalid command: the shared memory is corrupted";
    let failure = Failure::InvalidAnswer(what.to_owned());
    CallError { function: command.function(), failure, messages: Vec::new() }
}

/// Checks that the results fitted into the shared memory.
fn check_fit(command: Command, writer: &Writer<'_>) -> Result<(), CallError> {
    if writer.fits() {
        return Ok(());
    }
    let failure = Failure::InvalidAnswer("returned more than the shared memory holds".to_owned());
    Err(CallError { function: command.function(), failure, messages: Vec::new() })
}

/// Loads and instantiates the FMU.
fn open(
    shared: &Arc<Shared>,
    executor: &mut Option<Executor>,
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
) -> Option<Result<(), CallError>> {
    let mut folder = Vec::new();
    reader.take_bytes(&mut folder)?;
    let name = reader.take_text()?;
    let logging: bool = reader.take()?;
    let limit: u64 = reader.take()?;
    if limit > 0
        && let Err(error) = memory::limit(shared, limit)
    {
        let what = format!("cannot limit its memory to {limit} bytes: {error}");
        let failure = Failure::InvalidAnswer(what);
        return Some(Err(CallError { function: LOADING, failure, messages: Vec::new() }));
    }
    let mut preload = Vec::new();
    for _ in 0..reader.take::<usize>()? {
        let mut library = Vec::new();
        reader.take_bytes(&mut library)?;
        preload.push(library);
    }
    shared.place().store(place(LOADING), Ordering::Relaxed);
    for library in &preload {
        if let Err(error) = crate::preload(OsStr::from_bytes(library)) {
            writer.put(DONE);
            writer.put(NOT_PRELOADED);
            writer.put_bytes(with_causes(&error).as_bytes());
            return Some(Ok(()));
        }
    }
    let opened = Fmu::open(Path::new(OsStr::from_bytes(&folder))).and_then(|fmu| {
        shared.place().store(Command::Open.to_word(), Ordering::Relaxed);
        fmu.instantiate(&name)
    });
    *executor = write_outcome(opened, writer).map(|instance| Executor::new(instance, logging));
    Some(Ok(()))
}

/// Frees the instance and creates another one.
fn renew(
    shared: &Shared,
    executor: &mut Option<Executor>,
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
) -> Option<Result<(), CallError>> {
    let name = reader.take_text()?;
    let logging: bool = reader.take()?;
    let fmu = executor.as_ref()?.fmu();
    shared.place().store(Command::Free.to_word(), Ordering::Relaxed);
    *executor = None;
    shared.place().store(Command::Open.to_word(), Ordering::Relaxed);
    let created = fmu.instantiate(&name);
    *executor = write_outcome(created, writer).map(|instance| Executor::new(instance, logging));
    Some(Ok(()))
}

/// Writes whether the instance was created, and the reason if not.
fn write_outcome(created: Result<Instance, FmuError>, writer: &mut Writer<'_>) -> Option<Instance> {
    writer.put(DONE);
    match created {
        Ok(instance) => {
            writer.put(INSTANTIATED);
            Some(instance)
        }
        Err(error) => {
            writer.put(REFUSED);
            writer.put_bytes(with_causes(&error).as_bytes());
            None
        }
    }
}

/// Returns the text of an error and of its causes.
fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
