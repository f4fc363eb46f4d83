//! Writes `.fmu` archives (FMI 2.0.5, section 2.3; FMI 3.0.2, section 2.5), and unpacks them.

mod archive;
mod paths;
mod read;
mod temporary;
mod write;

use std::io;
use std::path::{Path, PathBuf};

use zip::result::ZipError;

use crate::description::{ParseError, Version};

pub use read::{Unpacked, unpack_archive};
pub use temporary::{TemporaryFolder, remove_abandoned_folders, remove_temporary_folders};
pub use write::{Package, pack, write_archive};

/// Name of the model description at the root of the archive.
pub const DESCRIPTION: &str = "modelDescription.xml";

/// The error of writing or reading an archive.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum PackageError {
    /// An operation of the file system failed.
    #[error("cannot {action} {}", path.display())]
    File { action: &'static str, path: PathBuf, source: io::Error },
    /// The file is not a ZIP archive, or an archive with invalid, overlapping or encrypted entries.
    #[error("{} is no ZIP archive that can be used", path.display())]
    Archive { path: PathBuf, source: io::Error },
    /// An entry has a path, a type or a compression that an FMU must not have.
    #[error("entry {entry:?}: expected {expected}")]
    Entry { entry: String, expected: &'static str },
    /// The FMU lacks a required part.
    #[error("expected {expected}, found {actual}")]
    Missing { expected: String, actual: String },
    /// The archive exceeds a limit of this crate.
    #[error("{}: expected at most {limit} {unit}, found more{help}", path.display())]
    Limit {
        path: PathBuf,
        limit: u64,
        unit: &'static str,
        /// [`crate::limits::HELP`] if a limit refused the archive and can be lifted, otherwise empty.
        help: &'static str,
    },
    /// The model description cannot be read.
    #[error("modelDescription.xml of {}", path.display())]
    Description { path: PathBuf, source: ParseError },
}

/// Returns a function that wraps an error of the file system.
fn file_error(
    action: &'static str,
    path: impl Into<PathBuf>,
) -> impl FnOnce(io::Error) -> PackageError {
    let path = path.into();
    move |source| PackageError::File { action, path, source }
}

/// Returns a function that wraps an error of the archive.
fn archive_error(path: &Path) -> impl FnOnce(ZipError) -> PackageError {
    let path = path.to_owned();
    move |error| PackageError::Archive { path, source: error.into() }
}

/// Folders of `binaries` for libraries of this platform in FMI 2.0, in order of preference: the names
/// of FMI 2.0, and the platform tuples of FMI 3.0 (allowed since FMI 2.0.4). Empty for an unknown platform.
#[must_use]
pub fn platforms() -> &'static [&'static str] {
    folders(std::env::consts::OS, std::env::consts::ARCH)
}

/// Folders of `binaries` for libraries of this platform in a version of FMI, in order of preference.
/// FMI 3.0 has one platform tuple only, such as `x86_64-linux` (FMI 3.0.2, section 2.5.1.4.1). Empty for an
/// unknown platform.
#[must_use]
pub fn platforms_of(version: Version) -> &'static [&'static str] {
    if version == Version::V3 {
        return tuple(std::env::consts::OS, std::env::consts::ARCH);
    }
    platforms()
}

/// The folder of FMI 3.0: the platform tuple among [`folders`]. Empty for an unknown platform.
fn tuple(system: &str, processor: &str) -> &'static [&'static str] {
    let tuple = folders(system, processor).iter().find(|folder| folder.contains('-'));
    tuple.map_or(&[], std::slice::from_ref)
}

/// The folders of FMI 2.0 for a system and a processor, in order of preference.
fn folders(system: &str, processor: &str) -> &'static [&'static str] {
    match (system, processor) {
        ("linux", "x86_64") => &["linux64", "x86_64-linux"],
        ("linux", "x86") => &["linux32", "x86-linux"],
        ("linux", "aarch64") => &["aarch64-linux"],
        ("linux", "arm") => &["aarch32-linux"],
        ("windows", "x86_64") => &["win64", "x86_64-windows"],
        ("windows", "x86") => &["win32", "x86-windows"],
        ("windows", "aarch64") => &["aarch64-windows"],
        ("macos", "x86_64") => &["darwin64", "x86_64-darwin"],
        // A library in darwin64 may contain code for both processors.
        ("macos", "aarch64") => &["aarch64-darwin", "darwin64"],
        _ => &[],
    }
}

#[cfg(test)]
mod tests;
