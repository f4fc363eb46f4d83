//! Unpacking an FMU.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::archive::Archive;
use super::{DESCRIPTION, PackageError, TemporaryFolder, file_error, platforms};
use crate::description::{ModelDescription, Warning};

/// The folders of `binaries` that the standard names.
const PLATFORMS: [&str; 15] = [
    "win32",
    "win64",
    "linux32",
    "linux64",
    "darwin32",
    "darwin64",
    "x86-windows",
    "x86_64-windows",
    "aarch64-windows",
    "x86-linux",
    "x86_64-linux",
    "aarch64-linux",
    "x86-darwin",
    "x86_64-darwin",
    "aarch64-darwin",
];

/// An FMU as a folder, with its model description.
#[derive(Debug)]
pub struct Unpacked {
    folder: PathBuf,
    /// Removes the folder at the end, if it was made for this.
    temporary: Option<TemporaryFolder>,
    /// The entries of the archive, if there was one.
    names: Vec<String>,
    /// What `modelDescription.xml` says.
    pub description: ModelDescription,
    /// What in it breaks the standard and was read all the same.
    pub warnings: Vec<Warning>,
    /// The same of the archive: a sentence each.
    pub archive_warnings: Vec<String>,
}

impl Unpacked {
    /// Unpacks what a simulation can need of the archive at `path` into a new temporary folder, which
    /// lives as long as the result. A library loaded from it must be closed before. Left out are
    /// documentation, sources, pictures and the libraries of other platforms. Backslashes in paths are
    /// read as slashes and parts `.` are skipped, with a sentence in [`Unpacked::archive_warnings`].
    ///
    /// # Errors
    ///
    /// [`PackageError`] if the file is no ZIP archive, has entries that lead out of the folder,
    /// links, duplicate names, a file and a folder of one name, overlapping or encrypted entries,
    /// more than 100,000 entries, more than 4 GiB or more than 64 MiB and 100 times its own size, or
    /// no readable `modelDescription.xml` at its root. What is refused for its list of entries is so
    /// before anything is written.
    pub fn open(path: &Path) -> Result<Self, PackageError> {
        Self::unpack(path, is_needed)
    }

    /// As [`Unpacked::open`], all of it: to pack it again, or to look at the rest.
    ///
    /// # Errors
    ///
    /// Those of [`Unpacked::open`].
    pub fn open_whole(path: &Path) -> Result<Self, PackageError> {
        Self::unpack(path, |_| true)
    }

    fn unpack(path: &Path, wanted: impl Fn(&str) -> bool) -> Result<Self, PackageError> {
        let mut archive = Archive::open(path)?;
        if !archive.names().iter().any(|name| name == DESCRIPTION) {
            return Err(missing(archive.names()));
        }
        let temporary = folder()?;
        archive.unpack(temporary.path(), wanted)?;
        let (description, warnings) = describe(temporary.path(), path)?;
        let archive_warnings = archive.warnings();
        let names = archive.names().iter().filter(|name| !name.is_empty()).cloned().collect();
        let (folder, temporary) = (temporary.path().to_owned(), Some(temporary));
        Ok(Unpacked { folder, temporary, names, description, warnings, archive_warnings })
    }

    /// Uses the FMU that is already unpacked in `folder`.
    ///
    /// # Errors
    ///
    /// [`PackageError`] if there is no readable `modelDescription.xml`.
    pub fn in_folder(folder: &Path) -> Result<Self, PackageError> {
        let folder = folder.canonicalize().map_err(file_error("open", folder))?;
        let (description, warnings) = describe(&folder, &folder)?;
        let (names, archive_warnings) = (Vec::new(), Vec::new());
        Ok(Unpacked { folder, temporary: None, names, description, warnings, archive_warnings })
    }

