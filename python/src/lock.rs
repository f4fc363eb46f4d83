//! A file lock, so that only one process writes into a folder.

use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;

/// An exclusive lock on a file. It ends with [`FileLock::release`] and when the process ends, even by a crash.
#[pyclass(frozen, module = "aso_ftc._core")]
pub(crate) struct FileLock {
    /// `None` after the release, and where the file cannot be locked.
    file: Mutex<Option<File>>,
}

#[pymethods]
impl FileLock {
    /// Ends the lock.
    fn release(&self) {
        let file = self.file.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(file) = file {
            // After a mere close, a fork of this process would still hold the lock.
            let _ = file.unlock();
        }
    }
}

/// Locks a file, which is created if it is missing. Returns `None` if another [`FileLock`], of this or another process,
/// has the lock. If the file system has no locks, or the file may not be opened, returns a `FileLock` without a lock.
/// Raises `OSError` if the file cannot be opened for another reason.
#[pyfunction]
pub(crate) fn lock_file(path: PathBuf) -> PyResult<Option<FileLock>> {
    let file = open(&path)?;
    if let Some(file) = &file
        && matches!(file.try_lock(), Err(TryLockError::WouldBlock))
    {
        return Ok(None);
    }
    Ok(Some(FileLock { file: Mutex::new(file) }))
}

/// Opens a file to lock it, for reading if the file may not be written; `None` if reading is not allowed either.
fn open(path: &Path) -> io::Result<Option<File>> {
    match File::options().read(true).write(true).create(true).truncate(false).open(path) {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem
            ) =>
        {
            Ok(File::open(path).ok())
        }
        opened => opened.map(Some),
    }
}
