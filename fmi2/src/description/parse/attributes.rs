//! Typed access to attributes and children, with errors that name them.

use std::str::FromStr;

use super::ParseError;
use super::xml::Element;

/// The white space of XML.
const WHITE_SPACE: [char; 4] = [' ', '\t', '\r', '\n'];

impl Element {
    /// The error for a missing or surplus child.
    pub(super) fn misses(&self, expected: impl Into<String>, found: String) -> ParseError {
        let (at, element, expected) = (self.at, self.name.clone(), expected.into());
        ParseError::Element { at, element, expected, found }
    }

    /// The error for the value `found` of an attribute.
    pub(super) fn wrong(&self, attribute: &'static str, expected: &str, found: &str) -> ParseError {
        self.fault(attribute, expected, format!("{found:?}"))
    }

    fn fault(&self, attribute: &'static str, expected: &str, found: String) -> ParseError {
        let (at, element, expected) = (self.at, self.name.clone(), expected.to_owned());
        ParseError::Attribute { at, element, attribute, expected, found }
    }

    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        let own = self.attributes.iter().find(|(own, _)| own == name);
        own.map(|(_, value)| value.as_str())
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.attribute(name).map(str::to_owned)
    }

    pub(super) fn required(&self, name: &'static str) -> Result<&str, ParseError> {
        let value = self.attribute(name);
        value.ok_or_else(|| self.fault(name, "a value", "no such attribute".to_owned()))
    }

    /// A finite `xs:double`.
    pub(super) fn number(&self, name: &'static str) -> Result<Option<f64>, ParseError> {
        let finite = self.parsed::<f64>(name, "a finite number")?.filter(|value| value.is_finite());
        match self.attribute(name) {
            Some(text) if finite.is_none() => Err(self.wrong(name, "a finite number", text)),
            _ => Ok(finite),
        }
    }

    /// `xs:int`.
    pub(super) fn integer(&self, name: &'static str) -> Result<Option<i32>, ParseError> {
        self.parsed(name, "an integer from -2147483648 to 2147483647")
    }

    /// `xs:unsignedInt`.
    pub(super) fn unsigned(&self, name: &'static str) -> Result<Option<u32>, ParseError> {
        self.parsed(name, "an integer from 0 to 4294967295")
    }

    /// `xs:boolean`.
    pub(super) fn boolean(&self, name: &'static str) -> Result<Option<bool>, ParseError> {
        let value = self.attribute(name);
        value
            .map(|text| match text.trim_matches(WHITE_SPACE) {
                "true" | "1" => Ok(true),
                "false" | "0" => Ok(false),
                _ => Err(self.wrong(name, "true, false, 1 or 0", text)),
            })
            .transpose()
    }

    /// One of a fixed set of words.
    pub(super) fn word<T: FromStr>(
        &self,
        name: &'static str,
        expected: &str,
    ) -> Result<Option<T>, ParseError> {
        let value = self.attribute(name);
        value.map(|text| text.parse().map_err(|_| self.wrong(name, expected, text))).transpose()
    }

    fn parsed<T: FromStr>(
        &self,
        name: &'static str,
        expected: &str,
    ) -> Result<Option<T>, ParseError> {
        let value = self.attribute(name);
        value
            .map(|text| {
                let trimmed = text.trim_matches(WHITE_SPACE);
                trimmed.parse().map_err(|_| self.wrong(name, expected, text))
            })
            .transpose()
    }

    /// The 1-based index of one of `count` variables.
    pub(super) fn index(
        &self,
        name: &'static str,
        text: &str,
        count: usize,
    ) -> Result<u32, ParseError> {
        let index = text.trim_matches(WHITE_SPACE).parse::<u32>().ok();
        let inside = |index: &u32| usize::try_from(*index).is_ok_and(|own| own <= count);
        index.filter(|index| *index > 0 && inside(index)).ok_or_else(|| {
            let expected = format!("the index of a variable, 1 to {count}");
            self.wrong(name, &expected, text)
        })
    }

    /// An attribute that is a list separated by white space.
    pub(super) fn items<T>(
        &self,
        name: &str,
        item: impl Fn(&str) -> Result<T, ParseError>,
    ) -> Result<Option<Vec<T>>, ParseError> {
        let value = self.attribute(name);
        value
            .map(|text| {
                let words = text.split(WHITE_SPACE).filter(|word| !word.is_empty());
                words.map(item).collect()
            })
            .transpose()
    }

    pub(super) fn children_named(&self, name: &str) -> impl Iterator<Item = &Element> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// The child called `name`, which may be absent but not repeated.
    pub(super) fn optional_child(&self, name: &str) -> Result<Option<&Element>, ParseError> {
        let mut children = self.children_named(name);
        let first = children.next();
        match children.next() {
            None => Ok(first),
            Some(second) => {
                let found = format!("another at {}", second.at);
                Err(self.misses(format!("one element {name}"), found))
            }
        }
    }

    pub(super) fn child(&self, name: &str) -> Result<&Element, ParseError> {
        let child = self.optional_child(name)?;
        child.ok_or_else(|| self.misses(format!("an element {name}"), "none".to_owned()))
    }

    /// The items called `item` of the list called `name`; none if there is no such list.
    pub(super) fn list<T>(
        &self,
        name: &str,
        item: &str,
        read: impl Fn(&Element) -> Result<T, ParseError>,
    ) -> Result<Vec<T>, ParseError> {
        let list = self.optional_child(name)?;
        list.map_or(Ok(Vec::new()), |list| list.children_named(item).map(read).collect())
    }
}
