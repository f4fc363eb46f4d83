//! Files that are there as a whole or not at all.

use std::path::{Path, PathBuf};
use std::{fs, io, process};

/// A file that is written and not yet there; it goes when this is dropped.
pub struct Pending {
    partial: PathBuf,
    path: PathBuf,
}

impl Pending {
    /// Writes `bytes` into a file beside `path`, whose folder is made where it is missing.
    ///
    /// # Errors
    ///
    /// The file, or the folder around it, cannot be written.
    pub fn new(path: &Path, bytes: &[u8]) -> io::Result<Self> {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".{}.partial", process::id()));
        let pending = Self { partial: PathBuf::from(name), path: path.to_owned() };
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(&pending.partial, bytes)?;
        Ok(pending)
    }

    /// Gives it its name.
    ///
    /// # Errors
    ///
    /// The file, or the folder around it, cannot be written.
    pub fn commit(self) -> io::Result<()> {
        fs::rename(&self.partial, &self.path)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        // Gone after a commit; that the remains of a failure cannot be removed adds nothing to it.
        let _ = fs::remove_file(&self.partial);
    }
}

/// Writes `bytes` to `path`, whose folder is made where it is missing: into a file beside it, which
/// then takes its name.
///
/// # Errors
///
/// The file, or the folder around it, cannot be written.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    Pending::new(path, bytes)?.commit()
}
