//! Temporary folders. On Unix, if a process is killed, its folders are removed by the next process that creates one.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, Once, PoisonError, TryLockError};

use tempfile::TempDir;

/// Common prefix of the names of temporary folders.
const PREFIX: &str = "fmi2-unpacked-";
/// Maximum number of attempts to create a folder, because another process may remove the folder before it is locked.
const ATTEMPTS: usize = 10;

/// The temporary folders of this process.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A temporary folder, removed on drop.
///
/// On Unix the folders of a killed process are removed too: the lock on a folder ends with the process that created the
/// folder, and the next process removes unlocked folders before it creates its first one.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    /// The lock by which other processes see that the folder is in use; released after the folder is
    /// removed. `None` if there are no locks.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Creates a folder in the system's folder for temporary files. On Unix, the first call of a process removes
    /// the folders that killed processes left.
    ///
    /// # Errors
    ///
    /// If the folder cannot be created or opened, or if other processes remove 10 folders before they are locked.
    pub fn new() -> io::Result<Self> {
        static CLEARED: Once = Once::new();
        let parent = std::env::temp_dir();
        CLEARED.call_once(|| remove_abandoned(&parent));
        for _ in 0..ATTEMPTS {
            let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(&parent)?;
            let lock = match lock(folder.path()) {
                Ok(lock) => lock,
                Err(error) if is_taken(&error) => continue,
                Err(error) => return Err(error),
            };
            let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
            folders.push(folder.path().to_owned());
            return Ok(Self { folder, _lock: lock });
        }
        Err(io::Error::other("other processes remove the folders as soon as they are made"))
    }

    /// The path of the folder.
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

/// Removes all temporary folders of this process: for a process that is about to end without dropping its values.
/// Libraries in the folders may still be loaded.
///
/// Does nothing if another thread is creating or dropping such a folder. Ignores errors.
pub fn remove_temporary_folders() {
    let folders = match FOLDERS.try_lock() {
        Ok(folders) => folders,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        // The thread that holds the lock may never continue.
        Err(TryLockError::WouldBlock) => return,
    };
    for folder in folders.iter() {
        // Folders that cannot be removed now are removed by the next process.
        let _ = std::fs::remove_dir_all(folder);
    }
}

/// Removes the folders that killed processes left, on Unix; elsewhere does nothing.
pub fn remove_abandoned_folders() {
    remove_abandoned(&std::env::temp_dir());
}

/// Returns whether the error of [`lock`] says that another process is removing the folder, or has removed it.
fn is_taken(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::NotFound)
}

/// Locks the folder at `path`; `None` without locks, an error if another process has locked or removed it.
#[cfg(unix)]
fn lock(path: &Path) -> io::Result<Option<File>> {
    use std::os::unix::fs::MetadataExt as _;
    let file = File::open(path)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(std::fs::TryLockError::WouldBlock) => return Err(ErrorKind::WouldBlock.into()),
        // The file system has no locks, so no other process can hold one.
        Err(std::fs::TryLockError::Error(_)) => return Ok(None),
    }
    let same = std::fs::symlink_metadata(path)?.ino() == file.metadata()?.ino();
    if same { Ok(Some(file)) } else { Err(ErrorKind::NotFound.into()) }
}

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "the signature is that of Unix")]
fn lock(_: &Path) -> io::Result<Option<File>> {
    Ok(None)
}

/// Removes the folders in `parent` that no process has locked.
fn remove_abandoned(parent: &Path) {
    let entries = std::fs::read_dir(parent).into_iter().flatten().flatten();
    for entry in entries {
        let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX)
            && entry.file_type().is_ok_and(|kind| kind.is_dir());
        // Without locks it is unknown whether a folder is in use.
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

    /// Another attempt helps against other processes, but not if too many files are open.
    #[test]
    fn a_folder_is_taken_if_it_is_locked_or_removed() {
        const EMFILE: i32 = 24;
        let folder = tempfile::tempdir().unwrap();
        let error = |path: &Path| lock(path).unwrap_err();
        let _lock = lock(folder.path()).unwrap();
        assert!(is_taken(&error(folder.path())));
        assert!(is_taken(&error(&folder.path().join("gone"))));
        assert!(!is_taken(&io::Error::from_raw_os_error(EMFILE)));
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
