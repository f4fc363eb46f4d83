//! Reads TOML and keeps the place of every value in the text, so that errors can point at the value.
//!
//! Structs of `serde` would lose the name and the place of a value, which later checks of several values need. An error
//! has a single place and message, so that a few lines can show it without a crate such as `miette` or
//! `annotate-snippets`.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a file and its path.
pub struct Source {
    /// Path of the file.
    pub path: PathBuf,
    text: String,
}

/// A range of bytes in a [`Source`].
pub type Place = Range<usize>;

/// An error at a place in a file. The text of the error shows the line and underlines the place.
#[derive(Clone, Debug)]
pub struct PlaceError {
    path: PathBuf,
    line: usize,
    column: usize,
    length: usize,
    shown: String,
    message: String,
}

impl std::error::Error for PlaceError {}

impl PlaceError {
    /// Returns the path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the line, counted from 1.
    #[must_use]
    pub fn line(&self) -> usize {
        self.line
    }

    /// Returns the column, counted from 1.
    #[must_use]
    pub fn column(&self) -> usize {
        self.column
    }

    /// Returns the text of the line with the error.
    #[must_use]
    pub fn shown(&self) -> &str {
        &self.shown
    }

    /// Returns the error with `cause` and a semicolon in front of the message.
    #[must_use]
    pub fn after(mut self, cause: &str) -> Self {
        self.message = format!("{cause}; {}", self.message);
        self
    }

    /// Returns the message without the place.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for PlaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, column, length, shown, message, .. } = self;
        writeln!(f, "{}:{line}:{column}: {message}", self.path.display())?;
        let margin = line.to_string().len();
        let (indent, underline) = (" ".repeat(column - 1), "^".repeat(*length));
        write!(f, "{:margin$} |\n{line} | {shown}\n{:margin$} | {indent}{underline}", "", "")
    }
}

impl Source {
    /// Reads the file.
    ///
    /// # Errors
    ///
    /// [`std::io::Error`] if the file cannot be read or is not UTF-8.
    pub fn read(path: &Path) -> std::io::Result<Self> {
        Ok(Self::new(path, std::fs::read_to_string(path)?))
    }

    /// Returns the whole text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Creates a source from a text; `path` is for messages.
    #[must_use]
    pub fn new(path: &Path, text: String) -> Self {
        Self { path: path.to_owned(), text }
    }

    /// Parses the TOML text.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] at the first syntax error, or at the end of the text if the error has no place.
    pub fn parse(&self) -> Result<Spanned<DeTable<'_>>, PlaceError> {
        DeTable::parse(&self.text).map_err(|error| {
            let end = self.text.len();
            self.error(&error.span().unwrap_or(end..end), error.message())
        })
    }

    /// Returns an error that points at the first line of `place`, or at the last line of the text if `place` is beyond
    /// the text.
    ///
    /// # Panics
    ///
    /// If `place` starts or ends within a character.
    #[must_use]
    pub fn error(&self, place: &Place, message: impl Into<String>) -> PlaceError {
        let start = place.start.min(self.text.len());
        let line_start = self.text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let shown = self.text[line_start..].lines().next().unwrap_or("").to_owned();
        let column = self.text[line_start..start].chars().count();
        let end = place.end.clamp(start, line_start + shown.len().max(start - line_start));
        PlaceError {
            path: self.path.clone(),
            line: self.text[..start].matches('\n').count() + 1,
            column: column + 1,
            length: self.text[start..end].chars().count().max(1),
            shown,
            message: message.into(),
        }
    }
}

/// A table of the file, or the whole file.
#[derive(Clone)]
pub struct Table<'a> {
    /// The file.
    pub source: &'a Source,
    /// The name of the table in messages, such as `table` or `list[1]`; empty for the whole file.
    name: String,
    /// The place of the table in the text; the start of the text for the whole file.
    pub place: Place,
    entries: &'a DeTable<'a>,
}

/// A value of the file.
#[derive(Clone)]
pub struct Entry<'a> {
    /// The file.
    pub source: &'a Source,
    /// The name of the value in messages: `table.key` or `list[1]`.
    pub name: String,
    /// The place of the value in the text.
    pub place: Place,
    value: &'a DeValue<'a>,
}

impl<'a> Table<'a> {
    /// Returns the top-level table of a parsed file.
    #[must_use]
    pub fn whole(source: &'a Source, parsed: &'a Spanned<DeTable<'a>>) -> Self {
        Self { source, name: String::new(), place: 0..0, entries: parsed.get_ref() }
    }

