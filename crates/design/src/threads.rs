//! The threads that share the work of a design.

use std::error::Error as _;
use std::sync::OnceLock;

use rayon::ThreadPoolBuilder;

use crate::Error;

/// Starts the threads of Rayon, which would start at the first use, but then panic if the system refuses a thread.
///
/// # Errors
///
/// [`Error::Invalid`] if the system refuses a thread.
pub(crate) fn start() -> Result<(), Error> {
    static REFUSAL: OnceLock<Option<String>> = OnceLock::new();
    let refusal = REFUSAL.get_or_init(|| {
        let started = ThreadPoolBuilder::new().build_global();
        // An error without a cause says that the program has started them before.
        started.err().and_then(|error| error.source().map(ToString::to_string))
    });
    match refusal {
        None => Ok(()),
        Some(cause) => Err(Error::Invalid(format!(
            "cannot start the threads of a design: {cause}; RAYON_NUM_THREADS=1 needs one only"
        ))),
    }
}
