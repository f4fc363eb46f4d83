//! Unpacks an FMU.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::archive::Archive;
use super::{DESCRIPTION, PackageError, TemporaryFolder, file_error, platforms, platforms_of};
use crate::description::{ModelDescription, Version, Warning};
use crate::limits::in_force;
use crate::location::{LocationError, folder_path};
use crate::{terminals, xml};

/// The manifest of FMI-LS-BUS, the layered standard for networks.
const BUS_MANIFEST: &str = "extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml";

/// An unpacked FMU with its model description.
#[derive(Debug)]
pub struct Unpacked {
    folder: PathBuf,
    /// The temporary folder, removed on drop; `None` for an FMU in a folder.
    temporary: Option<TemporaryFolder>,
    /// The absolute path of the archive; `None` for an FMU in a folder.
    archive: Option<PathBuf>,
    /// The names of the archive's entries; empty for an FMU in a folder.
    names: Vec<String>,
    /// The content of `modelDescription.xml`.
    pub description: ModelDescription,
    /// The defects of `modelDescription.xml` that were tolerated.
    pub warnings: Vec<Warning>,
    /// The tolerated defects of the archive, its terminals and the names of its libraries, a sentence each.
    pub archive_warnings: Vec<String>,
}

impl Unpacked {
    /// Unpacks the FMU at `path` into a new temporary folder, which is removed when the result is
    /// dropped.
    ///
    /// Only files that a simulation can need are unpacked: no documentation, sources, pictures, and
    /// no libraries of other platforms. Close a library that was loaded from the folder before you
    /// drop the result. Backslashes in paths are read as slashes and parts `.` are skipped; of several
    /// entries with one name the last is used. [`Unpacked::archive_warnings`] reports both.
    ///
    /// # Errors
    ///
    /// [`PackageError`] if the file is no ZIP archive, or has no readable `modelDescription.xml` at its root; if a path
    /// leads out of the folder, has control characters, more than 1024 bytes or more than 64 levels; if there are
    /// links, overlapping or encrypted entries, a file and a folder of one name, or names that differ only in
    /// backslashes and parts `.`; or if a needed entry has a compression other than deflate. Also, unless
    /// [`crate::limits`] are lifted, if the archive has more than 100,000 entries, more than 32 MiB in its list of
    /// entries, or more unpacked bytes than 4 GiB or than 64 MiB plus 100 times its own size. Names, kinds, stated
    /// sizes and positions are checked before anything is written, the compression of an entry before that entry is
    /// written.
    pub fn open(path: &Path) -> Result<Self, PackageError> {
        Self::unpack(path, is_needed)
    }

    /// Unpacks the FMU as [`Unpacked::open`] does, but all files, so that they can be packed again or checked.
    ///
    /// # Errors
    ///
    /// Same as [`Unpacked::open`].
    pub fn open_whole(path: &Path) -> Result<Self, PackageError> {
        Self::unpack(path, |_| true)
    }

    fn unpack(path: &Path, is_needed: impl Fn(&str) -> bool) -> Result<Self, PackageError> {
        let mut archive = Archive::open(path)?;
        let place = std::path::absolute(path).map_err(file_error("open", path))?;
        if !archive.names().iter().any(|name| name == DESCRIPTION) {
            return Err(missing(archive.names()));
        }
        let temporary = temporary_folder()?;
        archive.unpack(temporary.path(), is_needed)?;
        let (mut description, warnings) = describe(temporary.path(), path)?;
        let mut archive_warnings = archive.warnings();
        archive_warnings.extend(add_terminals(temporary.path(), &mut description));
        let names = archive.names().iter().filter(|name| !name.is_empty()).cloned().collect();
        let mut unpacked = Unpacked {
            folder: temporary.path().to_owned(),
            temporary: Some(temporary),
            archive: Some(place),
            names,
            description,
            warnings,
            archive_warnings,
        };
        unpacked.warn_of_other_names();
        Ok(unpacked)
    }

    /// Uses the FMU that is already unpacked in `folder`.
    ///
    /// # Errors
    ///
    /// [`PackageError`] if there is no such folder, or no readable `modelDescription.xml` in it.
    pub fn in_folder(folder: &Path) -> Result<Self, PackageError> {
        let folder = folder.canonicalize().map_err(file_error("open", folder))?;
        let (mut description, warnings) = describe(&folder, &folder)?;
        let archive_warnings = add_terminals(&folder, &mut description).into_iter().collect();
        let mut unpacked = Unpacked {
            folder,
            temporary: None,
            archive: None,
            names: Vec::new(),
            description,
            warnings,
            archive_warnings,
        };
        unpacked.warn_of_other_names();
        Ok(unpacked)
    }

    /// The folder with `modelDescription.xml`, as an absolute path.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The absolute path of the archive, which may have files that are not in [`Unpacked::folder`]; `None` for an FMU
    /// in a folder.
    #[must_use]
    pub fn archive(&self) -> Option<&Path> {
        self.archive.as_deref()
    }

