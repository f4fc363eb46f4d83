//! Typed access to attributes and children; errors and warnings name the attribute or child.

use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::str::FromStr;

use super::warning::{Warnings, section};
use crate::defect::{ParseError, Warning};
use crate::xml::tree::Element;

/// The white space of XML.
pub(super) const WHITE_SPACE: [char; 4] = [' ', '\t', '\r', '\n'];
const NUMBER: &str = "a finite number";
const INTEGER: &str = "an integer from -2147483648 to 2147483647";
const UNSIGNED: &str = "an integer from 0 to 4294967295";
const COUNTER: &str = "an integer from 0 to 18446744073709551615";
const BOOLEAN: &str = "true, false, 1 or 0";
const NOTHING: &str = "read as if it were not there";

/// The result of reading a part of a file.
pub(super) type Result<T, E = ParseError> = std::result::Result<T, E>;

/// An element that is being read, with the list of warnings.
#[derive(Clone, Copy)]
pub(super) struct Node<'a> {
    pub(super) element: &'a Element<'a>,
    pub(super) warnings: &'a Warnings,
}

impl<'a> Node<'a> {
    /// Returns the error for a missing or surplus child.
    pub(super) fn child_error(&self, expected: impl Into<String>, actual: String) -> ParseError {
        let (at, element) = (self.element.at, self.element.name.to_owned());
        ParseError::Element { at, element, expected: expected.into(), actual }
    }

    /// Returns the error for the value `actual` of an attribute.
    pub(super) fn wrong(
        &self,
        attribute: &'static str,
        expected: &str,
        actual: &str,
    ) -> ParseError {
        self.fault(attribute, expected, format!("{actual:?}"))
    }

    /// Returns the error for an attribute; the message shows `actual` without quotes.
    fn fault(&self, attribute: &'static str, expected: &str, actual: String) -> ParseError {
        let (at, element) = (self.element.at, self.element.name.to_owned());
        ParseError::Attribute { at, element, attribute, expected: expected.to_owned(), actual }
    }

    /// Warns about the value `actual` of an attribute that the schema does not allow.
    pub(super) fn warn(&self, attribute: &str, expected: &str, actual: &str, assumed: &str) {
        let place = self.place(attribute);
        self.warn_of(true, place, expected, format!("{actual:?}"), assumed);
    }

    /// Warns about the value `actual` of an attribute that only the text of the standard does not
    /// allow.
    pub(super) fn warn_text(&self, attribute: &str, expected: &str, actual: &str, assumed: &str) {
        let place = self.place(attribute);
        self.warn_of(false, place, expected, format!("{actual:?}"), assumed);
    }

    /// Warns that there is no such attribute.
    pub(super) fn warn_missing(&self, attribute: &str, expected: &str, assumed: &str) {
        let actual = "no such attribute".to_owned();
        self.warn_of(true, self.place(attribute), expected, actual, assumed);
    }

    /// Returns the text that names an attribute in a warning.
    pub(super) fn place(&self, attribute: &str) -> String {
        format!("<{}>, attribute {attribute}", self.element.name)
    }

    /// Adds a warning with the expected and the actual value.
    pub(super) fn warn_of(
        &self,
        by_schema: bool,
        place: String,
        expected: &str,
        actual: String,
        assumed: &str,
    ) {
        self.warnings.add(Warning {
            by_schema,
            at: self.element.at,
            place,
            expected: expected.to_owned(),
            actual,
            assumed: assumed.to_owned(),
            section: section(self.warnings.version, self.element),
        });
    }

