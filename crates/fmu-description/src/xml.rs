//! Reads XML files of FMI and SSP to trees of elements, with limits on size and depth.

use crate::description::{ParseError, Position, read_xml};

/// An element: its attributes, child elements and text, which FMI 2.0 and SSP do not use.
#[derive(Debug)]
pub struct Element {
    /// Name with its prefix.
    pub name: String,
    /// The first text that is not only white space, trimmed. References to characters and entities are
    /// not resolved.
    pub text: String,
    /// Attributes in order: name and value.
    pub attributes: Vec<(String, String)>,
    /// Child elements, in order.
    pub children: Vec<Element>,
    /// Start of the element in the file.
    pub at: Position,
}

/// Reads the root element of a file in UTF-8 or ISO-8859-1.
///
/// # Errors
///
/// [`ParseError`] with line and column if the file is not well-formed, has a document type declaration
/// (which could define entities), elements nested too deeply, or too many attributes.
pub fn read(bytes: &[u8]) -> Result<Element, ParseError> {
    read_xml(bytes)
}
