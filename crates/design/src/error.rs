//! The errors of a design.

use std::io;
use std::path::{Path, PathBuf};

use files::PlaceError;
use fmu_description::package::PackageError;

/// Why a controller cannot be designed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An entry of the plant file is invalid; the message shows its line.
    #[error(transparent)]
    Entry(#[from] PlaceError),
    /// A numerical method failed or rejected its data.
    #[error(transparent)]
    Control(#[from] control::Error),
    /// An archive cannot be read or written.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// The library of the packed controller cannot be loaded.
    #[error(transparent)]
    Library(#[from] fmu_import::LoadError),
    /// The library of the packed controller generates no valid model description.
    #[error(transparent)]
    Description(#[from] fmu_import::DescriptionError),
    /// A file cannot be read or written.
    #[error("cannot {action} {}", path.display())]
    File {
        /// The operation: "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// An error with its context: the file, or the plant of a family or schedule.
    #[error("{what}")]
    Within {
        /// The context.
        what: String,
        /// The error.
        source: Box<Error>,
    },
    /// The request is invalid.
    #[error("{0}")]
    Invalid(String),
}

impl From<PackageError> for Error {
    fn from(error: PackageError) -> Self {
        Error::Package(Box::new(error))
    }
}

impl Error {
    pub(crate) fn within(self, what: impl Into<String>) -> Self {
        Error::Within { what: what.into(), source: Box::new(self) }
    }

    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Error::File { action, path, source }
    }
}
