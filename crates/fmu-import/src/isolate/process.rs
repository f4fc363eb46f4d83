//! The process of a worker: its start, its end and the cause of its end.

use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

use super::output::Output;
use super::{STARTED_BY, WORKER};
use crate::supervise::signal_name;
use slave::Failure;

/// Pause between two checks whether the process has ended.
const PAUSE: Duration = Duration::from_millis(1);

/// The process of one worker. Dropping it kills the process and its whole process group.
pub(super) struct Process {
    child: Child,
    output: Output,
    /// The cause of the end of the process; `None` while the process runs.
    ended: Option<Failure>,
}

impl Process {
    /// Starts `executable` as a worker in a process group of its own, so that signals of the terminal
    /// do not reach it. The worker takes over the connection from its standard input and the shared
    /// memory from its standard output.
    pub(super) fn start(
        executable: &Path,
        instance: &str,
        socket: UnixStream,
        memory: File,
    ) -> io::Result<Self> {
        let (output, errors) = Output::new(instance)?;
        let child = Command::new(executable)
            .arg(WORKER)
            .env(STARTED_BY, std::process::id().to_string())
            .stdin(OwnedFd::from(socket))
            .stdout(Stdio::from(memory))
            .stderr(Stdio::from(errors))
            .process_group(0)
            .spawn()?;
        Ok(Self { child, output, ended: None })
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    fn pid(&self) -> Option<Pid> {
        i32::try_from(self.child.id()).ok().and_then(Pid::from_raw)
    }

    /// Returns the cause of the end of the process; `None` while the process runs.
    pub(super) fn ended(&mut self) -> Option<Failure> {
        let pid = self.pid()?;
        if self.ended.is_none() {
            // NOWAIT keeps the zombie: no other process group can have its identifier until `end_group` has run.
            let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
            waitid(WaitId::Pid(pid), options).ok().flatten()?;
            self.end_group();
        }
        self.ended.clone()
    }

    /// Waits up to `limit` for the end of the process; returns the cause of this end.
    pub(super) fn wait_for_end(&mut self, limit: Duration) -> Option<Failure> {
        let start = Instant::now();
        loop {
            let ended = self.ended();
            if ended.is_some() || start.elapsed() > limit {
                return ended;
            }
            std::thread::sleep(PAUSE);
        }
    }

    /// Kills the process and its process group.
    pub(super) fn kill(&mut self) {
        if self.ended.is_none() {
            self.end_group();
        }
    }

    /// Kills the process group and records the cause of the end of the process.
    fn end_group(&mut self) {
        if let Some(pid) = self.pid() {
            // Fails if no process of the group is alive.
            let _ = kill_process_group(pid, Signal::KILL);
        }
        let _ = self.child.kill();
        if let Ok(status) = self.child.wait() {
            self.ended = Some(failure(status));
        }
        self.output.finish();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

fn failure(status: ExitStatus) -> Failure {
    match (status.signal(), status.code()) {
        (Some(signal), _) => Failure::Killed(signal, signal_name(signal)),
        (None, code) => Failure::Exited(code.unwrap_or(-1)),
    }
}
