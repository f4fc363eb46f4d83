//! XML files of FMI and SSP as trees of elements, read with bounds.

pub use crate::description::Element;
use crate::description::{ParseError, read_xml};

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
