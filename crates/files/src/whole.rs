//! Atomic writing of files: a reader sees the complete file or the previous one.

use std::path::{Path, PathBuf};
use std::{fs, io, process};

use crate::distinct::is_stream;

/// A written file under a temporary name, which is removed on drop unless [`Pending::commit`] renames it.
pub struct Pending {
    partial: PathBuf,
    path: PathBuf,
}

impl Pending {
    /// Writes `bytes` to a temporary file beside `path`; creates the folder if it is missing.
    ///
    /// # Errors
    ///
    /// [`io::Error`] if the folder or the temporary file cannot be created or written.
    pub fn new(path: &Path, bytes: &[u8]) -> io::Result<Self> {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".{}.partial", process::id()));
        let pending = Self { partial: PathBuf::from(name), path: path.to_owned() };
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(&pending.partial, bytes)?;
        Ok(pending)
    }

    /// Renames the file to its final name; replaces a file of that name.
    ///
    /// # Errors
    ///
    /// [`io::Error`] if the file cannot be renamed; the temporary file is then removed.
    pub fn commit(self) -> io::Result<()> {
        fs::rename(&self.partial, &self.path)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        // Fails after a commit, because the temporary file no longer exists.
        let _ = fs::remove_file(&self.partial);
    }
}

/// Writes `bytes` to `path` atomically: to a temporary file beside `path`, which is then renamed. Creates the folder if
/// it is missing. Writes directly to a pipe or a device.
///
/// # Errors
///
/// [`io::Error`] if the folder or a file cannot be created, written or renamed.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if is_stream(path) { fs::write(path, bytes) } else { Pending::new(path, bytes)?.commit() }
}
