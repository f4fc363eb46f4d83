//! The errors of reading, flattening and writing a system structure.

use std::io;
use std::path::PathBuf;

use fmu_description::package::PackageError;
use fmu_description::{ParseError, Position};

/// Why a system structure cannot be read, flattened or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SspError {
    /// The file is not XML that can be read.
    #[error(transparent)]
    Xml(#[from] ParseError),
    /// An element has content that SSP does not allow.
    #[error("{at}: <{element}>: expected {expected}, found {actual}")]
    Content { at: Position, element: String, expected: String, actual: String },
    /// The content is valid but contradictory or not supported.
    #[error("{at}: {sentence}")]
    Meaning { at: Position, sentence: String },
    /// An error in a file.
    #[error("{}: {reason}", file.display())]
    In { file: PathBuf, reason: Box<SspError> },
    /// An operation on a file failed.
    #[error("cannot {action} {}", path.display())]
    File { action: &'static str, path: PathBuf, source: io::Error },
    /// An archive (SSP or FMU) cannot be read or written.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// A file or an archive exceeds a limit.
    #[error("expected at most {limit} {what}, found more{help}")]
    Limit {
        limit: usize,
        what: &'static str,
        /// [`fmu_description::limits::HELP`] if a limit was exceeded that the user can lift, otherwise empty.
        help: &'static str,
    },
    /// A file, element or variable is missing or unsuitable.
    #[error("{what}: expected {expected}, found {actual}")]
    Missing { what: String, expected: String, actual: String },
}

impl SspError {
    /// Adds the name of `file` to an error about the content of a file; returns other errors unchanged.
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

/// Returns an error about a file, element or variable that is missing or unsuitable.
pub(super) fn missing(
    what: impl Into<String>,
    expected: impl Into<String>,
    actual: impl Into<String>,
) -> SspError {
    SspError::Missing { what: what.into(), expected: expected.into(), actual: actual.into() }
}

/// Returns an error about the element at `at`.
pub(super) fn semantic_error(at: Position, sentence: impl Into<String>) -> SspError {
    SspError::Meaning { at, sentence: sentence.into() }
}
