//! Errors of reading, preparing and running a study.

use std::io;
use std::path::{Path, PathBuf};

use files::PlaceError;
use master::SystemError;
use results::{ResultsError, SelectionError};
use ssp::SspError;

/// Error of reading, preparing or running a study.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum Error {
    /// An entry of a file is invalid; the error has its line.
    #[error(transparent)]
    Entry(#[from] PlaceError),
    /// The system cannot be built or advanced.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A system structure cannot be read.
    #[error(transparent)]
    Structure(#[from] SspError),
    /// An FMU cannot be opened or instantiated.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Fmu(#[from] fmu_import::FmuError),
    /// An FMU cannot be started in a separate process.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Isolated(#[from] fmu_import::isolate::IsolateError),
    /// A shared library cannot be loaded before the FMUs.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Library(#[from] fmu_import::LoadError),
    /// The library of an FMU cannot be built.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Compile(#[from] fmu_import::CompileError),
    /// Results cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// Two files that the run would write are the same, or one of them is a file that the run reads.
    #[error(transparent)]
    Outputs(#[from] files::OutputConflict),
    /// A file cannot be read or written.
    #[error("cannot {action} {}", path.display())]
    File { action: &'static str, path: PathBuf, source: io::Error },
    /// An entry of a scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] crate::scenario::ScenarioError),
    /// A name or pattern of variables to record matches none.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// An error with its context, such as an FMU or an entry. The message is the context only.
    #[error("{what}")]
    Within { what: String, source: Box<Error> },
    /// A setting, a file or a request is invalid; the sentence states the reason.
    #[error("{0}")]
    Invalid(String),
}

impl Error {
    /// Adds the context `what` to the error.
    #[must_use]
    pub fn within(self, what: impl Into<String>) -> Self {
        Error::Within { what: what.into(), source: Box::new(self) }
    }

    /// Joins the error and its causes to one sentence. Leaves out a cause that the preceding error already quotes.
    #[must_use]
    pub fn sentence(&self) -> String {
        files::sentence(self)
    }

    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Error::File { action, path, source }
    }
}
