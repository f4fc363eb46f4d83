//! The errors of a library that cannot be loaded or used, and of a call that is refused.

use std::path::PathBuf;

use slave::{CallError, Failure};

/// Returns the error of a call of `function` that is refused, or whose result is impossible, for the reason `what`.
#[cold]
pub(crate) fn refused(function: &'static str, what: String) -> CallError {
    CallError { function, failure: Failure::InvalidAnswer(what), messages: Vec::new() }
}

/// Why a library cannot be loaded or used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The operating system does not load the library.
    #[error("{path}: {message}{hint}")]
    Refused {
        /// The library.
        path: PathBuf,
        /// The message of the operating system's loader.
        message: String,
        /// Advice for solving the problem; empty if unknown.
        hint: String,
    },
    /// The library lacks a required function.
    #[error("{path}: the function {function} is missing")]
    Missing {
        /// The library.
        path: PathBuf,
        /// The function.
        function: String,
    },
    /// The library states another version of FMI than the model description, or no version.
    #[error("{path}: {function} gives {actual:?}, expected {expected:?}")]
    Version {
        /// The library.
        path: PathBuf,
        /// The function that returned the version, such as `fmi2GetVersion`.
        function: &'static str,
        /// The version that the library returned.
        actual: String,
        /// The version of the model description.
        expected: &'static str,
    },
    /// The function that creates an instance returned null.
    #[error("{path}: {function} failed for the instance {instance}: {reason}")]
    Instantiate {
        /// The library.
        path: PathBuf,
        /// The function, such as `fmi2Instantiate`.
        function: &'static str,
        /// Name of the instance.
        instance: String,
        /// The FMU's messages.
        reason: String,
    },
    /// The FMU needs something that the importer does not offer.
    #[error("{model}: {reason}")]
    Unsupported {
        /// `modelName`.
        model: String,
        /// The feature that the importer does not offer.
        reason: String,
    },
    /// The library failed to write its model description.
    #[error("{path}: {message}")]
    Describe {
        /// The library.
        path: PathBuf,
        /// The library's message.
        message: String,
    },
}
