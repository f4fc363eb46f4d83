//! Why a system structure cannot be read, put together or written.

use std::io;
use std::path::PathBuf;

use fmu_description::package::PackageError;
use fmu_description::{ParseError, Position};

/// What is wrong with an SSP, SSD, SSV, SSM or SSB file.
#[derive(Debug, thiserror::Error)]
pub enum SspError {
    /// Not well-formed XML.
    #[error(transparent)]
    Xml(#[from] ParseError),
    /// Something other than SSP 1.0 has there.
    #[error("{at}: <{element}>: expected {expected}, found {found}")]
    Content {
        /// Where the element begins.
        at: Position,
        /// The element.
        element: String,
        /// What it must have.
        expected: String,
        /// What it has.
        found: String,
    },
    /// A statement that is well-formed but cannot be followed.
    #[error("{at}: {sentence}")]
    Meaning {
        /// Where the element begins.
        at: Position,
        /// What is wrong, in a sentence.
        sentence: String,
    },
    /// The file that the reason belongs to.
    #[error("{}: {reason}", file.display())]
    In {
        /// The file.
        file: PathBuf,
        /// What is wrong in it.
        reason: Box<SspError>,
    },
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
    /// An archive, an SSP or an FMU.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// More than is read.
    #[error("expected at most {limit} {what}, found more")]
    Limit {
        /// How many are accepted.
        limit: usize,
        /// Of what.
        what: &'static str,
    },
    /// Something is not there, or not as it must be.
    #[error("{what}: expected {expected}, found {found}")]
    Missing {
        /// The file, element or variable.
        what: String,
        /// What it must be or have.
        expected: String,
        /// What it is or has.
        found: String,
    },
}

impl SspError {
    /// This error as one of `file`.
    #[must_use]
    pub fn in_file(self, file: impl Into<PathBuf>) -> Self {
        match self {
            SspError::Xml(_)
            | SspError::Content { .. }
            | SspError::Meaning { .. }
            | SspError::Limit { .. } => SspError::In { file: file.into(), reason: Box::new(self) },
            _ => self,
        }
    }
}

impl From<PackageError> for SspError {
    fn from(error: PackageError) -> Self {
        SspError::Package(Box::new(error))
    }
}

/// A sentence about what stands at `at`.
pub(super) fn meaning(at: Position, sentence: impl Into<String>) -> SspError {
    SspError::Meaning { at, sentence: sentence.into() }
}
