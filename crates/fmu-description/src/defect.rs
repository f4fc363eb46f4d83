//! Defects of an XML file: errors, which end the reading, and warnings.

use std::fmt;

use crate::limits::HELP;

/// A position in an XML file; both numbers count from 1, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// The line.
    pub line: u32,
    /// The column.
    pub column: u32,
}

impl Position {
    /// The start of the file.
    pub(crate) const START: Position = Position { line: 1, column: 1 };
}

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "line {}, column {}", self.line, self.column)
    }
}

/// The error of reading an XML file of FMI or SSP.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ParseError {
    /// The text of the file cannot be decoded.
    #[error("expected XML in UTF-8, or in the encoding that it declares, found {actual}")]
    Encoding {
        /// The encoding, or the position of the first invalid byte.
        actual: String,
    },
    /// The file is too long.
    #[error("expected at most {limit} bytes, found more{HELP}")]
    Length { limit: usize },
    /// The file is not well-formed XML.
    #[error("{at}: expected well-formed XML, found: {actual}")]
    Xml { at: Position, actual: String },
    /// The file has a document type declaration, which FMI does not use and which could define
    /// entities.
    #[error("{at}: expected no document type declaration, found <!DOCTYPE")]
    Doctype { at: Position },
    /// The file exceeds a limit: nesting, elements, attributes, variables or bytes of aliases.
    #[error("{at}: expected at most {limit} {what}, found more{help}")]
    Limit {
        at: Position,
        what: &'static str,
        limit: usize,
        /// [`HELP`] if a limit refused the file and can be lifted, otherwise empty.
        help: &'static str,
    },
    /// The file is of an unknown version of the standard.
    #[error("{at}: expected fmiVersion 1.0, 2.0 or 3.0, found {actual:?}")]
    Version { at: Position, actual: String },
    /// An element is missing, or there is one too many.
    #[error("{at}: in <{element}>: expected {expected}, found {actual}")]
    Element {
        /// The position of the parent element.
        at: Position,
        element: String,
        expected: String,
        actual: String,
    },
    /// An attribute is missing or has an invalid value.
    #[error("{at}: <{element}>, attribute {attribute}: expected {expected}, found {actual}")]
    Attribute {
        /// The position of the element.
        at: Position,
        element: String,
        attribute: &'static str,
        expected: String,
        actual: String,
    },
}

/// A violation of the standard that is harmless, or has a clear meaning, in a simulation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The position of the element.
    pub at: Position,
    /// The subject: an element, or one of its attributes.
    pub place: String,
    /// The content that the standard requires.
    pub expected: String,
    /// The content of the file.
    pub actual: String,
    /// The assumption that the reader made.
    pub assumed: String,
    /// Section of the standard: FMI 2.0.5 or 3.0.2, for FMI 1.0 the document on co-simulation.
    pub section: &'static str,
    /// Whether validation against the schema of the standard also reports the defect.
    pub by_schema: bool,
}

impl fmt::Display for Warning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Warning { at, place, expected, actual, assumed, section, .. } = self;
        write!(
            formatter,
            "{at}: {place}: expected {expected}, found {actual}; {assumed} (section {section})"
        )
    }
}
