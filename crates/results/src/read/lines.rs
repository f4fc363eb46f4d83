//! Reads CSV files with names in the first line, of this program, FMPy, OpenModelica, pandas or a spreadsheet.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Cursor, Read, Seek as _, SeekFrom};
use std::path::Path;

use ::csv::{ByteRecord, Reader, ReaderBuilder};
use chrono::{DateTime, NaiveDate, NaiveDateTime, NaiveTime};

use super::{Clock, Column, ResultsError, Visitor, time_position, unreadable};
use crate::ColumnKind;

/// Number of bytes read at once.
const BUFFER: usize = 256 * 1024;
/// Number of bytes at the start of a file that are examined to tell a text from a binary file.
const SNIFFED: usize = 1024;
/// The characters that may separate the values of a line.
const DELIMITERS: [u8; 3] = [b';', b'\t', b','];
/// Largest number of rows at the start of a file from which the types of its columns are taken.
const TYPED: usize = 1000;

/// The layout of a CSV file.
#[derive(Debug)]
pub(super) struct Layout {
    delimiter: u8,
    /// Whether the second line has the units of the columns.
    has_units: bool,
    /// Whether the line of the names ends with a delimiter, as in files of OpenModelica.
    is_closed: bool,
}

/// Opens the file as UTF-8; UTF-16, as spreadsheets write it, is converted. A Parquet or other binary file is an
/// error.
fn open(path: &Path) -> Result<Box<dyn Read>, ResultsError> {
    let failed = |error: &std::io::Error| unreadable(path, error);
    let mut file = File::open(path).map_err(|error| failed(&error))?;
    let mut start = Vec::new();
    (&mut file).take(SNIFFED as u64).read_to_end(&mut start).map_err(|error| failed(&error))?;
    file.seek(SeekFrom::Start(0)).map_err(|error| failed(&error))?;
    let unit: fn([u8; 2]) -> u16 = match start.get(..2) {
        Some([0xff, 0xfe]) => u16::from_le_bytes,
        Some([0xfe, 0xff]) => u16::from_be_bytes,
        _ if start.starts_with(b"PAR1") => {
            return Err(unreadable(path, &"it is a Parquet file, expected CSV: name it .parquet"));
        }
        _ if start.contains(&0) => {
            let reason = "it is a binary file, expected CSV: save it as CSV or Parquet first";
            return Err(unreadable(path, &reason));
        }
        _ => return Ok(Box::new(file)),
    };
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(|error| failed(&error))?;
    let units = bytes.as_chunks().0.iter().skip(1).map(|pair| unit(*pair));
    let text: String =
        char::decode_utf16(units).map(|sign| sign.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Ok(Box::new(Cursor::new(text.into_bytes())))
}

fn reader(path: &Path, delimiter: u8) -> Result<Reader<Box<dyn Read>>, ResultsError> {
    let mut builder = ReaderBuilder::new();
    // Flexible, because the last line may be incomplete.
    builder.flexible(true).buffer_capacity(BUFFER).delimiter(delimiter);
    Ok(builder.from_reader(open(path)?))
}

/// Returns the character between the names in the first line: the first of semicolon, tab and comma that the second
/// line has as often outside of quotes, otherwise the first one that there is.
fn delimiter(path: &Path) -> Result<u8, ResultsError> {
    let mut text = BufReader::new(open(path)?).take(2 * BUFFER as u64);
    let mut counts = [[0; 3]; 2];
    for counts in &mut counts {
        let mut line = Vec::new();
        text.read_until(b'\n', &mut line).map_err(|error| unreadable(path, &error))?;
        let mut is_quoted = false;
        for byte in line {
            is_quoted ^= byte == b'"';
            let place = DELIMITERS.iter().position(|sign| *sign == byte && !is_quoted);
            if let Some(place) = place {
                counts[place] += 1;
            }
        }
    }
    let present = |place: &usize| counts[0][*place] > 0;
    let equal = |place: &usize| present(place) && counts[0][*place] == counts[1][*place];
    let place = (0..3).find(equal).or_else(|| (0..3).find(present));
    Ok(place.map_or(b',', |place| DELIMITERS[place]))
}

pub(super) fn columns(path: &Path) -> Result<(Layout, Vec<Column>), ResultsError> {
    let delimiter = delimiter(path)?;
    let mut reader = reader(path, delimiter)?;
    let names = reader.byte_headers().map_err(|error| unreadable(path, &error))?;
    let column = |name: &[u8]| Column {
        name: String::from_utf8_lossy(name).trim().to_owned(),
        kind: ColumnKind::Real,
        unit: None,
        clocked: false,
    };
    let mut columns: Vec<Column> = names.iter().map(column).collect();
    let is_closed = columns.len() > 1 && columns.last().is_some_and(|last| last.name.is_empty());
    if is_closed {
        columns.pop();
    }
    if !columns.is_empty() && columns.iter().all(|column| column.name.parse::<f64>().is_ok()) {
        let reason =
            "the first line has numbers, expected the names of the columns, such as `time,x,y`";
        return Err(unreadable(path, &reason));
    }
    let mut layout = Layout { delimiter, has_units: false, is_closed };
    let mut second = ByteRecord::new();
    if reader.read_byte_record(&mut second).is_ok_and(|is_row| is_row) {
        let units: Vec<String> = second.iter().take(columns.len()).map(unit).collect();
        layout.has_units = units.get(time_position(&columns)).is_some_and(|unit| unit == "s");
        if layout.has_units {
            for (column, unit) in columns.iter_mut().zip(units) {
                column.unit = Some(unit).filter(|unit| !unit.is_empty());
            }
            second.clear();
        }
        set_kinds(&mut columns, &mut reader, &mut second);
    }
    Ok((layout, columns))
}

/// Sets the types of the columns from the first rows; `row` is the first one. The cells of a Boolean column are `True`
/// or `False`, those of an Integer column are digits. Digits alone are Reals if the file has no Real such as `0.0`:
/// then its writer may write `0` for it. This program, pandas and polars write `0.0`.
fn set_kinds(columns: &mut [Column], reader: &mut Reader<Box<dyn Read>>, row: &mut ByteRecord) {
    let mut kinds: Vec<Option<ColumnKind>> = vec![None; columns.len()];
    let mut writes_points = false;
    for _ in 0..TYPED {
        for (kind, cell) in kinds.iter_mut().zip(row.iter()) {
            let cell = cell.trim_ascii();
            writes_points |= cell.ends_with(b".0");
            let of_cell = match cell {
                b"" => continue,
                b"True" | b"true" | b"False" | b"false" => ColumnKind::Boolean,
                _ if is_integer(cell) => ColumnKind::Integer,
                _ => ColumnKind::Real,
            };
            let is_same = kind.is_none_or(|known| known == of_cell);
            *kind = Some(if is_same { of_cell } else { ColumnKind::Real });
        }
        if !reader.read_byte_record(row).is_ok_and(|is_row| is_row) {
            break;
        }
    }
    for (column, kind) in columns.iter_mut().zip(kinds) {
        let stated = kind.filter(|kind| writes_points || *kind != ColumnKind::Integer);
        column.kind = stated.unwrap_or(ColumnKind::Real);
    }
}

/// Whether a cell consists of digits, with or without a sign.
fn is_integer(cell: &[u8]) -> bool {
    let digits = cell.strip_prefix(b"-").unwrap_or(cell);
    !digits.is_empty() && digits.iter().all(u8::is_ascii_digit)
}

/// Returns the text of a cell in the line of the units, without the brackets around it.
fn unit(cell: &[u8]) -> String {
    let text = String::from_utf8_lossy(cell);
    let text = text.trim();
    let inside = |(open, close): (char, char)| {
        let inner = text.strip_prefix(open)?.strip_suffix(close)?;
        // The first and the last bracket of `((m/s)^2)/(rad/s)` are no pair.
        let mut depth = 0;
        let is_pair = inner.chars().all(|sign| {
            depth += i32::from(sign == open) - i32::from(sign == close);
            depth >= 0
        });
        is_pair.then(|| inner.trim())
    };
    [('[', ']'), ('(', ')')].into_iter().find_map(inside).unwrap_or(text).to_owned()
}

/// Calls the visitor for each row, as [`super::Table::visit`] says; the time is the first of `positions`.
pub(super) fn visit(
    path: &Path,
    layout: &Layout,
    columns: &[Column],
    positions: &[usize],
    visitor: &mut Visitor<'_>,
) -> Result<(), ResultsError> {
    let mut reader = reader(path, layout.delimiter)?;
    let mut record = ByteRecord::new();
    let mut row = vec![0.0; positions.len()];
    let mut clock = Clock::new(path, columns, positions[0]);
    if layout.has_units {
        reader.read_byte_record(&mut record).map_err(|error| unreadable(path, &error))?;
    }
    // The error of a line with too few or too many values, or that may end within a number. It is ignored if this is
    // the last line and has no end of line: then the line is incomplete.
    let mut wrong: Option<ResultsError> = None;
    while reader.read_byte_record(&mut record).map_err(|error| unreadable(path, &error))? {
        if let Some(error) = wrong {
            return Err(error);
        }
        let line = || line_of(path, &record);
        let mut count = record.len();
        if layout.is_closed && count == columns.len() + 1 {
            count -= 1;
        }
        if count != columns.len() {
            wrong = Some(unreadable(path, &ragged(line(), count, columns.len(), layout.delimiter)));
            continue;
        }
        for (value, position) in row.iter_mut().zip(positions) {
            let cell = &record[*position];
            let is_time = *position == positions[0];
            let parse = |cell: &[u8]| {
                let date = || seconds_since_1970(cell).filter(|_| is_time);
                number(cell, layout.delimiter).or_else(date)
            };
            let parsed = parse(cell).ok_or_else(|| {
                let text = String::from_utf8_lossy(cell).into_owned();
                if is_time {
                    return unreadable(path, &format!("line {}: {}", line(), clock.refusal(&text)));
                }
                let name = columns[*position].name.clone();
                ResultsError::Number { path: path.to_owned(), line: line(), name, text }
            });
            // A line is cut in its last cell.
            let continued = || parse(&[cell, b"0"].concat());
            match parsed {
                Ok(parsed) => *value = parsed,
                Err(error) if *position + 1 == record.len() && continued().is_some() => {
                    wrong = Some(error);
                }
                Err(error) => return Err(error),
            }
        }
        if wrong.is_some() {
            continue;
        }
        clock.check(row[0], || format!("line {}", line()))?;
        visitor(row[0], &row[1..]);
    }
    match wrong {
        Some(error) if is_ended(path) => Err(error),
        _ => Ok(()),
    }
}

/// Returns the line on which a record starts; its position may be before a line break or empty lines.
fn line_of(path: &Path, record: &ByteRecord) -> u64 {
    let start = record.position().map_or(0, ::csv::Position::byte);
    let mut line = 1;
    let bytes = open(path).into_iter().flat_map(|file| BufReader::new(file).bytes());
    for (position, byte) in (0..).zip(bytes) {
        match byte {
            Ok(b'\n') => line += 1,
            Ok(byte) if byte == b'\r' || position < start => {}
            _ => break,
        }
    }
    line
}

/// Returns the error message for a line with more or fewer values than there are names.
fn ragged(line: u64, count: usize, expected: usize, delimiter: u8) -> String {
    let values = if count == 1 { "1 value".to_owned() } else { format!("{count} values") };
    let advice = if count > expected && delimiter == b',' {
        "; if its numbers have decimal commas, separate them by semicolons"
    } else {
        ""
    };
    format!(
        "line {line} has {values}, expected {expected}, as many as the first line has names{advice}"
    )
}

/// Whether the file ends with an end of line.
fn is_ended(path: &Path) -> bool {
    let mut end = [0; 2];
    let read = |mut file: File| {
        file.seek(SeekFrom::End(-2))?;
        file.read_exact(&mut end)
    };
    // In UTF-16 the character is in one of two bytes.
    File::open(path).and_then(read).is_ok() && (end[1] == b'\n' || end == [b'\n', 0])
}

/// Parses a date of ISO 8601, with or without a time of day; returns the time in s since 1970, in UTC unless the
/// text states another offset. `None` for another text.
///
/// ```
/// assert_eq!(results::seconds_since_1970(b"2001-09-09 01:46:40"), Some(1e9));
/// ```
#[must_use]
pub fn seconds_since_1970(date: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(date).ok()?.trim().replacen(' ', "T", 1);
    let utc = DateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f%#z")
        .map(|time| time.to_utc())
        .or_else(|_| text.parse::<NaiveDateTime>().map(|time| time.and_utc()))
        .or_else(|_| text.parse::<NaiveDate>().map(|day| day.and_time(NaiveTime::MIN).and_utc()))
        .ok()?;
    #[expect(clippy::cast_precision_loss, reason = "beyond 2^53 µs a time in s has fewer digits")]
    let micros = utc.timestamp_micros() as f64;
    Some(micros / 1e6)
}

/// Parses a number or a Boolean; an empty cell is NaN, another text `None`. If the values are not separated by
/// commas, a comma may be the decimal sign.
fn number(cell: &[u8], delimiter: u8) -> Option<f64> {
    match std::str::from_utf8(cell).ok()?.trim() {
        "" => Some(f64::NAN),
        "True" | "true" => Some(1.0),
        "False" | "false" => Some(0.0),
        text => match text.parse() {
            Err(_) if delimiter != b',' => text.replacen(',', ".", 1).parse().ok(),
            value => value.ok(),
        },
    }
}
