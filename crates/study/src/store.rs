//! FMUs and system structures that several runs of one process share.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use ssp::Opened;

use crate::content::Content;
use crate::error::Error;

/// FMUs and SSP archives that are unpacked, parsed and loaded once for several runs.
///
/// A file is opened again if its size or its time of modification has changed. An FMU that can be
/// instantiated only once per process is not kept unless it runs in separate processes, so that every run
/// loads it anew. Other system structures than SSP archives are not kept, because they refer to further files.
#[derive(Default)]
pub struct Store {
    fmus: Mutex<HashMap<FmuKey, Content>>,
    systems: Mutex<HashMap<Stamp, Arc<Opened>>>,
}

/// Identifies a file and its content: a changed file has another stamp.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Stamp {
    path: PathBuf,
    size: u64,
    modified: Option<SystemTime>,
}

impl Stamp {
    /// Returns the stamp of the file at `path`, or of the description in the folder at `path`; `None`
    /// if the file or the description does not exist.
    fn of(path: &Path) -> Option<Self> {
        let path = std::path::absolute(path).ok()?;
        let mut data = path.metadata().ok()?;
        if data.is_dir() {
            let names = ["modelDescription.xml", "SystemStructure.ssd", "OspSystemStructure.xml"];
            data = names.iter().find_map(|name| path.join(name).metadata().ok())?;
        }
        Some(Self { path, size: data.len(), modified: data.modified().ok() })
    }
}

/// Identifies an FMU in the store, for instances in this process or in separate processes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct FmuKey {
    stamp: Stamp,
    isolated: bool,
}

impl Store {
    /// Returns the FMU at `path`; opens it with `open` if the store does not have it, and keeps it if several runs can
    /// use it.
    pub(crate) fn fmu(
        &self,
        path: &Path,
        isolated: bool,
        open: impl FnOnce() -> Result<Content, Error>,
    ) -> Result<Content, Error> {
        let Some(stamp) = Stamp::of(path) else { return open() };
        let mut fmus = lock(&self.fmus);
        let key = FmuKey { stamp, isolated };
        if let Some(content) = fmus.get(&key) {
            return Ok(content.clone());
        }
        let content = open()?;
        if content.is_reusable() {
            let path = &key.stamp.path;
            fmus.retain(|stored, _| stored.isolated != isolated || stored.stamp.path != *path);
            fmus.insert(key, content.clone());
        }
        Ok(content)
    }

    /// Returns the system structure at `path`; opens it with `open` if the store does not have it, and keeps it
    /// if it is an SSP archive.
    pub(crate) fn system(
        &self,
        path: &Path,
        open: impl FnOnce() -> Result<Opened, Error>,
    ) -> Result<Arc<Opened>, Error> {
        // A folder, an SSD or an OSP file refers to further files, whose changes its stamp would not show.
        let is_archive = path.is_file()
            && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ssp"));
        let Some(stamp) = Stamp::of(path).filter(|_| is_archive) else {
            return open().map(Arc::new);
        };
        let mut systems = lock(&self.systems);
        if let Some(opened) = systems.get(&stamp) {
            return Ok(opened.clone());
        }
        let opened = Arc::new(open()?);
        systems.retain(|stored, _| stored.path != stamp.path);
        systems.insert(stamp, opened.clone());
        Ok(opened)
    }

    /// Removes all FMUs and system structures from the store. Their unpacked files are removed when the last run
    /// that uses them ends.
    pub fn clear(&self) {
        lock(&self.fmus).clear();
        lock(&self.systems).clear();
    }

    /// Returns the number of FMUs in the store.
    #[must_use]
    pub fn len(&self) -> usize {
        lock(&self.fmus).len()
    }

    /// Returns whether there is no FMU in the store; the store may still have system structures.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl fmt::Debug for Store {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Store").field("fmus", &self.len()).finish_non_exhaustive()
    }
}

/// Locks `mutex`, even if another thread panicked with the lock held.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