    /// The names of all entries of the archive, with a slash at the end of folders; empty for an FMU in a
    /// folder.
    #[must_use]
    pub fn entries(&self) -> &[String] {
        &self.names
    }

    /// The path of the folder `resources`, which may not exist.
    #[must_use]
    pub fn resources(&self) -> PathBuf {
        self.folder().join("resources")
    }

    /// The argument `resourcePath` of FMI 3.0: the absolute path of the folder `resources` with a
    /// separator at its end; `None` if the FMU has no such folder (FMI 3.0.2, section 2.3.1).
    ///
    /// # Errors
    ///
    /// [`LocationError`] if the path is not Unicode.
    pub fn resource_path(&self) -> Result<Option<String>, LocationError> {
        let resources = self.resources();
        resources.is_dir().then(|| folder_path(&resources)).transpose()
    }

    /// The path of the shared library `model_identifier` for the platform of this program, in the first folder of
    /// [`platforms_of`] that has it. If none has it, the path of the only library in these folders, which
    /// [`Unpacked::archive_warnings`] names.
    ///
    /// # Errors
    ///
    /// [`PackageError::Missing`] if these folders have no library, or several with other names. The error lists the
    /// libraries of the FMU for all platforms.
    pub fn library(&self, model_identifier: &str) -> Result<PathBuf, PackageError> {
        let name = format!("{model_identifier}{}", std::env::consts::DLL_SUFFIX);
        let binaries = self.folder().join("binaries");
        let platforms = platforms_of(self.description.version());
        let mut candidates = platforms.iter().map(|platform| binaries.join(platform).join(&name));
        let library = candidates.find(|path| path.is_file()).or_else(|| self.only_library());
        library.ok_or_else(|| {
            let expected: Vec<String> =
                platforms.iter().map(|platform| format!("binaries/{platform}/{name}")).collect();
            let libraries = self.libraries();
            let mut actual =
                if libraries.is_empty() { "no library".to_owned() } else { libraries.join(", ") };
            if self.has_sources() {
                actual.push_str(if self.states_build() {
                    "; its source code is in sources/, which --compile builds"
                } else {
                    "; its source code is in sources/, but the FMU does not state how it is built"
                });
            }
            PackageError::Missing {
                expected: format!("the library {}", expected.join(" or ")),
                actual,
            }
        })
    }

    /// The only library in the folders of this platform; `None` if there are none or several.
    fn only_library(&self) -> Option<PathBuf> {
        let binaries = self.folder().join("binaries");
        let suffix = std::env::consts::DLL_SUFFIX;
        let mut libraries = platforms_of(self.description.version())
            .iter()
            .flat_map(|platform| below(&binaries.join(platform)))
            .filter(|path| path.to_string_lossy().ends_with(suffix) && path.is_file());
        libraries.next().filter(|_| libraries.next().is_none())
    }

    /// Adds a warning for each library that is used although its name is not the model identifier.
    fn warn_of_other_names(&mut self) {
        let description = &self.description;
        let simulation = description.stepped().map(|flags| flags.model_identifier);
        let exchange =
            description.model_exchange.as_ref().map(|flags| flags.model_identifier.clone());
        let mut identifiers: Vec<String> = simulation.into_iter().chain(exchange).collect();
        identifiers.dedup();
        for identifier in identifiers {
            let Ok(library) = self.library(&identifier) else { continue };
            let expected = format!("{identifier}{}", std::env::consts::DLL_SUFFIX);
            let name = library.file_name().unwrap_or_default().to_string_lossy();
            if name != expected {
                let folder = library.parent().and_then(Path::file_name).unwrap_or_default();
                self.archive_warnings.push(format!(
                    "binaries/{0}/{name} is used, the only library there; expected \
                     binaries/{0}/{expected}, by modelIdentifier",
                    folder.to_string_lossy()
                ));
            }
        }
    }

    /// Whether the FMU has source code: a file in `sources`, at any depth.
    #[must_use]
    pub fn has_sources(&self) -> bool {
        self.names.iter().any(|name| name.starts_with("sources/") && !name.ends_with('/'))
            || has_file(&self.folder().join("sources"))
    }

    /// Whether the FMU states how its source code is built: `buildDescription.xml`, or in FMI 2.0 an element
    /// `SourceFiles`.
    fn states_build(&self) -> bool {
        const FILE: &str = "sources/buildDescription.xml";
        let description = &self.description;
        let simulation = description.co_simulation.as_ref().map(|flags| &flags.source_files);
        let exchange = description.model_exchange.as_ref().map(|flags| &flags.source_files);
        self.names.iter().any(|name| name == FILE)
            || self.folder().join(FILE).is_file()
            || simulation.into_iter().chain(exchange).any(|files| !files.is_empty())
    }

