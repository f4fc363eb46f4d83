//! Errors as sentences.

use std::error::Error;

/// Joins an error and its causes with colons. Leaves out a cause whose text an earlier part contains.
///
/// # Example
///
/// ```
/// let error = std::io::Error::other("the disk is full");
/// assert_eq!(files::sentence(&error), "the disk is full");
/// ```
#[must_use]
pub fn sentence(error: &dyn Error) -> String {
    let mut joined = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !joined.contains(&text) {
            joined = format!("{joined}: {text}");
        }
        cause = error.source();
    }
    joined
}
