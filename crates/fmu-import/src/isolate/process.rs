//! The process of a worker: start, end, and why it ended.

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
use slave::Failure;

/// Between two looks whether the process has ended.
const PAUSE: Duration = Duration::from_millis(1);

/// The process of one worker, which does not outlive this, and neither do those that it started,
/// unless they left its process group.
pub(super) struct Process {
    child: Child,
    output: Output,
    /// How it ended, once that is known.
    ended: Option<Failure>,
}

impl Process {
    /// Starts `executable` as a worker: the connection is its standard input, the shared memory its
    /// standard output, until it has taken both over. Signals of the terminal are not for it.
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

    /// Its number.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    fn pid(&self) -> Option<Pid> {
        i32::try_from(self.child.id()).ok().and_then(Pid::from_raw)
    }

    /// How it ended, if it has.
    pub(super) fn ended(&mut self) -> Option<Failure> {
        let pid = self.pid()?;
        if self.ended.is_none() {
            // The process is left a zombie: until it is gone its number means its group only.
            let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
            waitid(WaitId::Pid(pid), options).ok().flatten()?;
            self.end_group();
        }
        self.ended.clone()
    }

    /// How it ended, if it does within `patience`.
    pub(super) fn ends_within(&mut self, patience: Duration) -> Option<Failure> {
        let begin = Instant::now();
        loop {
            let ended = self.ended();
            if ended.is_some() || begin.elapsed() > patience {
                return ended;
            }
            std::thread::sleep(PAUSE);
        }
    }

    /// Ends it, and the processes that it started.
    pub(super) fn kill(&mut self) {
        if self.ended.is_none() {
            self.end_group();
        }
    }

    /// Ends what there is of its group, then takes note of its own end.
    fn end_group(&mut self) {
        if let Some(pid) = self.pid() {
            // Fails where nothing of the group is alive.
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
        (Some(signal), _) => Failure::Killed(signal, name(signal)),
        (None, code) => Failure::Exited(code.unwrap_or(-1)),
    }
}

/// The name of a signal.
fn name(signal: i32) -> &'static str {
    let known = [
        (Signal::HUP, "SIGHUP"),
        (Signal::INT, "SIGINT"),
        (Signal::QUIT, "SIGQUIT"),
        (Signal::ILL, "SIGILL"),
        (Signal::TRAP, "SIGTRAP"),
        (Signal::ABORT, "SIGABRT"),
        (Signal::BUS, "SIGBUS"),
        (Signal::FPE, "SIGFPE"),
        (Signal::KILL, "SIGKILL"),
        (Signal::USR1, "SIGUSR1"),
        (Signal::SEGV, "SIGSEGV"),
        (Signal::USR2, "SIGUSR2"),
        (Signal::PIPE, "SIGPIPE"),
        (Signal::ALARM, "SIGALRM"),
        (Signal::TERM, "SIGTERM"),
        (Signal::XCPU, "SIGXCPU"),
        (Signal::XFSZ, "SIGXFSZ"),
        (Signal::VTALARM, "SIGVTALRM"),
        (Signal::PROF, "SIGPROF"),
        (Signal::IO, "SIGIO"),
        (Signal::SYS, "SIGSYS"),
    ];
    let found = known.iter().find(|(known, _)| known.as_raw() == signal);
    found.map_or("no common one", |(_, name)| name)
}
