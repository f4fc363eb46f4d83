//! XML files of FMI and SSP as trees of elements, read with bounds.

use crate::description::{ParseError, Position, read_xml};

/// An element: its attributes and child elements. Text is not used by FMI 2.0 and SSP 1.0.
#[derive(Debug)]
pub struct Element {
    /// Name with its prefix, as it stands in the file.
    pub name: String,
    /// Names and values, in order.
    pub attributes: Vec<(String, String)>,
    /// Child elements, in order.
    pub children: Vec<Element>,
    /// Where it begins.
    pub at: Position,
}

/// Reads the one root element of a file in UTF-8 or ISO-8859-1.
///
/// Elements called `VendorAnnotations` or `Annotations`, without a prefix, are skipped with all that
/// is in them.
///
/// # Errors
///
/// [`ParseError`] with line and column: not well-formed, a document type declaration (which could
/// define entities), elements nested too deeply, too many attributes.
pub fn read(bytes: &[u8]) -> Result<Element, ParseError> {
    read_xml(bytes)
}
