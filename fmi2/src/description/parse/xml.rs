//! Text to a tree of elements, with a bound on everything that could grow without sense.

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::{ParseError, Position};

/// Deepest nesting; a model description needs 5.
const DEPTH: usize = 64;
/// Most attributes of one element; the standard has 15 at most.
const ATTRIBUTES: usize = 256;

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

/// Follows the position in a text that is read once, front to back.
struct Place<'a> {
    text: &'a [u8],
    offset: usize,
    at: Position,
}

impl Place<'_> {
    fn advance(&mut self, offset: u64) -> Position {
        let end = usize::try_from(offset).unwrap_or(usize::MAX).min(self.text.len());
        for byte in self.text.get(self.offset..end).unwrap_or_default() {
            match byte {
                b'\n' => self.at = Position { line: self.at.line.saturating_add(1), column: 1 },
                // Continuation bytes of UTF-8 are no characters of their own.
                0x80..=0xbf => {}
                _ => self.at.column = self.at.column.saturating_add(1),
            }
        }
        self.offset = self.offset.max(end);
        self.at
    }
}

/// The elements that are open, and the root once it is closed.
#[derive(Default)]
struct Tree {
    open: Vec<Element>,
    root: Option<Element>,
}

impl Tree {
    fn start(&mut self, element: Element) -> Result<(), ParseError> {
        if self.open.len() == DEPTH {
            let what = "levels of nested elements";
            return Err(ParseError::Limit { at: element.at, what, limit: DEPTH });
        }
        self.open.push(element);
        Ok(())
    }

    fn end(&mut self) -> Result<(), ParseError> {
        // The reader has checked that there is one.
        self.open.pop().map_or(Ok(()), |element| self.add(element))
    }

    fn add(&mut self, element: Element) -> Result<(), ParseError> {
        if let Some(parent) = self.open.last_mut() {
            parent.children.push(element);
        } else if self.root.is_none() {
            self.root = Some(element);
        } else {
            let found = format!("a second root element <{}>", element.name);
            return Err(ParseError::Xml { at: element.at, found });
        }
        Ok(())
    }

    fn finish(self, at: Position) -> Result<Element, ParseError> {
        if let Some(element) = self.open.last() {
            let found = format!("the end of the file inside <{}>", element.name);
            return Err(ParseError::Xml { at: element.at, found });
        }
        let none = || ParseError::Xml { at, found: "a file without an element".to_owned() };
        self.root.ok_or_else(none)
    }
}

/// Reads the one root element of `text`. Annotations are skipped.
pub(super) fn read(text: &str) -> Result<Element, ParseError> {
    let mut reader = Reader::from_str(text);
    let start = Position { line: 1, column: 1 };
    let mut place = Place { text: text.as_bytes(), offset: 0, at: start };
    let mut tree = Tree::default();
    loop {
        let at = place.advance(reader.buffer_position());
        match reader.read_event() {
            Err(error) => {
                let at = place.advance(reader.error_position());
                return Err(ParseError::Xml { at, found: error.to_string() });
            }
            Ok(Event::DocType(_)) => return Err(ParseError::Doctype { at }),
            Ok(Event::Start(tag)) if is_annotation(&tag) => {
                let skipped = reader.read_to_end(tag.name());
                skipped.map_err(|error| ParseError::Xml { at, found: error.to_string() })?;
            }
            Ok(Event::Start(tag)) => tree.start(element(&tag, at)?)?,
            Ok(Event::Empty(tag)) => tree.add(element(&tag, at)?)?,
            Ok(Event::End(_)) => tree.end()?,
            Ok(Event::Eof) => return tree.finish(at),
            Ok(_) => {}
        }
    }
}

fn is_annotation(tag: &BytesStart<'_>) -> bool {
    matches!(tag.name().as_ref(), "VendorAnnotations" | "Annotations")
}

fn element(tag: &BytesStart<'_>, at: Position) -> Result<Element, ParseError> {
    let mut attributes = Vec::new();
    for attribute in tag.attributes() {
        if attributes.len() == ATTRIBUTES {
            return Err(ParseError::Limit { at, what: "attributes", limit: ATTRIBUTES });
        }
        let wrong = |found: String| {
            let element = tag.name().as_ref().to_owned();
            ParseError::Xml { at, found: format!("in <{element}>: {found}") }
        };
        let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
        let value = attribute
            .normalized_value(XmlVersion::Explicit1_0)
            .map_err(|error| wrong(error.to_string()))?;
        attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
    }
    let name = tag.name().as_ref().to_owned();
    Ok(Element { name, attributes, children: Vec::new(), at })
}
