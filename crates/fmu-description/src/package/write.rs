//! Writes an FMU.

use std::collections::HashSet;
use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;

use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod as Method, DateTime, System, ZipWriter};

use super::{DESCRIPTION, PackageError, archive_error, file_error, paths};
use crate::description::Version;

/// Maximum size in bytes of all files together, well below the 4 GiB of an archive without Zip64.
const CAPACITY: u64 = 1 << 31;
/// Maximum number of files besides the description, below the 65,535 entries of an archive without Zip64.
const ENTRIES: u64 = 65_000;

/// An FMU to be written.
///
/// The bytes of the archive depend only on the added content: entries are sorted, with
/// `modelDescription.xml` first; all are deflated, dated 1980-01-01 and have mode 0644 (0755 in
/// `binaries`). There are no directory entries, data descriptors or Zip64 records.
///
/// ```no_run
/// use fmu_description::package::Package;
/// let mut package = Package::new("<fmiModelDescription ...".to_owned());
/// package.add("binaries/linux64/Model.so", std::fs::read("libmodel.so")?);
/// package.write("dist/Model.fmu".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Package {
    version: Version,
    description: Vec<u8>,
    entries: Vec<(String, Vec<u8>)>,
}

impl Package {
    /// Creates an FMU of FMI 2.0 that contains only `description_xml` as its `modelDescription.xml`: a text, or bytes
    /// in the encoding that the XML declares.
    #[must_use]
    pub fn new(description_xml: impl Into<Vec<u8>>) -> Self {
        Package { version: Version::V2, description: description_xml.into(), entries: Vec::new() }
    }

    /// Sets the version of FMI whose rules on files [`Package::write`] checks.
    #[must_use]
    pub fn for_version(self, version: Version) -> Self {
        Package { version, ..self }
    }

    /// Adds a file; `path` is relative to the root, with forward slashes.
    pub fn add(&mut self, path: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.entries.push((path.into(), bytes.into()));
    }

    /// Adds all files in `folder` and its subfolders, under `path`.
    ///
    /// # Errors
    ///
    /// [`PackageError::File`] if a file or folder cannot be read, [`PackageError::Entry`] for a symbolic link
    /// or a name that is not Unicode. Files before the error are added.
    pub fn add_folder(&mut self, path: &str, folder: &Path) -> Result<(), PackageError> {
        for entry in fs::read_dir(folder).map_err(file_error("read", folder))? {
            let entry = entry.map_err(file_error("read", folder))?;
            let file_type = entry.file_type().map_err(file_error("read", entry.path()))?;
            let inner = format!("{path}/{}", entry.file_name().to_string_lossy());
            if entry.file_name().to_str().is_none() || file_type.is_symlink() {
                let expected = "a file with a Unicode name, not a link";
                return Err(PackageError::Entry { entry: inner, expected });
            }
            if file_type.is_dir() {
                self.add_folder(&inner, &entry.path())?;
            } else {
                self.add(inner, fs::read(entry.path()).map_err(file_error("read", entry.path()))?);
            }
        }
        Ok(())
    }

    /// Writes the archive to `target`, as a whole or not at all, and creates its folder. The extension must be `fmu`.
    ///
    /// # Errors
    ///
    /// [`PackageError`] if `target` has another extension, if the FMU breaks a rule of section 2.3, in FMI 3.0 of
    /// section 2.5 (paths, duplicates ignoring case, neither `binaries` nor `sources`, `documentation` without
    /// `index.html`, in FMI 3.0 `sources` without `buildDescription.xml`, `documentation/licenses` without a license
    /// and `icon.svg` without `icon.png`), has more than 2 GiB or 65,000 files, or cannot be written.
    pub fn write(&self, target: &Path) -> Result<(), PackageError> {
        let is_named = target.extension().is_some_and(|extension| extension == "fmu");
        demand(is_named, "a file name ending in .fmu", &target.display().to_string())?;
        self.check(target)?;
        let mut entries: Vec<(&str, &[u8])> =
            self.entries.iter().map(|(path, bytes)| (path.as_str(), bytes.as_slice())).collect();
        entries.sort_unstable();
        entries.insert(0, (DESCRIPTION, self.description.as_slice()));
        write_archive(target, &pack(target, entries, |_| false)?)
    }

