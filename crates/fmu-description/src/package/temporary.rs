//! Temporary folders that do not outlive their process, however it ends.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, Once, PoisonError, TryLockError};

use tempfile::TempDir;

/// What the names of all these folders begin with.
const PREFIX: &str = "fmi2-unpacked-";
/// How often a folder is made that another process removes before it is locked.
const ATTEMPTS: usize = 10;

/// The folders of this process.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A temporary folder, removed when this is dropped.
///
/// On Unix a process that is killed leaves none for long: a lock on the folder ends with its process,
/// and the first folder of the next process removes those that nobody locks.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    /// Tells other processes that the folder is in use; released after the folder is removed.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Makes a folder in that of the system for temporary files.
    ///
    /// # Errors
    ///
    /// Where the file system refuses.
    pub fn new() -> io::Result<Self> {
        static CLEARED: Once = Once::new();
        let parent = std::env::temp_dir();
        CLEARED.call_once(|| remove_abandoned(&parent));
        for _ in 0..ATTEMPTS {
            let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(&parent)?;
            if let Ok(lock) = lock(folder.path()) {
                let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
                folders.push(folder.path().to_owned());
                return Ok(Self { folder, _lock: lock });
            }
        }
        Err(io::Error::other("other processes remove the folders as soon as they are made"))
    }

    /// Its path, absolute.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
        folders.retain(|folder| folder != self.folder.path());
    }
}

/// Removes the temporary folders of this process: for one that is about to end without dropping what
/// it has. Libraries in them may be loaded still.
pub fn remove_temporary_folders() {
    let folders = match FOLDERS.try_lock() {
        Ok(folders) => folders,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        // Held by a thread that stands still for ever.
        Err(TryLockError::WouldBlock) => return,
    };
    for folder in folders.iter() {
        // What cannot be removed now is removed by the next process.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// Locks the folder at `path`; an error where another process has it, or has removed it.
#[cfg(unix)]
fn lock(path: &Path) -> io::Result<Option<File>> {
    use std::os::unix::fs::MetadataExt as _;
    let file = File::open(path)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(std::fs::TryLockError::WouldBlock) => return Err(io::ErrorKind::WouldBlock.into()),
        // A file system without locks: nobody can have one.
        Err(std::fs::TryLockError::Error(_)) => return Ok(None),
    }
    let same = std::fs::symlink_metadata(path)?.ino() == file.metadata()?.ino();
    if same { Ok(Some(file)) } else { Err(io::ErrorKind::NotFound.into()) }
}

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "as where folders can be locked")]
fn lock(_: &Path) -> io::Result<Option<File>> {
    Ok(None)
}

/// Removes the folders in `parent` that no process has locked.
fn remove_abandoned(parent: &Path) {
    let entries = std::fs::read_dir(parent).into_iter().flatten().flatten();
    for entry in entries {
        let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX)
            && entry.file_type().is_ok_and(|kind| kind.is_dir());
        // Where there are no locks it cannot be known whether a folder is in use.
        if is_ours && let Ok(Some(_lock)) = lock(&entry.path()) {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_folder_in_use_stays_and_one_whose_process_is_gone_is_removed() {
        let parent = tempfile::tempdir().unwrap();
        let (used, abandoned) =
            (parent.path().join("fmi2-unpacked-1"), parent.path().join("fmi2-unpacked-2"));
        let other = parent.path().join("other");
        for folder in [&used, &abandoned, &other] {
            std::fs::create_dir(folder).unwrap();
            std::fs::write(folder.join("file"), "content").unwrap();
        }
        let lock = lock(&used).unwrap();
        remove_abandoned(parent.path());
        assert_eq!((used.exists(), abandoned.exists(), other.exists()), (true, false, true));
        drop(lock);
        remove_abandoned(parent.path());
        assert_eq!((used.exists(), other.exists()), (false, true));
    }

    #[test]
    fn a_folder_is_removed_when_it_is_dropped() {
        let folder = TemporaryFolder::new().unwrap();
        let path = folder.path().to_owned();
        assert!(path.is_dir());
        remove_abandoned(&std::env::temp_dir());
        assert!(path.is_dir(), "in use");
        drop(folder);
        assert!(!path.exists());
    }
}
