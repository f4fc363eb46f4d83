//! A ZIP archive whose names and sizes are checked before anything is unpacked.

use std::cell::Cell;
use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use zip::read::ZipFile;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use crate::limits::{HELP, exceeds, in_force};

use super::{PackageError, archive_error, file_error, paths};

/// Maximum number of entries.
const ENTRIES: usize = 100_000;
/// Maximum size of the list of entries in bytes.
const DIRECTORY: u64 = 32 << 20;
/// Maximum unpacked size of any archive in bytes.
const CAPACITY: u64 = 4 << 30;
/// Unpacked bytes allowed for every archive, however small.
const BASE: u64 = 64 << 20;
/// Unpacked bytes allowed in addition for each byte of the archive. FMUs have ratios of 2 to 10;
/// deflate reaches 1032.
const RATIO: u64 = 100;

/// Size in bytes of the buffer between unpacking and writing.
const BUFFER: usize = 1 << 20;

/// The reason for refusing an archive with two entries of the same name.
const DUPLICATE: &str = "two entries have the same name";
/// The reason for refusing an archive whose entries share bytes, as the entries of a ZIP bomb do.
const OVERLAP: &str = "entries overlap";

/// A reader that fails after `left` bytes.
pub(super) struct Metered<R> {
    inner: R,
    left: Rc<Cell<u64>>,
}

impl<R: Read> Read for Metered<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        let left = self.left.get().checked_sub(u64::try_from(count).unwrap_or(u64::MAX));
        let left =
            left.ok_or_else(|| io::Error::other(format!("the list of entries is too long{HELP}")))?;
        self.left.set(left);
        Ok(count)
    }
}

impl<R: Seek> Seek for Metered<R> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.inner.seek(position)
    }
}

/// Entries whose names were normalised, for a warning.
struct Renamed {
    count: usize,
    /// The first changed name, as stated in the archive.
    stated: String,
    /// The first changed name after normalisation; empty for the root folder.
    read: String,
}

/// The start of a pointer of Git LFS.
const POINTER: &[u8; 23] = b"version https://git-lfs";

/// An archive that is safe to unpack.
pub(super) struct Archive {
    zip: ZipArchive<Metered<BufReader<File>>>,
    path: PathBuf,
    /// The normalised names of all entries in the order of the archive. Names of folders end with a slash; the
    /// name of the root folder itself is empty.
    names: Vec<String>,
    renamed: Option<Renamed>,
    /// The limit of unpacked bytes.
    capacity: u64,
}

