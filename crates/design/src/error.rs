//! Why a controller cannot be designed.

use std::io;
use std::path::{Path, PathBuf};

use files::PlaceError;
use fmu_description::package::PackageError;

/// Why a controller cannot be designed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An entry of the plant file, with its line.
    #[error(transparent)]
    Entry(#[from] PlaceError),
    /// The mathematics refuses.
    #[error(transparent)]
    Control(#[from] control::Error),
    /// An archive cannot be read or written.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// The library of the controller cannot be loaded.
    #[error(transparent)]
    Library(#[from] fmu_import::LoadError),
    /// The library of the controller does not describe itself as it should.
    #[error(transparent)]
    Description(#[from] fmu_import::DescriptionError),
    /// A file cannot be read or written.
    #[error("cannot {action} {}", path.display())]
    File {
        /// What was tried: "read", "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// An error, and what it is about.
    #[error("{what}")]
    Within {
        /// What it is about.
        what: String,
        /// The error.
        source: Box<Error>,
    },
    /// What is asked for makes no sense.
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