    /// Returns the value of an attribute, unchanged.
    pub(super) fn attribute(&self, name: &str) -> Option<&'a str> {
        let attribute = self.element.attributes.iter().find(|(known, _)| *known == name);
        attribute.map(|(_, value)| value.as_ref())
    }

    /// Returns the text in the element, with its entities resolved; unchanged if it has an unknown entity.
    pub(super) fn content_text(&self) -> String {
        let text = self.element.text;
        quick_xml::escape::unescape(text).map_or_else(|_| text.to_owned(), Cow::into_owned)
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.attribute(name).is_some()
    }

    /// Reads a required text that a simulation does not need; if it is absent, warns and returns
    /// `default`.
    pub(super) fn text_or(&self, name: &str, default: String) -> String {
        self.text(name).unwrap_or_else(|| {
            self.warn_missing(name, "a value", &format!("read as {default:?}"));
            default
        })
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.attribute(name).map(str::to_owned)
    }

    /// Returns the value of an attribute; an error if it is missing.
    pub(super) fn required(&self, name: &'static str) -> Result<&'a str> {
        let value = self.attribute(name);
        value.ok_or_else(|| self.fault(name, "a value", "no such attribute".to_owned()))
    }

    /// Reads `modelIdentifier`, the name of a library. An error for a path, which could lead out of the FMU.
    pub(super) fn model_identifier(&self) -> Result<String> {
        const NAME: &str = "modelIdentifier";
        let text = self.required(NAME)?;
        if text.contains(['/', '\\', ':']) {
            return Err(self.wrong(NAME, "the name of a library without /, \\ and :", text));
        }
        Ok(text.to_owned())
    }

    /// Returns the value of an attribute, unchanged and trimmed. Warns of an empty value, which counts as missing.
    fn content(&self, name: &str, expected: &str) -> Option<(&'a str, &'a str)> {
        let text = self.attribute(name)?;
        let trimmed = text.trim_matches(WHITE_SPACE);
        if trimmed.is_empty() {
            self.warn(name, expected, text, NOTHING);
            return None;
        }
        Some((text, trimmed))
    }

    /// Reads an `xs:double`. Infinity and NaN give a warning and count as missing; a malformed number, or one
    /// too large for a double, is an error.
    pub(super) fn number(&self, name: &'static str) -> Result<Option<f64>> {
        let Some((text, trimmed)) = self.content(name, NUMBER) else { return Ok(None) };
        if is_not_finite(trimmed) {
            // The schema allows `INF`, `-INF` and `NaN`, which the text of FMI excludes; it allows no other spelling.
            let violates_schema = !["INF", "-INF", "NaN"].contains(&trimmed);
            self.warn_of(violates_schema, self.place(name), NUMBER, format!("{text:?}"), NOTHING);
            return Ok(None);
        }
        match trimmed.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => Err(self.wrong(name, NUMBER, text)),
        }
    }

    /// Reads the `xs:double` of a limit in FMI 3.0 as [`Node::number`] does, but `INF` and `-INF` give `None` without a
    /// warning; `default` if it is missing.
    pub(super) fn bound(&self, name: &'static str, default: Option<f64>) -> Result<Option<f64>> {
        match self.attribute(name).map(|text| text.trim_matches(WHITE_SPACE)) {
            Some("INF" | "-INF") => Ok(None),
            _ => Ok(self.number(name)?.or(default)),
        }
    }

    /// Reads an `xs:double` of a conversion; `default` if it is missing, an error if it is not finite.
    pub(super) fn finite(&self, name: &'static str, default: f64) -> Result<f64> {
        let Some(text) = self.attribute(name) else { return Ok(default) };
        let value = text.trim_matches(WHITE_SPACE).parse::<f64>().ok();
        value.filter(|value| value.is_finite()).ok_or_else(|| self.wrong(name, NUMBER, text))
    }

    /// Reads an `xs:int`. An integer written with a point (`1.0`) gives a warning, any other text is an error.
    pub(super) fn integer(&self, name: &'static str) -> Result<Option<i32>> {
        let value = self.integer_in(name, &(i32::MIN.into()..=i32::MAX.into()), INTEGER)?;
        Ok(value.and_then(|value| i32::try_from(value).ok()))
    }

    /// Reads an integer in `range`, as [`Node::integer`] does.
    pub(super) fn integer_within(
        &self,
        name: &'static str,
        range: &RangeInclusive<i128>,
    ) -> Result<Option<i128>> {
        self.integer_in(name, range, "an integer")
    }

    /// Reads an integer in `range`. The warning about an empty attribute states `expected_if_empty`.
    fn integer_in(
        &self,
        name: &'static str,
        range: &RangeInclusive<i128>,
        expected_if_empty: &str,
    ) -> Result<Option<i128>> {
        let expected = || format!("an integer from {} to {}", range.start(), range.end());
        let Some((text, trimmed)) = self.content(name, expected_if_empty) else { return Ok(None) };
        let value = integer(trimmed).filter(|value| range.contains(value));
        let value = value.ok_or_else(|| self.wrong(name, &expected(), text))?;
        if trimmed.parse::<i128>().is_err() {
            self.warn(name, &expected(), text, &format!("read as {value}"));
        }
        Ok(Some(value))
    }

    /// Reads an `xs:unsignedLong` that a simulation does not need; any other value gives a warning and counts as
    /// missing.
    pub(super) fn optional_counter(&self, name: &'static str) -> Option<u64> {
        self.optional_number(name, COUNTER)
    }

    /// Reads a required `xs:unsignedInt`; any other value is an error.
    pub(super) fn unsigned(&self, name: &'static str) -> Result<u32> {
        let text = self.required(name)?;
        let value = text.trim_matches(WHITE_SPACE).parse();
        value.map_err(|_| self.wrong(name, UNSIGNED, text))
    }

    /// Reads an `xs:unsignedInt` that a simulation does not need; any other value gives a warning and counts as
    /// missing.
    pub(super) fn optional_unsigned(&self, name: &'static str) -> Option<u32> {
        self.optional_number(name, UNSIGNED)
    }

    fn optional_number<T: FromStr>(&self, name: &str, expected: &str) -> Option<T> {
        let (text, trimmed) = self.content(name, expected)?;
        let value = trimmed.parse().ok();
        if value.is_none() {
            self.warn(name, expected, text, NOTHING);
        }
        value
    }

    /// Reads an `xs:boolean`. Another case gives a warning, any other text is an error.
    pub(super) fn boolean(&self, name: &'static str) -> Result<Option<bool>> {
        let Some((text, trimmed)) = self.content(name, BOOLEAN) else { return Ok(None) };
        let value = self.parse_boolean(name, trimmed);
        value.map(Some).ok_or_else(|| self.wrong(name, BOOLEAN, text))
    }

    /// Reads a capability flag; false if it is missing or, with a warning, no `xs:boolean`.
    pub(super) fn flag(&self, name: &'static str) -> bool {
        let Some((text, trimmed)) = self.content(name, BOOLEAN) else { return false };
        self.parse_boolean(name, trimmed).unwrap_or_else(|| {
            self.warn(name, BOOLEAN, text, "read as false");
            false
        })
    }

    /// Reads a flag as [`Node::flag`] does; `None` if it is missing.
    pub(super) fn optional_flag(&self, name: &'static str) -> Option<bool> {
        self.has(name).then(|| self.flag(name))
    }

    /// Parses an `xs:boolean`. Accepts `true` and `false` with upper-case letters, too, with a warning.
    fn parse_boolean(&self, name: &'static str, text: &str) -> Option<bool> {
        let value = match text {
            "true" | "1" => return Some(true),
            "false" | "0" => return Some(false),
            _ if text.eq_ignore_ascii_case("true") => true,
            _ if text.eq_ignore_ascii_case("false") => false,
            _ => return None,
        };
        self.warn(name, BOOLEAN, text, &format!("read as {value}"));
        Some(value)
    }

    /// Reads one of `words`, the spellings of a `T`, as [`Node::one_of`] does.
    pub(super) fn word<T: FromStr>(&self, name: &'static str, words: &[&'static str]) -> Option<T> {
        self.one_of(name, words)?.parse().ok()
    }

    /// Reads one of `words`. Warns of another case, of white space around the word, and of an unknown word, which
    /// counts as missing.
    pub(super) fn one_of(&self, name: &str, words: &[&'static str]) -> Option<&'static str> {
        let text = self.attribute(name)?;
        let trimmed = text.trim_matches(WHITE_SPACE);
        let meant = words.iter().find(|word| word.eq_ignore_ascii_case(trimmed)).copied();
        if meant != Some(text) {
            let assumed = meant.map_or(NOTHING.to_owned(), |word| format!("read as {word}"));
            self.warn(name, &format!("one of {}", words.join(", ")), text, &assumed);
        }
        meant
    }

    pub(super) fn children(self) -> impl Iterator<Item = Node<'a>> {
        self.element.children.iter().map(move |element| Node { element, ..self })
    }

    /// Returns the children called `name`.
    pub(super) fn children_named(self, name: &'a str) -> impl Iterator<Item = Node<'a>> {
        let named = self.element.children.iter().filter(move |child| child.name == name);
        named.map(move |element| Node { element, ..self })
    }

    /// Returns the child called `name`, if there is one; two are an error.
    pub(super) fn optional_child(self, name: &'a str) -> Result<Option<Node<'a>>> {
        let mut children = self.children_named(name);
        let first = children.next();
        match children.next() {
            None => Ok(first),
            Some(second) => {
                let actual = format!("another at {}", second.element.at);
                Err(self.child_error(format!("one element {name}"), actual))
            }
        }
    }

    /// Reads the child called `name`, if there is one; two are an error.
    pub(super) fn optional<T>(
        self,
        name: &'a str,
        read: impl FnOnce(Node<'a>) -> Result<T>,
    ) -> Result<Option<T>> {
        self.optional_child(name)?.map(read).transpose()
    }

    /// Returns the only child called `name`; none or two are an error.
    pub(super) fn child(self, name: &'a str) -> Result<Node<'a>> {
        let child = self.optional_child(name)?;
        child.ok_or_else(|| self.child_error(format!("an element {name}"), "none".to_owned()))
    }

    /// Reads the items called `item` of the list called `name`; empty if there is no such list, an error for two.
    pub(super) fn list<T>(
        self,
        name: &'a str,
        item: &'a str,
        read: impl Fn(Node<'a>) -> Result<T>,
    ) -> Result<Vec<T>> {
        let list = self.optional_child(name)?;
        list.map_or(Ok(Vec::new()), |list| list.children_named(item).map(read).collect())
    }
}

/// The value of an attribute of an interface.
pub(super) trait Attribute: Sized {
    /// Reads the attribute `name`; the default of the type if it is missing.
    fn read(element: Node<'_>, name: &'static str) -> Result<Self>;
}

impl Attribute for bool {
    fn read(element: Node<'_>, name: &'static str) -> Result<Self> {
        Ok(element.flag(name))
    }
}

impl Attribute for u32 {
    fn read(element: Node<'_>, name: &'static str) -> Result<Self> {
        Ok(element.optional_unsigned(name).unwrap_or_default())
    }
}

impl Attribute for i32 {
    fn read(element: Node<'_>, name: &'static str) -> Result<Self> {
        Ok(element.integer(name)?.unwrap_or_default())
    }
}

impl Attribute for Option<f64> {
    fn read(element: Node<'_>, name: &'static str) -> Result<Self> {
        element.number(name)
    }
}

/// Sets the fields of a table of [`attributes`](crate::description::attributes) to the attributes of an element.
macro_rules! read_attributes {
    (($element:ident, $flags:ident) $($name:literal $field:ident,)*) => {
        $($flags.$field = Attribute::read($element, $name)?;)*
    };
}
pub(super) use read_attributes;

/// Parses an integer. A text with a point, such as `1.0`, is rounded to an `f64`.
pub(super) fn integer(text: &str) -> Option<i128> {
    let whole = || {
        let real = text.parse::<f64>().ok().filter(|real| real.fract() == 0.0)?;
        format!("{real:.0}").parse().ok()
    };
    text.parse().ok().or_else(whole)
}

/// Whether the text is a spelling of infinity or NaN in XML Schema, C, C#, Java or Windows.
fn is_not_finite(text: &str) -> bool {
    let unsigned = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
    ["inf", "infinity", "nan"].contains(&unsigned.as_str()) || unsigned.starts_with("1.#")
}
