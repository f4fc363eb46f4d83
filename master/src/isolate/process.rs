//! The process of a worker: start, end, and what it ended of.

use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

use super::WORKER;
use crate::slave::Failure;

/// Between two looks whether the process has ended.
const PAUSE: Duration = Duration::from_millis(1);

/// The process of one worker, which does not outlive this.
pub(super) struct Process {
    child: Child,
}

impl Process {
    /// Starts `executable` as a worker: the connection is its standard input, the shared memory its
    /// standard output, until it has taken both over. Signals of the terminal are not for it.
    pub(super) fn start(executable: &Path, socket: UnixStream, memory: File) -> io::Result<Self> {
        let child = Command::new(executable)
            .arg(WORKER)
            .stdin(OwnedFd::from(socket))
            .stdout(Stdio::from(memory))
            .process_group(0)
            .spawn()?;
        Ok(Self { child })
    }

    /// Its number.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// How it ended, if it has.
    pub(super) fn ended(&mut self) -> Option<Failure> {
        self.child.try_wait().ok().flatten().map(failure)
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
        if let (None, Ok(id)) = (self.ended(), i32::try_from(self.child.id())) {
            if let Some(id) = Pid::from_raw(id) {
                // Fails where the process has just ended.
                let _ = kill_process_group(id, Signal::KILL);
            }
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
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