/// Returns the error of a file that is no archive. A clone without Git LFS has small text files in place of FMUs.
fn unreadable(path: &Path, error: ZipError) -> PackageError {
    let mut start = [0; POINTER.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    if read.is_err() || start != *POINTER {
        return archive_error(path)(error);
    }
    let help = "it is a pointer of Git LFS; `git lfs pull` fetches the file itself";
    PackageError::Archive { path: path.to_owned(), source: io::Error::other(help) }
}

impl Archive {
    /// Opens the archive at `path` and checks its list of entries; writes nothing.
    pub(super) fn open(path: &Path) -> Result<Self, PackageError> {
        let file = File::open(path).map_err(file_error("open", path))?;
        let length = file.metadata().map_err(file_error("read", path))?.len();
        let left = Rc::new(Cell::new(in_force(DIRECTORY)));
        let reader = Metered { inner: BufReader::new(file), left: left.clone() };
        let zip = ZipArchive::new(reader).map_err(|error| unreadable(path, error))?;
        left.set(u64::MAX);
        let capacity = BASE.saturating_add(RATIO.saturating_mul(length)).min(CAPACITY);
        let capacity = in_force(capacity);
        let (path, names) = (path.to_owned(), Vec::new());
        let mut archive = Self { zip, path, names, renamed: None, capacity };
        archive.check_entries()?;
        Ok(archive)
    }

    /// Reads the names of all entries and checks names, kinds, stated sizes and positions.
    fn check_entries(&mut self) -> Result<(), PackageError> {
        if exceeds(self.zip.len(), ENTRIES) {
            return Err(self.limit(ENTRIES as u64, "entries"));
        }
        let mut total = 0_u64;
        for index in 0..self.zip.len() {
            let entry = self.zip.by_index_data(index).map_err(|error| self.wrong(error))?;
            let stated = entry.name().map_err(|error| self.wrong(error))?.into_owned();
            let name = paths::normalised(&stated);
            let rule = (!name.is_empty()).then(|| paths::unsafe_to_unpack(&name)).flatten();
            let rule = rule.or(entry.is_symlink().then_some("a file or a folder, not a link"));
            if let Some(expected) = rule {
                return Err(PackageError::Entry { entry: stated, expected });
            }
            total = total.saturating_add(entry.size());
            if name != stated {
                let first = Renamed { count: 0, stated, read: name.clone() };
                self.renamed.get_or_insert(first).count += 1;
            }
            self.names.push(name);
        }
        if total > self.capacity {
            return Err(self.limit(self.capacity, "unpacked bytes"));
        }
        if self.renamed.is_some() && has_duplicates(&self.names) {
            return Err(self.wrong(ZipError::InvalidArchive(DUPLICATE.into())));
        }
        if let Some(name) = file_and_folder(&self.names) {
            let expected = "a file or a folder of that name, not both";
            return Err(PackageError::Entry { entry: name, expected });
        }
        if self.zip.has_overlapping_entries().map_err(|error| self.wrong(error))? {
            return Err(self.wrong(ZipError::InvalidArchive(OVERLAP.into())));
        }
        Ok(())
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns a sentence for each tolerated fault of the paths: backslashes or `.`, and repeated names.
    pub(super) fn warnings(&self) -> Vec<String> {
        let sentence = |Renamed { count, stated, read }: &Renamed| {
            let entries = if *count == 1 { "entry has" } else { "entries have" };
            let example =
                if read.is_empty() { "skipped".to_owned() } else { format!("read as {read:?}") };
            format!(
                "{count} {entries} a path with backslashes or . in the archive, for example \
                 {stated:?}: {example}"
            )
        };
        let repeated =
            "several entries of the archive have the same name; the last one of each is used";
        let repeated = self.zip.has_duplicate_names().then(|| repeated.to_owned());
        self.renamed.iter().map(sentence).chain(repeated).collect()
    }

    /// Unpacks the entries for which `is_needed` is true into `folder`, up to the limit of the archive.
    pub(super) fn unpack(
        &mut self,
        folder: &Path,
        is_needed: impl Fn(&str) -> bool,
    ) -> Result<(), PackageError> {
        self.unpack_up_to(folder, self.capacity, is_needed)
    }

    /// Unpacks the entries for which `is_needed` is true into `folder`; fails after `capacity` bytes.
    pub(super) fn unpack_up_to(
        &mut self,
        folder: &Path,
        capacity: u64,
        is_needed: impl Fn(&str) -> bool,
    ) -> Result<(), PackageError> {
        use std::fs;
        let mut left = capacity;
        for (index, name) in self.names.iter().enumerate().filter(|(_, name)| is_needed(name)) {
            if name.is_empty() {
                continue;
            }
            let target = folder.join(name);
            if name.ends_with('/') {
                fs::create_dir_all(&target).map_err(file_error("create", &target))?;
                continue;
            }
            let method = self.zip.by_index_data(index).map(|entry| entry.compression());
            if !matches!(method, Ok(CompressionMethod::Stored | CompressionMethod::Deflated)) {
                let expected = "compression by deflate, or none";
                return Err(PackageError::Entry { entry: name.clone(), expected });
            }
            let entry = self.zip.by_index(index);
            let (path, unit) = (self.path.clone(), "unpacked bytes");
            let limit = || PackageError::Limit { path, limit: capacity, unit, help: HELP };
            // The list of entries may state a wrong size, so the limit applies to the bytes
            // written.
            let entry = entry.map_err(archive_error(&self.path))?;
            let written = write_entry(&self.path, entry, &target, left)?;
            left = left.checked_sub(written).ok_or_else(limit)?;
        }
        Ok(())
    }

    fn wrong(&self, error: ZipError) -> PackageError {
        archive_error(&self.path)(error)
    }

    fn limit(&self, limit: u64, unit: &'static str) -> PackageError {
        PackageError::Limit { path: self.path.clone(), limit, unit, help: HELP }
    }
}

/// Whether two files have the same name; a folder may occur twice.
fn has_duplicates(names: &[String]) -> bool {
    let mut earlier = HashSet::new();
    names
        .iter()
        .filter(|name| !name.is_empty() && !name.ends_with('/'))
        .any(|name| !earlier.insert(name))
}

/// Returns a name that belongs to a file and a folder, if there is one.
fn file_and_folder(names: &[String]) -> Option<String> {
    let files: HashSet<&str> =
        names.iter().filter(|name| !name.ends_with('/')).map(String::as_str).collect();
    let mut folders = HashSet::new();
    for name in names {
        let mut inner = name.strip_suffix('/').map_or(name.as_str(), |folder| folder);
        if inner.len() < name.len() && files.contains(inner) {
            return Some(inner.to_owned());
        }
        while let Some((folder, _)) = inner.rsplit_once('/') {
            if !folders.insert(folder) {
                break;
            }
            if files.contains(folder) {
                return Some(folder.to_owned());
            }
            inner = folder;
        }
    }
    None
}

/// A reader that remembers whether the operating system caused its last error.
struct Source<R> {
    inner: R,
    /// Whether the last call failed with an error of the operating system.
    failed: bool,
}

impl<R: Read> Read for Source<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer);
        self.failed = count.as_ref().is_err_and(|error| error.raw_os_error().is_some());
        count
    }
}

/// Writes one file of `archive` and returns the number of bytes. Stops after `limit` + 1 bytes, even if the archive
/// states another size.
fn write_entry(
    archive: &Path,
    entry: ZipFile<'_, Metered<BufReader<File>>>,
    target: &Path,
    limit: u64,
) -> Result<u64, PackageError> {
    if let Some(parent) = target.parent() {
        std::fs::create_dir_all(parent).map_err(file_error("create", parent))?;
    }
    let executable = entry.unix_mode().is_some_and(|mode| mode & 0o111 != 0);
    let file = File::create_new(target).map_err(file_error("create", target))?;
    let size = usize::try_from(entry.size()).unwrap_or(usize::MAX).clamp(1, BUFFER);
    let mut file = BufWriter::with_capacity(size, file);
    let mut source = Source { inner: entry.take(limit.saturating_add(1)), failed: false };
    let copied = io::copy(&mut source, &mut file);
    let written = copied.and_then(|count| file.flush().map(|()| count)).map_err(|error| {
        let (action, path) = if source.failed { ("read", archive) } else { ("unpack", target) };
        file_error(action, path)(error)
    })?;
    #[cfg(unix)]
    if executable {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(target, mode).map_err(file_error("write", target))?;
    }
    #[cfg(not(unix))]
    let _ = executable;
    Ok(written)
}
