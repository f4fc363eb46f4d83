//! CSV files of signals, in the layout that FMPy reads and writes.
//!
//! The header has the names, quoted or not, with `time` first. Each following row is a point in
//! time, ascending, in s or as a date. A time that occurs twice is a jump.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use csv::{ByteRecord, ReaderBuilder, Trim};
use fmu_description::limits::{HELP, in_force};

/// Largest size of a file in bytes, unless [`fmu_description::limits`] are lifted.
pub const LARGEST_FILE: u64 = 256 << 20;
/// Longest quotation in a message, in characters.
const LONGEST_QUOTATION: usize = 40;

/// The columns of a CSV file.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Names of the columns after the first, in their order.
    pub names: Vec<String>,
    /// The first column: time in s, ascending; since 1970 for dates.
    pub times: Arc<[f64]>,
    /// The columns after the time, each with the length of `times`.
    pub columns: Vec<Arc<[f64]>>,
}

impl Table {
    /// Returns the column called `name`, if there is one; `time`, the first column, is not among these columns.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&Arc<[f64]>> {
        let position = self.names.iter().position(|known| known == name)?;
        Some(&self.columns[position])
    }
}

/// Error of reading a [`Table`]. Lines and columns count from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum TableError {
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    /// The file is larger than [`LARGEST_FILE`].
    #[error("the file is larger than {LARGEST_FILE} bytes{HELP}")]
    Large,
    /// The file is not UTF-8 text.
    #[error("line {line}: expected UTF-8 text, found other bytes")]
    Encoding { line: usize },
    /// The file is empty or has only empty lines.
    #[error("the file is empty, expected a header such as \"time\",\"u\" and rows of numbers")]
    Empty,
    /// The first column is not `time`.
    #[error("line {line}: the first column is {actual:?}, expected \"time\"{hint}")]
    NoTime {
        line: usize,
        actual: String,
        /// A hint at the probable cause; may be empty.
        hint: &'static str,
    },
    /// A column has no name.
    #[error("line {line}: column {column} has no name")]
    Unnamed { line: usize, column: usize },
    /// Two columns have the same name.
    #[error("line {line}: the columns {first} and {second} are both called {name:?}")]
    Twice { line: usize, name: String, first: usize, second: usize },
    /// There is no column except the time.
    #[error("line {line}: there is no column but the time")]
    NoColumns { line: usize },
    /// There are no rows.
    #[error("there is no row after the header")]
    NoRows,
    /// A row has another length than the header.
    #[error("line {line}: expected {expected} entries as in the header, found {actual}")]
    Width { line: usize, expected: usize, actual: usize },
    /// An entry is not a finite number.
    #[error(
        "line {line}, column {column:?}: expected a finite number{}, found {actual:?}",
        if column == results::TIME { " or a date of ISO 8601" } else { "" }
    )]
    Number { line: usize, column: String, actual: String },
    /// A time is less than the time before it.
    #[error("line {line}: the time {actual} s comes after {before} s, expected ascending times")]
    Order { line: usize, before: f64, actual: f64 },
}

/// Reads the file at `path`.
///
/// # Errors
///
/// Returns [`TableError`] if the file cannot be read, is too large, or is not a valid table.
pub fn read(path: &Path) -> Result<Table, TableError> {
    let mut bytes = Vec::new();
    let limit = in_force(LARGEST_FILE);
    File::open(path)?.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(TableError::Large);
    }
    parse(&bytes)
}

/// Parses the content of a file, in time and memory proportional to its length.
///
/// # Errors
///
/// Returns [`TableError`] with the line if the content is not a valid table.
pub fn parse(bytes: &[u8]) -> Result<Table, TableError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if let Err(error) = std::str::from_utf8(bytes) {
        let line = line_at(bytes, error.valid_up_to());
        return Err(TableError::Encoding { line });
    }
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).trim(Trim::All).from_reader(bytes);
    let mut record = ByteRecord::new();
    if !advance(&mut reader, &mut record)? {
        return Err(TableError::Empty);
    }
    let names = header(&record, line_of(bytes, &record))?;
    let mut columns = vec![Vec::new(); names.len()];
    while advance(&mut reader, &mut record)? {
        if record.len() != names.len() {
            let (expected, actual) = (names.len(), record.len());
            return Err(TableError::Width { line: line_of(bytes, &record), expected, actual });
        }
        for (position, (field, column)) in record.iter().zip(&mut columns).enumerate() {
            let date = || results::seconds_since_1970(field).filter(|_| position == 0);
            let number = number(field).or_else(date).ok_or_else(|| TableError::Number {
                line: line_of(bytes, &record),
                column: names[position].clone(),
                actual: quotation(field),
            })?;
            column.push(number);
        }
        if let [.., before, time] = columns[0][..]
            && time < before
        {
            return Err(TableError::Order { line: line_of(bytes, &record), before, actual: time });
        }
    }
    if columns[0].is_empty() {
        return Err(TableError::NoRows);
    }
    let mut columns = columns.into_iter().map(Arc::from);
    let times = columns.next().ok_or(TableError::Empty)?;
    Ok(Table { names: names[1..].to_vec(), times, columns: columns.collect() })
}

/// Reads the next record; returns whether there was one.
fn advance(reader: &mut csv::Reader<&[u8]>, record: &mut ByteRecord) -> Result<bool, TableError> {
    // Reading records from memory cannot fail.
    reader.read_byte_record(record).map_err(|error| TableError::Unreadable(error.into()))
}

/// Returns the names of all columns, `time` included. Returns an error unless the first one is `time`, there
/// are others, and all have different names.
fn header(record: &ByteRecord, line: usize) -> Result<Vec<String>, TableError> {
    let name = |field: &[u8]| String::from_utf8_lossy(field).into_owned();
    let names: Vec<String> = record.iter().map(name).collect();
    let first = names.first().map_or("", String::as_str);
    if first != "time" {
        let semicolons = names.len() == 1 && first.contains(';');
        let hint = if semicolons { "; entries are separated by commas" } else { "" };
        return Err(TableError::NoTime { line, actual: quotation(first.as_bytes()), hint });
    }
    let mut known = std::collections::HashMap::new();
    for (position, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(TableError::Unnamed { line, column: position + 1 });
        }
        if let Some(first) = known.insert(name, position) {
            let (name, second) = (quotation(name.as_bytes()), position + 1);
            return Err(TableError::Twice { line, name, first: first + 1, second });
        }
    }
    if names.len() == 1 {
        return Err(TableError::NoColumns { line });
    }
    Ok(names)
}

fn number(field: &[u8]) -> Option<f64> {
    let number: f64 = std::str::from_utf8(field).ok()?.parse().ok()?;
    number.is_finite().then_some(number)
}

/// Returns the first [`LONGEST_QUOTATION`] characters of an entry for a message.
fn quotation(field: &[u8]) -> String {
    String::from_utf8_lossy(field).chars().take(LONGEST_QUOTATION).collect()
}

/// Returns the line on which a record starts, without the empty lines that its position may include.
fn line_of(bytes: &[u8], record: &ByteRecord) -> usize {
    let position = record.position().map_or(0, csv::Position::byte);
    let start = usize::try_from(position).unwrap_or(0).min(bytes.len());
    let empty = bytes[start..].iter().take_while(|&&byte| byte == b'\n' || byte == b'\r').count();
    line_at(bytes, start + empty)
}

fn line_at(bytes: &[u8], position: usize) -> usize {
    bytes[..position].split(|&byte| byte == b'\n').count()
}

#[cfg(test)]
mod tests;
