//! Errors as sentences.

use std::error::Error;

/// Joins an error and its causes to one sentence. Leaves out a cause that an error above it already
/// quotes.
///
/// # Example
///
/// ```
/// let error = std::io::Error::other("the disk is full");
/// assert_eq!(files::sentence(&error), "the disk is full");
/// ```
#[must_use]
pub fn sentence(error: &dyn Error) -> String {
    let mut said = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !said.contains(&text) {
            said = format!("{said}: {text}");
        }
        cause = error.source();
    }
    said
}