    /// The folder with `modelDescription.xml`; an absolute path.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.temporary.as_ref().map_or(&self.folder, TemporaryFolder::path)
    }

    /// The names of all entries of the archive, those of folders with a slash at their end; none where
    /// the FMU was given as a folder.
    #[must_use]
    pub fn entries(&self) -> &[String] {
        &self.names
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
            let found = self.libraries();
            PackageError::Missing {
                expected: format!("the library {}", wanted.join(" or ")),
                found: if found.is_empty() { "no library".to_owned() } else { found.join(", ") },
            }
        })
    }

    /// The files two levels below `binaries`, whatever its case; at most 20, sorted.
    fn libraries(&self) -> Vec<String> {
        let mut found = if self.temporary.is_some() {
            self.names.clone()
        } else {
            below(self.folder())
                .filter(|path| path.is_dir())
                .flat_map(|top| below(&top).collect::<Vec<_>>())
                .flat_map(|platform| below(&platform).collect::<Vec<_>>())
                .filter_map(|file| {
                    let parts = file.strip_prefix(self.folder()).ok()?.iter();
                    let parts: Vec<_> = parts.map(|part| part.to_string_lossy()).collect();
                    Some(parts.join("/"))
                })
                .collect()
        };
        found.retain(|name| {
            let parts: Vec<&str> = name.split('/').collect();
            matches!(parts.as_slice(), [top, _, file]
                if top.eq_ignore_ascii_case("binaries") && !file.is_empty())
        });
        found.sort();
        found.truncate(20);
        found
    }
}

fn below(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

/// Whether a simulation on this platform can need the file: all but what it certainly does not.
fn is_needed(name: &str) -> bool {
    let mut parts = name.split('/');
    match (parts.next(), parts.next()) {
        (Some("documentation" | "sources" | "terminalsAndIcons" | "model.png"), _) => false,
        (Some("binaries"), Some(platform)) => {
            platforms().contains(&platform) || !PLATFORMS.contains(&platform)
        }
        _ => true,
    }
}

/// Unpacks the ZIP archive at `path` (an FMU, or an SSP) into a new temporary folder: the folder, and
/// what in the archive breaks the rules for paths and was read all the same, a sentence each.
///
/// # Errors
///
/// [`PackageError`] as for [`Unpacked::open`], whatever is in the archive.
pub fn unpack_archive(path: &Path) -> Result<(TemporaryFolder, Vec<String>), PackageError> {
    let mut archive = Archive::open(path)?;
    let folder = folder()?;
    archive.unpack(folder.path(), |_| true)?;
    Ok((folder, archive.warnings()))
}

fn folder() -> Result<TemporaryFolder, PackageError> {
    TemporaryFolder::new().map_err(file_error("create a folder in", std::env::temp_dir()))
}

fn describe(folder: &Path, path: &Path) -> Result<(ModelDescription, Vec<Warning>), PackageError> {
    let file = folder.join(DESCRIPTION);
    let xml = match start(&file) {
        Ok(xml) => xml,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let names =
                below(folder).filter_map(|path| path.file_name()?.to_str().map(str::to_owned));
            return Err(missing(&names.collect::<Vec<_>>()));
        }
        Err(error) => return Err(file_error("read", file)(error)),
    };
    ModelDescription::read(xml)
        .map_err(|source| PackageError::Description { path: path.to_owned(), source })
}

/// A file, or as much of it as is longer than every model description.
fn start(file: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let most = u64::try_from(ModelDescription::MOST_BYTES).unwrap_or(u64::MAX);
    fs::File::open(file)?.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// No model description among `names`: one that is nearly there, or what there is.
fn missing(names: &[String]) -> PackageError {
    let near = names.iter().find(|name| {
        let file = name.rsplit_once('/').map_or(name.as_str(), |(_, file)| file);
        file.eq_ignore_ascii_case(DESCRIPTION)
    });
    let mut tops: Vec<&str> =
        names.iter().map(|name| name.split('/').next().unwrap_or(name)).collect();
    tops.sort_unstable();
    tops.dedup();
    tops.truncate(10);
    let found = match near {
        Some(near) if near.eq_ignore_ascii_case(DESCRIPTION) => {
            format!("{near}, which differs in upper and lower case")
        }
        Some(near) => format!("{near}, which is in a folder"),
        None if tops.is_empty() => "nothing".to_owned(),
        None => tops.join(", "),
    };
    PackageError::Missing { expected: format!("{DESCRIPTION} at the root of the FMU"), found }
}
