//! The process of an isolated FMU, from its start to its end.

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

use super::command::{
    Command, DONE, INSTANTIATED, LOADING, NOT_PRELOADED, REFUSED, place, write_error,
};
use super::layout::Shared;
use super::line::{Line, Seen, Side};
use super::log::Forward;
use super::perform::Work;
use super::words::{Reader, Writer};
use super::{IsolateError, STARTED_BY, WorkerError, memory};
use crate::{Fmu, FmuError, Instance};
use slave::{CallError, Failure};

/// This process has become a worker.
static IS_WORKER: AtomicBool = AtomicBool::new(false);

/// Between two looks whether the master is there, where the connection cannot tell.
const LOOK: Duration = Duration::from_millis(100);

/// Makes this process the worker of the master that started it, until the master has it end or is
/// gone. What is printed to standard output goes to standard error.
///
/// # Errors
///
/// [`WorkerError`]: not started by a master, or lost in memory that the FMU wrote over.
pub fn worker() -> Result<(), WorkerError> {
    IS_WORKER.store(true, Ordering::Relaxed);
    let alone = |what| move |source| WorkerError::Alone { what, source };
    let memory = stdout().as_fd().try_clone_to_owned().map_err(alone("no shared memory"))?;
    let shared = Shared::attach(&File::from(memory)).map_err(alone("no shared memory"))?;
    let shared = Arc::new(shared);
    let socket = stdin().as_fd().try_clone_to_owned().map_err(alone("no connection"))?;
    let socket = UnixStream::from(socket);
    socket.peer_addr().map_err(alone("no connection"))?;
    leave_standard_streams().map_err(alone("no standard streams"))?;
    end_with_master(&socket).map_err(alone("no watch over the connection"))?;
    // Fails only where one is set already, which then hears the messages instead.
    let _ = tracing::subscriber::set_global_default(Forward::new(shared.clone()));
    shared.attached().store(1, Ordering::Relaxed);
    serve(&mut Line::new(shared, socket, Side::Worker))
}

/// A program that does not know of workers starts itself as one, does the same again, and would do
/// so without end.
pub(super) fn refuse_in_worker() -> Result<(), IsolateError> {
    let started_by = std::env::var(STARTED_BY).ok().and_then(|number| number.parse().ok());
    let parent = getppid().map(Pid::as_raw_pid);
    if started_by.is_some() && started_by == parent && !IS_WORKER.load(Ordering::Relaxed) {
        return Err(IsolateError::InWorker);
    }
    Ok(())
}

/// Nothing to read from standard input; output goes where errors go.
fn leave_standard_streams() -> io::Result<()> {
    dup2_stdin(File::open("/dev/null")?)?;
    dup2_stdout(stderr())?;
    Ok(())
}

/// Ends this process, and those that it started, as soon as the master is gone, wherever the FMU is.
fn end_with_master(socket: &UnixStream) -> io::Result<()> {
    let (socket, master) = (socket.try_clone()?, getppid());
    let watch = move || {
        // Without events asked for, only the end of the connection is reported.
        let mut ends = [PollFd::new(&socket, PollFlags::empty())];
        while poll(&mut ends, None).is_err() {}
        // An FMU that closes all files closes the connection: only its master can tell of that.
        while ends[0].revents().contains(PollFlags::NVAL) && getppid() == master {
            std::thread::sleep(LOOK);
        }
        let _ = kill_current_process_group(Signal::KILL);
    };
    std::thread::Builder::new().name("master".to_owned()).spawn(watch).map(|_| ())
}

/// Does what the master asks for.
fn serve(line: &mut Line) -> Result<(), WorkerError> {
    let (shared, mut work, mut turn) = (line.shared.clone(), None, 0_u64);
    loop {
        match line.wait(turn) {
            Seen::Turn(posted) if posted == turn.wrapping_add(1) => {}
            Seen::Turn(found) => return Err(WorkerError::Corrupted { found }),
            Seen::Nothing => continue,
            Seen::Closed => return Ok(()),
        }
        let found = shared.command().load(Ordering::Relaxed);
        let command = Command::from_word(found).ok_or(WorkerError::Corrupted { found })?;
        let mut reader = Reader::new(shared.area());
        let mut writer = Writer::new(shared.area());
        let done = match (command, &mut work) {
            (Command::Open, work @ None) => open(&shared, work, &mut reader, &mut writer),
            (Command::Renew, work @ Some(_)) => renew(&shared, work, &mut reader, &mut writer),
            (Command::Free, work) => {
                *work = None;
                writer.put(DONE);
                Some(Ok(()))
            }
            (_, Some(work)) => work.perform(command, &shared, &mut reader, &mut writer),
            (_, None) => None,
        };
        let done = done.unwrap_or_else(|| Err(lost(command)));
        if let Err(error) = done.and_then(|()| fitting(command, &writer)) {
            write_error(&error, &mut Writer::new(shared.area()));
        }
        turn = turn.wrapping_add(2);
        line.post(turn);
        if command == Command::Free {
            return Ok(());
        }
    }
}

#[cold]
fn lost(command: Command) -> CallError {
    let what = "was asked for something else than a master asks: shared memory is corrupted";
    let failure = Failure::InvalidAnswer(what.to_owned());
    CallError { function: command.function(), failure, messages: Vec::new() }
}

fn fitting(command: Command, writer: &Writer<'_>) -> Result<(), CallError> {
    if writer.fits() {
        return Ok(());
    }
    let failure = Failure::InvalidAnswer("gave more than its shared memory holds".to_owned());
    Err(CallError { function: command.function(), failure, messages: Vec::new() })
}

/// Loads and instantiates the FMU.
fn open(
    shared: &Arc<Shared>,
    work: &mut Option<Work>,
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
            writer.put_bytes(explained(&error).as_bytes());
            return Some(Ok(()));
        }
    }
    let opened = Fmu::open(Path::new(OsStr::from_bytes(&folder))).and_then(|fmu| {
        shared.place().store(Command::Open.to_word(), Ordering::Relaxed);
        fmu.instantiate(&name)
    });
    *work = tell(opened, writer).map(|instance| Work::new(instance, logging));
    Some(Ok(()))
}

/// Frees the instance and makes another one.
fn renew(
    shared: &Shared,
    work: &mut Option<Work>,
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
) -> Option<Result<(), CallError>> {
    let name = reader.take_text()?;
    let logging: bool = reader.take()?;
    let fmu = work.as_ref()?.fmu();
    shared.place().store(Command::Free.to_word(), Ordering::Relaxed);
    *work = None;
    shared.place().store(Command::Open.to_word(), Ordering::Relaxed);
    *work = tell(fmu.instantiate(&name), writer).map(|instance| Work::new(instance, logging));
    Some(Ok(()))
}

/// Writes whether there is an instance, or why not.
fn tell(made: Result<Instance, FmuError>, writer: &mut Writer<'_>) -> Option<Instance> {
    writer.put(DONE);
    match made {
        Ok(instance) => {
            writer.put(INSTANTIATED);
            Some(instance)
        }
        Err(error) => {
            writer.put(REFUSED);
            writer.put_bytes(explained(&error).as_bytes());
            None
        }
    }
}

/// An error and its causes.
fn explained(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
