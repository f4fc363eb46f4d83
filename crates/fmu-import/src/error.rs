//! Why a library could not be used.

use std::path::PathBuf;

/// Why a library could not be used.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The operating system refused it.
    #[error("{path}: {message}{hint}")]
    Refused {
        /// The library.
        path: PathBuf,
        /// What the loader said.
        message: String,
        /// What to do about it, where that is known.
        hint: &'static str,
    },
    /// A function is missing.
    #[error("{path}: the function {function} is missing")]
    Missing {
        /// The library.
        path: PathBuf,
        /// The function.
        function: String,
    },
    /// The functions are not those of FMI 2.0.
    #[error("{path}: fmi2GetVersion gives {found:?}, expected \"2.0\"")]
    Version {
        /// The library.
        path: PathBuf,
        /// What it says it is.
        found: String,
    },
    /// `fmi2Instantiate` returned null.
    #[error("{path}: fmi2Instantiate failed for the instance {instance}: {reason}")]
    Instantiate {
        /// The library.
        path: PathBuf,
        /// Name of the instance.
        instance: String,
        /// The FMU's own words.
        reason: String,
    },
    /// The library could not describe itself.
    #[error("{path}: {message}")]
    Describe {
        /// The library.
        path: PathBuf,
        /// The library's own words.
        message: String,
    },
}
