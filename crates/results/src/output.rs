//! The file that a sink writes.
//!
//! An FMU in the process of the master can close or replace the descriptor of the file, move its
//! position, change or delete the file, or duplicate the process. So the sinks call
//! [`OutputFile::verify`] before each write.

use std::fs::{self, File, Metadata};
use std::io::{self, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::process;

use super::ResultsError;
use super::identity::Identity;
use super::ledger::Ledger;

#[cfg(unix)]
mod stream;

#[cfg(unix)]
pub use stream::reserve_standard_output;

/// Path of standard output; [`super::create`] writes CSV to it.
pub const STANDARD_OUTPUT: &str = "/dev/stdout";

/// Smallest descriptor number of a results file, if the limit of the process allows this number. An FMU that closes
/// descriptors of others usually closes those with small numbers.
#[cfg(unix)]
const DESCRIPTOR: i32 = 512;

/// An open file with the length that its writer expects.
#[derive(Debug)]
pub(super) struct OutputFile {
    /// The path as the caller stated it, for messages.
    path: PathBuf,
    /// The absolute path, which is valid after a change of the current folder.
    absolute: PathBuf,
    file: File,
    identity: Identity,
    /// Whether the output is a regular file, with a length and a position.
    regular: bool,
    /// The process that has created the file.
    process: u32,
    length: u64,
    ledger: Option<Ledger>,
    /// Whether the file was opened again; a warning is logged the first time.
    reopened: bool,
    /// The changes of the file, for tests that collect them.
    #[cfg(test)]
    pub(super) changes: Option<Vec<Change>>,
}

/// A change of a file, by one call of the operating system.
#[cfg(test)]
#[derive(Debug)]
pub(super) enum Change {
    Bytes(u64, Vec<u8>),
    Length(u64),
}

impl OutputFile {
    /// Creates an empty file, and its folder if the folder is missing, and locks the file against other runs; or opens
    /// a pipe or a device.
    pub(super) fn create(path: &Path) -> Result<Self, ResultsError> {
        let failed = |source| ResultsError::Write { path: path.to_owned(), source };
        #[cfg(unix)]
        let stream = stream::open(path).map_err(failed)?;
        #[cfg(not(unix))]
        let stream: Option<File> = None;
        let is_stream = stream.is_some();
        let file = if let Some(stream) = stream {
            stream
        } else {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            folder.map_or(Ok(()), fs::create_dir_all).map_err(failed)?;
            let file = open_alone(path, true).map_err(failed)?;
            file.ok_or_else(|| ResultsError::InUse { path: path.to_owned() })?
        };
        let metadata = file.metadata().map_err(failed)?;
        let regular = metadata.is_file() && !is_stream;
        if regular && metadata.len() > 0 {
            tracing::info!("{}: replaces the file of this name", path.display());
            file.set_len(0).map_err(failed)?;
        }
        let absolute = std::path::absolute(path).map_err(failed)?;
        let identity = Identity::new(&metadata);
        Ok(Self {
            path: path.to_owned(),
            ledger: regular.then(|| Ledger::enter(&absolute, identity)).flatten(),
            absolute,
            file: with_high_descriptor(file),
            identity,
            regular,
            process: process::id(),
            length: 0,
            reopened: false,
            #[cfg(test)]
            changes: None,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file that the writer expects.
    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Checks that this process created the file, that it is still the same file, and that its length and position
    /// have not changed since the last write.
    ///
    /// Opens the file again if only the descriptor is lost. Cuts off bytes that others have appended and resets the
    /// position: this call returns an error, and later ones succeed. For a file that others have shortened, every call
    /// returns an error. Length and position of a pipe or a device are not checked.
    pub(super) fn verify(&mut self) -> Result<(), ResultsError> {
        if process::id() != self.process {
            return Err(ResultsError::Forked { path: self.path.clone() });
        }
        let metadata = self.file.metadata().ok();
        let metadata = metadata.filter(|metadata| Identity::new(metadata) == self.identity);
        let metadata = match metadata {
            Some(metadata) => metadata,
            None => self.reopen()?,
        };
        if !self.regular {
            return Ok(());
        }
        if links(&metadata) == 0 {
            return Err(self.gone());
        }
        let size = metadata.len();
        let position = (&self.file).stream_position().map_err(|error| self.failed(error))?;
        if size == self.length && position == self.length {
            return Ok(());
        }
        if size >= self.length {
            // Later writes then append at the right place.
            let length = self.length;
            self.set_length(length)?;
        }
        Err(if size == self.length {
            ResultsError::Overwritten { path: self.path.clone() }
        } else {
            ResultsError::Length { path: self.path.clone(), expected: self.length, actual: size }
        })
    }

    /// Opens the file again after its descriptor was closed or replaced; returns its metadata.
    fn reopen(&mut self) -> Result<Metadata, ResultsError> {
        if !self.regular {
            return Err(self.gone());
        }
        let file = open_alone(&self.absolute, false).ok().flatten().ok_or_else(|| self.gone())?;
        let metadata = file.metadata().map_err(|error| self.failed(error))?;
        if Identity::new(&metadata) != self.identity {
            return Err(self.gone());
        }
        let mut file = with_high_descriptor(file);
        file.seek(SeekFrom::Start(self.length)).map_err(|error| self.failed(error))?;
        // Not closed: the number of the former descriptor may by now belong to a file of the FMU.
        forget(std::mem::replace(&mut self.file, file));
        if !std::mem::replace(&mut self.reopened, true) {
            tracing::warn!(
                "{}: an FMU has closed or replaced the descriptor of this file, which was opened again; \
                 no row is lost. With --isolate no FMU reaches the files of the command",
                self.path.display()
            );
        }
        Ok(metadata)
    }

    /// Appends to the file; call [`Self::verify`] first. After a failure the file keeps its former content, while a
    /// pipe or a device may have received a part.
    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<(), ResultsError> {
        #[cfg(unix)]
        if !self.regular {
            let written = stream::write(&mut self.file, bytes, &self.path);
            return written.map_err(|error| self.failed(error));
        }
        if let Err(error) = self.file.write_all(bytes) {
            // Without the incomplete line, which a reader could take for a row.
            let length = self.length;
            let _ = self.set_length(length);
            return Err(self.failed(error));
        }
        self.length += bytes.len() as u64;
        Ok(())
    }

    /// Writes `bytes` at `offset`. The position of the file is then behind these bytes.
    pub(super) fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<(), ResultsError> {
        #[cfg(test)]
        if let Some(changes) = &mut self.changes {
            changes.push(Change::Bytes(offset, bytes.to_vec()));
        }
        let sought = self.file.seek(SeekFrom::Start(offset));
        sought.and_then(|_| self.file.write_all(bytes)).map_err(|error| self.failed(error))
    }

    /// Sets the length of the file, and moves its position to the new end.
    pub(super) fn set_length(&mut self, length: u64) -> Result<(), ResultsError> {
        #[cfg(test)]
        if let Some(changes) = &mut self.changes {
            changes.push(Change::Length(length));
        }
        self.file.set_len(length).map_err(|error| self.failed(error))?;
        self.file.seek(SeekFrom::Start(length)).map_err(|error| self.failed(error))?;
        self.length = length;
        Ok(())
    }

    /// Empties a file whose start cannot be written, or removes the file if it cannot be emptied either. The caller
    /// reports the error of the write.
    pub(super) fn abandon(mut self) {
        if self.set_length(0).is_err() && self.regular {
            let _ = fs::remove_file(&self.absolute);
        }
    }

    /// Checks that the path still leads to the file; a pipe or a device is not checked.
    pub(super) fn verify_path(&self) -> Result<(), ResultsError> {
        let leads = || {
            let (named, written) = (fs::metadata(&self.absolute)?, self.file.metadata()?);
            // Some network file systems give a file a new number while it is open.
            Ok::<_, io::Error>(
                Identity::new(&named) == self.identity
                    || named.len() == written.len() && named.modified()? == written.modified()?,
            )
        };
        if !self.regular || leads().unwrap_or(false) { Ok(()) } else { Err(self.gone()) }
    }

    /// Tells a supervising process that all rows so far are in the file, and with `is_complete` that no row follows.
    pub(super) fn record(&self, is_complete: bool) {
        if let Some(ledger) = self.ledger {
            ledger.written(self.length, is_complete);
        }
    }

    /// Shares `rows`, which are not yet in the file, with a supervising process, which already has the bytes before
    /// `start`. Returns false if the shared memory is full: then the rows must be written now. Returns true if no
    /// process supervises this file.
    #[inline]
    pub(super) fn keep(&self, rows: &[u8], start: usize) -> bool {
        self.ledger.is_none_or(|ledger| ledger.keep(rows, start))
    }

    fn gone(&self) -> ResultsError {
        ResultsError::Gone { path: self.path.clone() }
    }

    fn failed(&self, source: io::Error) -> ResultsError {
        ResultsError::Write { path: self.path.clone(), source }
    }
}

#[cfg(unix)]
fn links(metadata: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(metadata)
}

#[cfg(not(unix))]
fn links(_: &Metadata) -> u64 {
    1
}

/// Gives up a file without closing its descriptor, whose number may belong to another file.
#[cfg(unix)]
fn forget(file: File) {
    let _ = std::os::fd::IntoRawFd::into_raw_fd(file);
}

#[cfg(not(unix))]
fn forget(_: File) {}

/// Moves the descriptor of a file to [`DESCRIPTOR`] or above, if the process may have such a number.
#[cfg(unix)]
fn with_high_descriptor(file: File) -> File {
    rustix::io::fcntl_dupfd_cloexec(&file, DESCRIPTOR).map_or(file, File::from)
}

#[cfg(not(unix))]
fn with_high_descriptor(file: File) -> File {
    file
}

/// Whether the path is [`STANDARD_OUTPUT`] or leads to a pipe or a device, which takes CSV only and cannot be read
/// again.
#[must_use]
pub fn is_stream(path: &Path) -> bool {
    path == Path::new(STANDARD_OUTPUT)
        || fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// Opens a file for exclusive writing without changing its content; `None` if another run has locked it. With
/// `create`, a missing file is created. The lock is released when the process ends, even by a crash.
#[cfg(not(windows))]
fn open_alone(path: &Path, create: bool) -> io::Result<Option<File>> {
    let file = File::options().write(true).create(create).truncate(false).open(path)?;
    match file.try_lock() {
        // An error means that the file system has no locks: assume that the file is free.
        Ok(()) | Err(fs::TryLockError::Error(_)) => Ok(Some(file)),
        Err(fs::TryLockError::WouldBlock) => Ok(None),
    }
}

/// Opens a file for exclusive writing, as on other systems. Readers may open it at the same time.
#[cfg(windows)]
fn open_alone(path: &Path, create: bool) -> io::Result<Option<File>> {
    use std::os::windows::fs::OpenOptionsExt as _;
    const FILE_SHARE_READ: u32 = 1;
    const ERROR_SHARING_VIOLATION: i32 = 32;
    let mut options = File::options();
    options.write(true).create(create).truncate(false).share_mode(FILE_SHARE_READ);
    match options.open(path) {
        Err(error) if error.raw_os_error() == Some(ERROR_SHARING_VIOLATION) => Ok(None),
        opened => opened.map(Some),
    }
}

#[cfg(test)]
mod tests;