    /// The paths of the files in the platform folders of `binaries`, whose case is ignored; sorted, at most 20.
    fn libraries(&self) -> Vec<String> {
        let mut libraries = if self.temporary.is_some() {
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
        libraries.retain(|name| {
            let parts: Vec<&str> = name.split('/').collect();
            matches!(parts.as_slice(), [top, _, file]
                if top.eq_ignore_ascii_case("binaries") && !file.is_empty())
        });
        libraries.sort();
        libraries.truncate(20);
        libraries
    }
}

/// The paths of the files and folders in `folder`; none if `folder` cannot be read.
fn below(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

/// Whether `folder` has a file, at any depth; a link counts as one. False if `folder` cannot be read.
fn has_file(folder: &Path) -> bool {
    below(folder).any(|path| path.is_symlink() || !path.is_dir() || has_file(&path))
}

/// Whether a simulation on this platform may need the entry called `name`.
fn is_needed(name: &str) -> bool {
    let mut parts = name.split('/');
    match (parts.next(), parts.next()) {
        (Some("documentation" | "sources" | "model.png"), _) => false,
        (Some("terminalsAndIcons"), _) => name == terminals::PATH,
        (Some("binaries"), Some(platform)) => {
            platforms().contains(&platform) || !is_platform(platform)
        }
        _ => true,
    }
}

/// Whether the standard defines this folder of `binaries`.
fn is_platform(folder: &str) -> bool {
    let is_tuple = |(processor, system): (&str, &str)| {
        ["x86", "x86_64", "aarch32", "aarch64"].contains(&processor)
            && ["linux", "windows", "darwin"].contains(&system)
    };
    ["linux32", "linux64", "win32", "win64", "darwin32", "darwin64"].contains(&folder)
        || folder.split_once('-').is_some_and(is_tuple)
}

/// Unpacks the ZIP archive at `path` (an FMU, or an SSP) into a new temporary folder.
///
/// Returns the folder, and a sentence for each tolerated rule on paths that entries break.
///
/// # Errors
///
/// Same as [`Unpacked::open`], but the archive needs no `modelDescription.xml`.
pub fn unpack_archive(path: &Path) -> Result<(TemporaryFolder, Vec<String>), PackageError> {
    let mut archive = Archive::open(path)?;
    let folder = temporary_folder()?;
    archive.unpack(folder.path(), |_| true)?;
    Ok((folder, archive.warnings()))
}

fn temporary_folder() -> Result<TemporaryFolder, PackageError> {
    TemporaryFolder::new().map_err(file_error("create a folder in", std::env::temp_dir()))
}

/// Reads the model description in `folder`. The error for a malformed one names `path`, the archive or the folder.
fn describe(folder: &Path, path: &Path) -> Result<(ModelDescription, Vec<Warning>), PackageError> {
    let file = folder.join(DESCRIPTION);
    let xml = match read_limited(&file) {
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

/// Sets `terminals` and `is_bus_simulation` of a description of FMI 3.0. Returns a warning if the file of terminals
/// exists and cannot be read; ignores an unreadable manifest.
fn add_terminals(folder: &Path, description: &mut ModelDescription) -> Option<String> {
    if description.version() != Version::V3 {
        return None;
    }
    let manifest = read_limited(&folder.join(BUS_MANIFEST)).ok();
    let manifest = manifest.and_then(|xml| xml::read(&xml).ok());
    let is_bus = |(name, value): &(String, String)| {
        name == "isBusSimulationFMU" && matches!(value.as_str(), "true" | "1")
    };
    description.is_bus_simulation =
        manifest.is_some_and(|manifest| manifest.attributes.iter().any(is_bus));
    let read = match read_limited(&folder.join(terminals::PATH)) {
        Ok(xml) => terminals::read(&xml).map_err(|error| error.to_string()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
        Err(error) => Err(error.to_string()),
    };
    match read {
        Ok(terminals) => {
            description.terminals = terminals;
            None
        }
        Err(error) => {
            Some(format!("{}: {error}; the FMU is used without terminals", terminals::PATH))
        }
    }
}

/// Reads a file, but at most [`ModelDescription::MOST_BYTES`] + 1 bytes of it.
fn read_limited(file: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let most = in_force(u64::try_from(ModelDescription::MOST_BYTES).unwrap_or(u64::MAX));
    fs::File::open(file)?.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The error for an FMU without model description: names a similar entry, or up to 10 entries of its root.
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
    let actual = match near {
        Some(near) if near.eq_ignore_ascii_case(DESCRIPTION) => {
            format!("{near}, which differs in upper and lower case")
        }
        Some(near) => format!("{near}, which is in a folder"),
        None if tops.is_empty() => "nothing".to_owned(),
        None => tops.join(", "),
    };
    PackageError::Missing { expected: format!("{DESCRIPTION} at the root of the FMU"), actual }
}