    /// Checks the rules on files, and the limits.
    fn check(&self, target: &Path) -> Result<(), PackageError> {
        let mut earlier = HashSet::new();
        for (path, _) in &self.entries {
            let entry = path.clone();
            if let Some(expected) = paths::unsuitable(path, self.version) {
                return Err(PackageError::Entry { entry, expected });
            }
            if !earlier.insert(path.to_ascii_lowercase()) {
                let expected = "a path that no other entry has, in upper or lower case";
                return Err(PackageError::Entry { entry, expected });
            }
        }
        let has_code = self.has_folder("binaries/") || self.has_folder("sources/");
        demand(has_code, "binaries or sources", "neither")?;
        let documented =
            !self.has_folder("documentation/") || self.has_file("documentation/index.html");
        demand(documented, "documentation/index.html", "documentation without it")?;
        if self.version == Version::V3 {
            self.check_folders_of_3()?;
        }
        let bytes = |text: &[u8]| u64::try_from(text.len()).unwrap_or(u64::MAX);
        let sizes = self.entries.iter().map(|(_, content)| bytes(content));
        let total = sizes.fold(bytes(&self.description), u64::saturating_add);
        let count = u64::try_from(self.entries.len()).unwrap_or(u64::MAX);
        for (number, limit, unit) in [(total, CAPACITY, "bytes"), (count, ENTRIES, "files")] {
            if number > limit {
                return Err(PackageError::Limit { path: target.to_owned(), limit, unit, help: "" });
            }
        }
        Ok(())
    }

    /// Whether a path starts with `name`, a folder with a slash at its end.
    fn has_folder(&self, name: &str) -> bool {
        self.entries.iter().any(|(path, _)| path.starts_with(name))
    }

    fn has_file(&self, name: &str) -> bool {
        self.entries.iter().any(|(path, _)| path == name)
    }

    /// Checks the rules of FMI 3.0 on single folders (sections 2.4.10, 2.5.1.1, 2.5.1.2).
    fn check_folders_of_3(&self) -> Result<(), PackageError> {
        let has = |name: &str| self.has_file(name);
        let described = !self.has_folder("sources/") || has("sources/buildDescription.xml");
        demand(described, "sources/buildDescription.xml", "sources without it")?;
        let license = ["txt", "html", "spdx"]
            .iter()
            .any(|extension| has(&format!("documentation/licenses/license.{extension}")));
        let licensed = !self.has_folder("documentation/licenses/") || license;
        let expected = "documentation/licenses/license.txt, .html or .spdx";
        demand(licensed, expected, "documentation/licenses without it")?;
        let pictured = !has("terminalsAndIcons/icon.svg") || has("terminalsAndIcons/icon.png");
        demand(pictured, "terminalsAndIcons/icon.png", "icon.svg without it")
    }
}

/// Returns the bytes of a ZIP archive with `entries`, pairs of path and content, in the given order: dated 1980-01-01,
/// deflated unless `is_stored`, with mode 0644 (0755 in `binaries`), without directory entries, data descriptors and
/// Zip64 records. Errors name `target`, the path of the archive.
///
/// # Errors
///
/// [`PackageError::Archive`] if an entry is too large or has the path of another one.
pub fn pack<'a>(
    target: &Path,
    entries: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    is_stored: impl Fn(&str) -> bool,
) -> Result<Vec<u8>, PackageError> {
    let failed = || archive_error(target);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (path, bytes) in entries {
        let stored = is_stored(path);
        let mode = if path.starts_with("binaries/") { 0o755 } else { 0o644 };
        let options = SimpleFileOptions::default()
            .compression_method(if stored { Method::Stored } else { Method::Deflated })
            .last_modified_time(DateTime::default())
            .system(System::Unix)
            .unix_permissions(mode)
            .large_file(false);
        archive.start_file(path, options).map_err(failed())?;
        archive.write_all(bytes).map_err(ZipError::from).map_err(failed())?;
    }
    Ok(archive.finish().map_err(failed())?.into_inner())
}

/// Writes the bytes of an archive to `target`, as a whole or not at all, and creates its folder.
///
/// # Errors
///
/// [`PackageError::File`] if the folder or the file cannot be written.
pub fn write_archive(target: &Path, bytes: &[u8]) -> Result<(), PackageError> {
    let folder = match target.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder).map_err(file_error("create", folder))?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".packing-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(file_error("create a file in", folder))?;
    file.write_all(bytes).map_err(file_error("write", file.path()))?;
    let persisted = file.persist(target);
    persisted.map_err(|failure| file_error("write", target)(failure.error))?;
    Ok(())
}

/// Returns [`PackageError::Missing`] unless the rule `holds`.
fn demand(holds: bool, expected: &str, actual: &str) -> Result<(), PackageError> {
    if holds {
        return Ok(());
    }
    let (expected, actual) = (expected.to_owned(), actual.to_owned());
    Err(PackageError::Missing { expected, actual })
}
