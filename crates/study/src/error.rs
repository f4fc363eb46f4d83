//! Why a study cannot be read, prepared or run.

use std::error::Error as _;
use std::io;
use std::path::{Path, PathBuf};

use files::PlaceError;
use master::SystemError;
use results::{ResultsError, SelectionError};
use ssp::SspError;

/// Why a study cannot be read, prepared or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An entry of a file, with its line.
    #[error(transparent)]
    Entry(#[from] PlaceError),
    /// The system cannot be put together or advanced.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A system structure cannot be read.
    #[error(transparent)]
    Structure(#[from] SspError),
    /// An FMU cannot be opened or instantiated.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Fmu(#[from] fmu_import::FmuError),
    /// An FMU cannot be started in a process of its own.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Isolated(#[from] fmu_import::isolate::IsolateError),
    /// A library cannot be loaded before the FMUs.
    #[cfg(feature = "load")]
    #[error(transparent)]
    Library(#[from] fmu_import::LoadError),
    /// Results cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
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
    /// An entry of a scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] crate::scenario::ScenarioError),
    /// A pattern of variables to record chooses none.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// An error, and what it is about: an FMU, an entry.
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

impl Error {
    /// This error, said to be about `what`.
    #[must_use]
    pub fn within(self, what: impl Into<String>) -> Self {
        Error::Within { what: what.into(), source: Box::new(self) }
    }

    /// The error and its causes as one sentence; a cause that its effect quotes is left out.
    #[must_use]
    pub fn sentence(&self) -> String {
        let mut said = self.to_string();
        let mut cause = self.source();
        while let Some(error) = cause {
            let text = error.to_string();
            if !said.contains(&text) {
                said = format!("{said}: {text}");
            }
            cause = error.source();
        }
        said
    }

    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Error::File { action, path, source }
    }
}