    /// Returns the name of the entry `key` in messages.
    fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }

    /// Checks that the keys of all entries are in `known`.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] at the alphabetically first key that is not in `known`. The message names the most similar known
    /// key, or all known keys if none has an edit distance of at most 3.
    pub fn allow(&self, known: &[&str]) -> Result<(), PlaceError> {
        let unknown = self.entries.keys().find(|key| !known.contains(&key.get_ref().as_ref()));
        let Some(key) = unknown else {
            return Ok(());
        };
        let name_of_entry = key.get_ref();
        let distances =
            known.iter().map(|name| (strsim::damerau_levenshtein(name, name_of_entry), name));
        let advice = match distances.min_by_key(|(distance, _)| *distance) {
            Some((..=3, name)) => format!("did you mean `{name}`?"),
            _ => format!("expected one of {}", known.join(", ")),
        };
        let message = format!("unknown entry `{}`; {advice}", self.path(name_of_entry));
        Err(self.source.error(&key.span(), message))
    }

    /// Returns the entry `key`, if it exists.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<Entry<'a>> {
        let (_, value) = self.entries.iter().find(|(name, _)| name.get_ref() == key)?;
        Some(self.entry(key, value))
    }

    fn entry(&self, key: &str, value: &'a Spanned<DeValue<'a>>) -> Entry<'a> {
        let (source, name) = (self.source, self.path(key));
        Entry { source, name, place: value.span(), value: value.get_ref() }
    }

    /// Returns the entry `key`.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] at the table if the entry is missing; the message ends with `meaning`.
    pub fn require(&self, key: &str, meaning: &str) -> Result<Entry<'a>, PlaceError> {
        self.get(key).ok_or_else(|| {
            let message = format!("`{}` is missing: {meaning}", self.path(key));
            self.source.error(&self.place, message)
        })
    }

    /// Returns all entries with their keys, in the order of the keys.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, Entry<'a>)> {
        self.entries.iter().map(|(key, value)| {
            let key = key.get_ref().as_ref();
            (key, self.entry(key, value))
        })
    }
}

impl<'a> Entry<'a> {
    /// Returns an error that points at this value; the message starts with its name.
    #[must_use]
    pub fn error(&self, message: impl fmt::Display) -> PlaceError {
        self.source.error(&self.place, format!("{}: {message}", self.name))
    }

    /// Returns the error that the value is not `what`.
    fn expected(&self, what: &str) -> PlaceError {
        self.error(format!("expected {what}, found {}", self.kind()))
    }

    /// Returns a description of the value for messages: `the text "a"`, `a list`, `true`.
    fn kind(&self) -> String {
        match self.value {
            DeValue::String(text) => format!("the text {text:?}"),
            DeValue::Array(_) => "a list".to_owned(),
            DeValue::Table(_) => "a table".to_owned(),
            DeValue::Boolean(flag) => format!("{flag}"),
            other => format!("a value of type {}", other.type_str()),
        }
    }

    /// Reads a finite number.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a finite number, or is an integer in another base (`0x10`).
    pub fn number(&self) -> Result<f64, PlaceError> {
        let text = match self.value {
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str(),
            DeValue::Integer(integer) => {
                return Err(self.error(format!("expected a decimal number, found {integer}")));
            }
            DeValue::Float(float) => float.as_str(),
            _ => return Err(self.expected("a number")),
        };
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(self.error(format!("expected a finite number, found {text}"))),
        }
    }

    /// Reads a finite positive number.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a finite number above 0.
    pub fn positive(&self) -> Result<f64, PlaceError> {
        match self.number()? {
            number if number > 0.0 => Ok(number),
            number => Err(self.error(format!("expected a number above 0, found {number}"))),
        }
    }

    /// Reads a text.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a text.
    pub fn text(&self) -> Result<&'a str, PlaceError> {
        self.value.as_str().ok_or_else(|| self.expected("a text in quotes"))
    }

    /// Reads a boolean.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a boolean.
    pub fn flag(&self) -> Result<bool, PlaceError> {
        self.value.as_bool().ok_or_else(|| self.expected("true or false"))
    }

    /// Reads a table.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a table.
    pub fn table(&self) -> Result<Table<'a>, PlaceError> {
        let entries = self.value.as_table().ok_or_else(|| self.expected("a table"))?;
        let (source, name, place) = (self.source, self.name.clone(), self.place.clone());
        Ok(Table { source, name, place, entries })
    }

    /// Reads a list; its members are called `list[1]`, `list[2]` and so on.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a list.
    pub fn list(&self) -> Result<Vec<Entry<'a>>, PlaceError> {
        let members = self.value.as_array().ok_or_else(|| self.expected("a list"))?;
        let member = |(position, value): (usize, &'a Spanned<DeValue<'a>>)| Entry {
            source: self.source,
            name: format!("{}[{}]", self.name, position + 1),
            place: value.span(),
            value: value.get_ref(),
        };
        Ok(members.iter().enumerate().map(member).collect())
    }

    /// Returns whether the value is a list.
    #[must_use]
    pub fn is_list(&self) -> bool {
        self.value.is_array()
    }

    /// Returns whether the value is a text.
    #[must_use]
    pub fn is_text(&self) -> bool {
        self.value.is_str()
    }

    /// Returns whether the value is a table.
    #[must_use]
    pub fn is_table(&self) -> bool {
        self.value.is_table()
    }

    /// Reads a list of finite numbers.
    ///
    /// # Errors
    ///
    /// [`PlaceError`] if the value is not a list of finite numbers.
    pub fn numbers(&self) -> Result<Vec<f64>, PlaceError> {
        self.list()?.iter().map(Entry::number).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_decimal_and_finite() {
        let source =
            Source::new(Path::new("a.toml"), "v = [7, -1e3, 0b10, 0o17, 0x1e5, inf]".to_owned());
        let parsed = source.parse().unwrap();
        let values = Table::whole(&source, &parsed).get("v").unwrap().list().unwrap();
        let numbers = values.iter().map(|value| value.number().map_err(|error| error.message));
        let refused = |text: &str| Err(text.to_owned());
        assert_eq!(
            numbers.collect::<Vec<_>>(),
            [
                Ok(7.0),
                Ok(-1000.0),
                refused("v[3]: expected a decimal number, found 0b10"),
                refused("v[4]: expected a decimal number, found 0o17"),
                refused("v[5]: expected a decimal number, found 0x1e5"),
                refused("v[6]: expected a finite number, found inf"),
            ]
        );
    }
}
