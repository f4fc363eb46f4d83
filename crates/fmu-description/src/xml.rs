//! Reads XML files of FMI and SSP to trees of elements, with limits on size and depth.

pub(crate) mod encoding;
pub(crate) mod tree;

use std::borrow::Cow;

use crate::defect::{ParseError, Position};
use crate::limits::exceeds;

/// Maximum size in bytes of a file.
pub(crate) const MOST_BYTES: usize = 512 << 20;

/// An element with its attributes, child elements and text.
#[derive(Debug)]
pub struct Element {
    /// Name with its prefix.
    pub name: String,
    /// The first text that is not only white space, trimmed; empty if there is none. References to characters
    /// and entities are not resolved.
    pub text: String,
    /// Attributes in order: name and value.
    pub attributes: Vec<(String, String)>,
    /// Child elements, in order.
    pub children: Vec<Element>,
    /// Start of the element in the file.
    pub at: Position,
}

/// Reads the root element of a file in UTF-16 or UTF-8, recognised by a byte order mark or, for UTF-16, by the first
/// character `<`; otherwise in the encoding that the file declares; UTF-8 if the file declares none.
///
/// # Errors
///
/// [`ParseError`] if the file is too long, cannot be decoded, is not well-formed, has a document type declaration
/// (which could define entities), elements nested too deeply, or too many elements or attributes.
pub fn read(bytes: &[u8]) -> Result<Element, ParseError> {
    if exceeds(bytes.len(), MOST_BYTES) {
        return Err(ParseError::Length { limit: MOST_BYTES });
    }
    let (text, _) = encoding::decode(bytes)?;
    Ok(tree::read_but(&text, |_| false)?.into_owned())
}

/// Returns whether XML 1.0 allows `character` (production 2).
#[must_use]
pub fn is_character(character: char) -> bool {
    matches!(character, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}')
        || character >= '\u{10000}'
}

/// Returns `text` with U+FFFD for each character that XML 1.0 does not allow.
#[must_use]
pub fn writable(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_character) {
        return Cow::Borrowed(text);
    }
    let replace = |character| if is_character(character) { character } else { '\u{fffd}' };
    Cow::Owned(text.chars().map(replace).collect())
}
