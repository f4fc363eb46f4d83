//! Builds a tree of elements from the events of quick-xml, with limits on depth and size.
//!
//! roxmltree builds trees too, but refuses defects that are tolerated here: prefixes without declaration (such as
//! `xsi:`), control characters, `--` in comments, undefined entities in text. roxmltree does not limit the depth, and
//! its error for too many elements has no position.

use std::borrow::Cow;

use quick_xml::XmlVersion;
use quick_xml::events::attributes::Attributes;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::defect::{ParseError, Position};
use crate::limits::{HELP, exceeds};

/// Maximum depth of nested elements; a model description needs 5.
const DEPTH: usize = 64;
/// Maximum number of attributes of one element; the standard has fewer than 30.
const ATTRIBUTES: usize = 256;
/// Maximum number of elements of a file; an output of a model description needs 4.
const ELEMENTS: usize = 4_000_000;
/// Maximum number of attributes of all elements together.
const ALL_ATTRIBUTES: usize = 12_000_000;

/// An element with its attributes, child elements and text, borrowed from the text of the file.
#[derive(Debug)]
pub(crate) struct Element<'a> {
    pub(crate) name: &'a str,
    /// The first text that is not only white space, trimmed; entities are not resolved.
    pub(crate) text: &'a str,
    pub(crate) attributes: Vec<(&'a str, Cow<'a, str>)>,
    pub(crate) children: Vec<Element<'a>>,
    pub(crate) at: Position,
}

impl Element<'_> {
    /// Copies the element and its children. The reader limits the depth of elements, and so the depth of this
    /// recursion.
    pub(super) fn into_owned(self) -> super::Element {
        let attributes = self.attributes.into_iter();
        super::Element {
            name: self.name.to_owned(),
            text: self.text.to_owned(),
            attributes: attributes
                .map(|(name, value)| (name.to_owned(), value.into_owned()))
                .collect(),
            children: self.children.into_iter().map(Element::into_owned).collect(),
            at: self.at,
        }
    }
}

/// The position in a text that is read once from start to end.
struct Place<'a> {
    text: &'a [u8],
    offset: usize,
    at: Position,
}

impl Place<'_> {
    /// Moves to the byte `offset`, and returns its position. Never moves back.
    fn advance(&mut self, offset: u64) -> Position {
        let end = usize::try_from(offset).unwrap_or(usize::MAX).min(self.text.len());
        for byte in self.text.get(self.offset..end).unwrap_or_default() {
            match byte {
                b'\n' => self.at = Position { line: self.at.line.saturating_add(1), column: 1 },
                // Continuation bytes of UTF-8 are not characters.
                0x80..=0xbf => {}
                _ => self.at.column = self.at.column.saturating_add(1),
            }
        }
        self.offset = self.offset.max(end);
        self.at
    }
}

/// The open elements, and the root after its end.
#[derive(Default)]
struct Tree<'a> {
    open: Vec<Element<'a>>,
    root: Option<Element<'a>>,
    elements: usize,
    attributes: usize,
}

impl<'a> Tree<'a> {
    /// Checks the depth of an element at position `at`, `inner` levels below the children of the open element.
    fn check_depth(&self, at: Position, inner: usize) -> Result<(), ParseError> {
        if self.open.len() + inner >= DEPTH {
            let what = "levels of nested elements";
            return Err(ParseError::Limit { at, what, limit: DEPTH, help: "" });
        }
        Ok(())
    }

    fn end(&mut self) -> Result<(), ParseError> {
        // The reader has checked that an element is open.
        self.open.pop().map_or(Ok(()), |element| self.add(element))
    }

    /// Adds a closed element to its parent, or sets the root; a second root is an error.
    fn add(&mut self, element: Element<'a>) -> Result<(), ParseError> {
        if let Some(parent) = self.open.last_mut() {
            parent.children.push(element);
        } else if self.root.is_none() {
            self.root = Some(element);
        } else {
            let actual = format!("a second root element <{}>", element.name);
            return Err(ParseError::Xml { at: element.at, actual });
        }
        Ok(())
    }

    /// Sets the text of the open element, unless it has one: the start of `rest`, up to the next markup.
    fn text(&mut self, rest: &'a str) {
        if let Some(element) = self.open.last_mut().filter(|element| element.text.is_empty()) {
            element.text = rest.split('<').next().unwrap_or_default().trim();
        }
    }

