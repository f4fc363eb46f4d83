//! XML files of FMI and SSP as trees of elements, read with bounds.

use crate::description::{ParseError, Position, read_xml};

/// An element: its attributes, child elements and text, which FMI 2.0 and SSP do not use.
#[derive(Debug)]
pub struct Element {
    /// Name with its prefix, as it stands in the file.
    pub name: String,
    /// The first text that is more than white space, without that around it. References to
    /// characters and entities are not resolved.
    pub text: String,
    /// Names and values, in order.
    pub attributes: Vec<(String, String)>,
    /// Child elements, in order.
    pub children: Vec<Element>,
    /// Where it begins.
    pub at: Position,
}

/// Reads the one root element of a file in UTF-8 or ISO-8859-1.
///
/// # Errors
///
/// [`ParseError`] with line and column: not well-formed, a document type declaration (which could
/// define entities), elements nested too deeply, too many attributes.
pub fn read(bytes: &[u8]) -> Result<Element, ParseError> {
    read_xml(bytes)
}
