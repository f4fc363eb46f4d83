//! Unpacking an FMU.

use std::fs::{self, File};
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use zip::ZipArchive;
use zip::read::ZipFile;
use zip::result::ZipError;

use super::{DESCRIPTION, PackageError, file_error, paths, platforms};
use crate::description::ModelDescription;

/// Most bytes that are unpacked.
const CAPACITY: u64 = 4 << 30;
/// Most entries that are unpacked.
const ENTRIES: usize = 100_000;

/// What is wrong with an archive that has two entries of one name.
const DUPLICATE: &str = "two entries have the same name";

/// An FMU as a folder, with its model description.
#[derive(Debug)]
pub struct Unpacked {
    folder: PathBuf,
    /// Removes the folder at the end, if it was made for this.
    temporary: Option<TempDir>,
    /// What `modelDescription.xml` says.
    pub description: ModelDescription,
}

impl Unpacked {
    /// Unpacks the archive at `path` into a new temporary folder, which lives as long as the
    /// result. A library loaded from it must be closed before.
    ///
    /// # Errors
    ///
    /// [`PackageError`] if the file is no ZIP archive, has entries that lead out of the folder,
    /// links, duplicate names, encrypted entries, more than 4 GiB or 100,000 entries, or no
    /// readable `modelDescription.xml` at its root.
    pub fn open(path: &Path) -> Result<Self, PackageError> {
        let folder = unpack_archive(path)?;
        let folder_path = folder.path().to_owned();
        let description = describe(&folder_path, path)?;
        Ok(Unpacked { folder: folder_path, temporary: Some(folder), description })
    }

    /// Uses the FMU that is already unpacked in `folder`.
    ///
    /// # Errors
    ///
    /// [`PackageError`] if there is no readable `modelDescription.xml`.
    pub fn in_folder(folder: &Path) -> Result<Self, PackageError> {
        let folder = folder.canonicalize().map_err(file_error("open", folder))?;
        let description = describe(&folder, &folder)?;
        Ok(Unpacked { folder, temporary: None, description })
    }

    /// The folder with `modelDescription.xml`; an absolute path.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.temporary.as_ref().map_or(&self.folder, TempDir::path)
    }

    /// The folder `resources`, whether the FMU has one or not.
    #[must_use]
    pub fn resources(&self) -> PathBuf {
        self.folder().join("resources")
    }

    /// The shared library called `model_identifier` for the platform of this program.
    ///
    /// # Errors
    ///
    /// [`PackageError::Missing`] with the libraries that the FMU has.
    pub fn library(&self, model_identifier: &str) -> Result<PathBuf, PackageError> {
        let name = format!("{model_identifier}{}", std::env::consts::DLL_SUFFIX);
        let binaries = self.folder().join("binaries");
        let candidates = platforms().iter().map(|platform| binaries.join(platform).join(&name));
        candidates.into_iter().find(|path| path.is_file()).ok_or_else(|| {
            let wanted: Vec<String> =
                platforms().iter().map(|platform| format!("binaries/{platform}/{name}")).collect();
            let found = libraries(&binaries);
            PackageError::Missing {
                expected: format!("the library {}", wanted.join(" or ")),
                found: if found.is_empty() { "no library".to_owned() } else { found.join(", ") },
            }
        })
    }
}

/// Unpacks the ZIP archive at `path` (an FMU, or an SSP) into a new temporary folder.
///
/// # Errors
///
/// [`PackageError`] as for [`Unpacked::open`], whatever is in the archive.
pub fn unpack_archive(path: &Path) -> Result<TempDir, PackageError> {
    let file = File::open(path).map_err(file_error("open", path))?;
    let wrong = |source| PackageError::Archive { path: path.to_owned(), source };
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(wrong)?;
    let folder = tempfile::Builder::new().prefix("fmu-").tempdir();
    let folder = folder.map_err(file_error("create a folder in", std::env::temp_dir()))?;
    unpack(&mut archive, path, folder.path(), CAPACITY)?;
    Ok(folder)
}

/// All files two levels below `binaries`, sorted.
fn libraries(binaries: &Path) -> Vec<String> {
    let children = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<String> = children(binaries)
        .flat_map(|platform| children(&platform.path()))
        .filter_map(|file| Some(file.path().strip_prefix(binaries.parent()?).ok()?.to_owned()))
        .map(|path| path.display().to_string())
        .collect();
    found.sort();
    found
}

fn describe(folder: &Path, path: &Path) -> Result<ModelDescription, PackageError> {
    let file = folder.join(DESCRIPTION);
    let xml = match fs::read(&file) {
        Ok(xml) => xml,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(missing(folder)),
        Err(error) => return Err(file_error("read", file)(error)),
    };
    ModelDescription::parse(xml)
        .map_err(|source| PackageError::Description { path: path.to_owned(), source })
}

fn missing(folder: &Path) -> PackageError {
    let names = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names.truncate(10);
    let expected = format!("{DESCRIPTION} at the root of the FMU");
    let found = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    PackageError::Missing { expected, found }
}

pub(super) fn unpack(
    archive: &mut ZipArchive<BufReader<File>>,
    path: &Path,
    folder: &Path,
    capacity: u64,
) -> Result<(), PackageError> {
    let wrong = |source| PackageError::Archive { path: path.to_owned(), source };
    let limit = |limit, unit| PackageError::Limit { path: path.to_owned(), limit, unit };
    if archive.len() > ENTRIES {
        return Err(limit(ENTRIES as u64, "entries"));
    }
    if archive.has_duplicate_names() {
        return Err(wrong(ZipError::InvalidArchive(DUPLICATE.into())));
    }
    let mut left = capacity;
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(wrong)?;
        let name = entry.name().map_err(wrong)?.into_owned();
        let rule = paths::unsafe_to_unpack(&name);
        let rule = rule.or(entry.is_symlink().then_some("a file or a folder, not a link"));
        if let Some(expected) = rule {
            return Err(PackageError::Entry { entry: name, expected });
        }
        let target = folder.join(&name);
        if entry.is_dir() {
            fs::create_dir_all(&target).map_err(file_error("create", &target))?;
            continue;
        }
        if entry.size() > left {
            return Err(limit(capacity, "bytes"));
        }
        let written = write_entry(entry, &target, left)?;
        left = left.checked_sub(written).ok_or_else(|| limit(capacity, "bytes"))?;
    }
    Ok(())
}

/// Writes one file, stopping after `limit` + 1 bytes whatever the archive says of its size.
fn write_entry(
    entry: ZipFile<'_, BufReader<File>>,
    target: &Path,
    limit: u64,
) -> Result<u64, PackageError> {
    if let Some(parent) = target.parent() {
        fs::create_dir_all(parent).map_err(file_error("create", parent))?;
    }
    let executable = entry.unix_mode().is_some_and(|mode| mode & 0o111 != 0);
    let mut file = File::create_new(target).map_err(file_error("create", target))?;
    let written = io::copy(&mut entry.take(limit.saturating_add(1)), &mut file);
    let written = written.map_err(file_error("unpack", target))?;
    #[cfg(unix)]
    if executable {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = fs::Permissions::from_mode(0o755);
        fs::set_permissions(target, mode).map_err(file_error("write", target))?;
    }
    #[cfg(not(unix))]
    let _ = executable;
    Ok(written)
}
