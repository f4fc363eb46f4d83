//! The errors of a library that cannot be loaded or used, and of a call that is refused.

use std::path::PathBuf;

use slave::{CallError, Events, Failure, Slave, absent};

/// Returns the error of a call of `function` that is refused, or whose result is impossible, for the reason `what`.
#[cold]
pub(crate) fn refused(function: &'static str, what: String) -> CallError {
    CallError { function, failure: Failure::InvalidAnswer(what), messages: Vec::new() }
}

/// Returns the interface for the events of a slave; an error if the slave has none.
pub(crate) fn events<S: Slave + ?Sized>(slave: &mut S) -> Result<&mut dyn Events, CallError> {
    slave.events().ok_or_else(|| absent("fmi3EnterEventMode"))
}

/// Why a library cannot be loaded or used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum LoadError {
    /// The operating system does not load the library.
    #[error("{path}: {message}{hint}")]
    Refused {
        path: PathBuf,
        message: String,
        /// Advice for solving the problem; empty if unknown.
        hint: String,
    },
    /// The library lacks a required function.
    #[error("{path}: the function {function} is missing")]
    Missing { path: PathBuf, function: String },
    /// The library states another version of FMI than the model description, or no version.
    #[error("{path}: {function} gives {actual:?}, expected {expected:?}")]
    Version { path: PathBuf, function: &'static str, actual: String, expected: &'static str },
    /// The function that creates an instance returned null.
    #[error("{path}: {function} failed for the instance {instance}: {reason}")]
    Instantiate { path: PathBuf, function: &'static str, instance: String, reason: String },
    /// The FMU needs something that the importer does not offer.
    #[error("{model}: {reason}")]
    Unsupported { model: String, reason: String },
    /// The library failed to write its model description.
    #[error("{path}: {message}")]
    Describe { path: PathBuf, message: String },
}