    /// Returns the root at the end of the file; an error if an element is open or there is none.
    fn finish(self, at: Position) -> Result<Element<'a>, ParseError> {
        if let Some(element) = self.open.last() {
            let actual = format!("the end of the file inside <{}>", element.name);
            return Err(ParseError::Xml { at: element.at, actual });
        }
        let none = || ParseError::Xml { at, actual: "a file without an element".to_owned() };
        self.root.ok_or_else(none)
    }

    /// Creates the element of a tag whose text starts at `offset` of `text`.
    fn element(
        &mut self,
        tag: &BytesStart<'_>,
        text: &'a str,
        offset: usize,
        at: Position,
    ) -> Result<Element<'a>, ParseError> {
        self.check_depth(at, 0)?;
        self.elements += 1;
        if exceeds(self.elements, ELEMENTS) {
            return Err(limit(at, "elements", ELEMENTS));
        }
        let length = tag.name().as_ref().len();
        let inner = text.get(offset + 1..offset + 1 + tag.len()).unwrap_or_default();
        let name = inner.get(..length).unwrap_or_default();
        let mut attributes = Vec::new();
        for attribute in Attributes::new(inner, length) {
            if exceeds(attributes.len() + 1, ATTRIBUTES) {
                return Err(limit(at, "attributes", ATTRIBUTES));
            }
            let wrong =
                |what: String| ParseError::Xml { at, actual: format!("in <{name}>: {what}") };
            let attribute = attribute.map_err(|error| wrong(error.to_string()))?;
            let value = attribute
                .normalized_value(XmlVersion::Explicit1_0)
                .map_err(|error| wrong(error.to_string()))?;
            attributes.push((attribute.key.into_inner(), value));
        }
        self.attributes += attributes.len();
        if exceeds(self.attributes, ALL_ATTRIBUTES) {
            return Err(limit(at, "attributes in all", ALL_ATTRIBUTES));
        }
        Ok(Element { name, text: "", attributes, children: Vec::new(), at })
    }
}

fn limit(at: Position, what: &'static str, limit: usize) -> ParseError {
    ParseError::Limit { at, what, limit, help: HELP }
}

/// Reads the root element of `text`. Skips annotations of FMI that have content.
pub(crate) fn read(text: &str) -> Result<Element<'_>, ParseError> {
    read_but(text, is_annotation)
}

/// Reads the root element of `text`, without elements that are `skipped`. An empty-element tag is never skipped.
pub(super) fn read_but(
    text: &str,
    skipped: impl Fn(&BytesStart<'_>) -> bool,
) -> Result<Element<'_>, ParseError> {
    let mut reader = Reader::from_str(text);
    let mut place = Place { text: text.as_bytes(), offset: 0, at: Position::START };
    let mut tree = Tree::default();
    loop {
        let at = place.advance(reader.buffer_position());
        let offset = place.offset;
        match reader.read_event() {
            Err(error) => {
                let at = place.advance(reader.error_position());
                return Err(ParseError::Xml { at, actual: error.to_string() });
            }
            Ok(Event::DocType(_)) => return Err(ParseError::Doctype { at }),
            Ok(Event::Start(tag)) if skipped(&tag) => {
                tree.check_depth(at, 0)?;
                skip(&mut reader, &tree, at)?;
            }
            Ok(Event::Start(tag)) => {
                let element = tree.element(&tag, text, offset, at)?;
                tree.open.push(element);
            }
            Ok(Event::Empty(tag)) => {
                let element = tree.element(&tag, text, offset, at)?;
                tree.add(element)?;
            }
            Ok(Event::End(_)) => tree.end()?,
            // The reader splits a text at references to characters and entities.
            Ok(Event::Text(_) | Event::GeneralRef(_)) => {
                tree.text(text.get(offset..).unwrap_or_default());
            }
            Ok(Event::Eof) => return tree.finish(at),
            Ok(_) => {}
        }
    }
}

/// Skips the content of an element that starts at `at`, up to its end. The content must be well-formed.
fn skip(reader: &mut Reader<&[u8]>, tree: &Tree<'_>, at: Position) -> Result<(), ParseError> {
    let mut inner = 1;
    while inner > 0 {
        match reader.read_event() {
            Err(error) => return Err(ParseError::Xml { at, actual: error.to_string() }),
            Ok(Event::DocType(_)) => return Err(ParseError::Doctype { at }),
            Ok(Event::Start(_)) => {
                tree.check_depth(at, inner)?;
                inner += 1;
            }
            Ok(Event::Empty(_)) => tree.check_depth(at, inner)?,
            Ok(Event::End(_)) => inner -= 1,
            Ok(Event::Eof) => {
                let actual = "the end of the file inside an annotation".to_owned();
                return Err(ParseError::Xml { at, actual });
            }
            Ok(_) => {}
        }
    }
    Ok(())
}

fn is_annotation(tag: &BytesStart<'_>) -> bool {
    matches!(tag.name().as_ref(), "VendorAnnotations" | "Annotations")
}
