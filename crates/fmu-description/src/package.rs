//! `.fmu` archives (FMI 2.0.5, section 2.3): writing one, and unpacking one to use it.

mod archive;
mod paths;
mod read;
mod temporary;
mod write;

use std::io;
use std::path::PathBuf;

use crate::description::ParseError;

pub use read::{Unpacked, unpack_archive};
pub use temporary::{TemporaryFolder, remove_temporary_folders};
pub use write::Package;

/// Name of the file that describes an FMU, at the root of the archive.
pub const DESCRIPTION: &str = "modelDescription.xml";

/// Why an archive cannot be written or used.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// The file system refused.
    #[error("cannot {action} {}", path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// With which file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// Not a ZIP archive, or one that cannot be decompressed.
    #[error("{} is no ZIP archive that can be used", path.display())]
    Archive {
        /// The archive.
        path: PathBuf,
        /// The reason.
        source: zip::result::ZipError,
    },
    /// An entry with a path that an FMU must not have.
    #[error("entry {entry:?}: expected {expected}")]
    Entry {
        /// Path of the entry.
        entry: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// Something that an FMU must have.
    #[error("expected {expected}, found {found}")]
    Missing {
        /// What is missing.
        expected: String,
        /// What there is instead.
        found: String,
    },
    /// More data than this crate writes or unpacks.
    #[error("{}: expected at most {limit} {unit}, found more", path.display())]
    Limit {
        /// The archive.
        path: PathBuf,
        /// How much is accepted.
        limit: u64,
        /// Of what.
        unit: &'static str,
    },
    /// The model description cannot be read.
    #[error("modelDescription.xml of {}", path.display())]
    Description {
        /// The archive or folder.
        path: PathBuf,
        /// The reason.
        source: ParseError,
    },
}

/// Wraps an error of the file system.
fn file_error(
    action: &'static str,
    path: impl Into<PathBuf>,
) -> impl FnOnce(io::Error) -> PackageError {
    let path = path.into();
    move |source| PackageError::File { action, path, source }
}

/// Folders of `binaries` that hold libraries for the platform of this program, the preferred one
/// first: the names of FMI 2.0 for x86, the platform tuples of FMI 3.0 (since FMI 2.0.4) otherwise.
#[must_use]
pub fn platforms() -> &'static [&'static str] {
    folders(std::env::consts::OS, std::env::consts::ARCH)
}

fn folders(system: &str, processor: &str) -> &'static [&'static str] {
    match (system, processor) {
        ("linux", "x86_64") => &["linux64", "x86_64-linux"],
        ("linux", "x86") => &["linux32", "x86-linux"],
        ("linux", "aarch64") => &["aarch64-linux"],
        ("windows", "x86_64") => &["win64", "x86_64-windows"],
        ("windows", "x86") => &["win32", "x86-windows"],
        ("windows", "aarch64") => &["aarch64-windows"],
        ("macos", "x86_64") => &["darwin64", "x86_64-darwin"],
        // A library in darwin64 may serve both processors.
        ("macos", "aarch64") => &["aarch64-darwin", "darwin64"],
        _ => &[],
    }
}

#[cfg(test)]
mod tests;
