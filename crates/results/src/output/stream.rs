//! Pipes and devices as the file of a sink.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;

use super::{DESCRIPTOR, STANDARD_OUTPUT, is_stream};

/// Longest wait for a process that reads a named pipe.
const READER: Duration = Duration::from_secs(10);
/// Interval between two attempts to open a named pipe.
const ATTEMPTS: Duration = Duration::from_millis(50);
/// Time for which a pipe must be full before a warning is logged.
const FULL: Timespec = Timespec { tv_sec: 5, tv_nsec: 0 };
/// Number of bytes that a pipe takes completely in one write, or not at all.
const ATOMIC: usize = 4096;

/// Standard output, after its reservation for the results.
static RESERVED: Mutex<Option<File>> = Mutex::new(None);

/// Reserves standard output for the results: text that this process and its FMUs print goes to standard
/// error from now on.
///
/// # Errors
///
/// [`io::Error`] if the descriptors cannot be copied.
pub fn reserve_standard_output() -> io::Result<()> {
    let output = rustix::io::fcntl_dupfd_cloexec(io::stdout(), DESCRIPTOR)
        .or_else(|_| rustix::io::fcntl_dupfd_cloexec(io::stdout(), 3))?;
    rustix::stdio::dup2_stdout(io::stderr())?;
    *RESERVED.lock().unwrap_or_else(PoisonError::into_inner) = Some(File::from(output));
    Ok(())
}

/// Opens a pipe or a device; `None` if the path leads to none. Waits up to [`READER`] for a process that reads a
/// named pipe; without one, this is an error.
pub(super) fn open(path: &Path) -> io::Result<Option<File>> {
    if path == Path::new(STANDARD_OUTPUT)
        && let Some(file) = &*RESERVED.lock().unwrap_or_else(PoisonError::into_inner)
    {
        return file.try_clone().map(Some);
    }
    if !is_stream(path) {
        return Ok(None);
    }
    if !fs::metadata(path)?.file_type().is_fifo() {
        return File::options().write(true).open(path).map(Some);
    }
    let start = Instant::now();
    loop {
        match rustix::fs::open(
            path,
            OFlags::WRONLY | OFlags::NONBLOCK | OFlags::CLOEXEC,
            Mode::empty(),
        ) {
            Ok(pipe) => {
                rustix::io::ioctl_fionbio(&pipe, false)?;
                return Ok(Some(File::from(pipe)));
            }
            Err(Errno::NXIO) if start.elapsed() < READER => std::thread::sleep(ATTEMPTS),
            Err(Errno::NXIO) => {
                let limit = READER.as_secs();
                let reason = format!("no process reads this pipe (waited {limit} s)");
                return Err(io::Error::other(reason));
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// Writes to a pipe or a device, and logs a warning each time that the pipe or device takes nothing for [`FULL`].
pub(super) fn write(file: &mut File, bytes: &[u8], path: &Path) -> io::Result<()> {
    for part in bytes.chunks(ATOMIC) {
        let mut events = [PollFd::new(&*file, PollFlags::OUT)];
        if poll(&mut events, Some(&FULL)) == Ok(0) {
            tracing::warn!("{}: the pipe is full; the run waits for its reader", path.display());
        }
        file.write_all(part)?;
    }
    Ok(())
}
