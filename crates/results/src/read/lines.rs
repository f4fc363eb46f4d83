//! Reads CSV files with names in the first line.

use std::fs::File;
use std::path::Path;

use ::csv::{ByteRecord, Reader, ReaderBuilder};

use super::{Column, ResultsError, Visitor, unreadable};
use crate::ColumnKind;

/// Number of bytes read at once.
const BUFFER: usize = 256 * 1024;

fn reader(path: &Path) -> Result<Reader<File>, ResultsError> {
    let file = File::open(path).map_err(|error| unreadable(path, &error))?;
    // Flexible, because the last line may be incomplete.
    Ok(ReaderBuilder::new().flexible(true).buffer_capacity(BUFFER).from_reader(file))
}

pub(super) fn columns(path: &Path) -> Result<Vec<Column>, ResultsError> {
    let mut reader = reader(path)?;
    let names = reader.byte_headers().map_err(|error| unreadable(path, &error))?;
    let column = |name: &[u8]| Column {
        name: String::from_utf8_lossy(name).trim().to_owned(),
        kind: ColumnKind::Real,
        unit: None,
        clocked: false,
    };
    Ok(names.iter().map(column).collect())
}

pub(super) fn visit(
    path: &Path,
    columns: &[Column],
    positions: &[usize],
    visitor: &mut Visitor<'_>,
) -> Result<(), ResultsError> {
    let mut reader = reader(path)?;
    let mut record = ByteRecord::new();
    let mut row = vec![0.0; positions.len()];
    // A line that is no row counts as incomplete if it is the last one, otherwise as an error.
    let mut wrong: Option<ResultsError> = None;
    while reader.read_byte_record(&mut record).map_err(|error| unreadable(path, &error))? {
        if let Some(error) = wrong {
            return Err(error);
        }
        let line = record.position().map_or(0, ::csv::Position::line);
        if record.len() != columns.len() {
            let (expected, actual) = (columns.len(), record.len());
            let reason = format!("line {line} has {actual} values, expected {expected}");
            wrong = Some(unreadable(path, &reason));
            continue;
        }
        for (value, position) in row.iter_mut().zip(positions) {
            let cell = &record[*position];
            *value = number(cell).ok_or_else(|| ResultsError::Number {
                path: path.to_owned(),
                line,
                name: columns[*position].name.clone(),
                text: String::from_utf8_lossy(cell).into_owned(),
            })?;
        }
        visitor(row[0], &row[1..]);
    }
    Ok(())
}

/// Parses a decimal number or a Boolean; an empty cell is NaN.
fn number(cell: &[u8]) -> Option<f64> {
    match std::str::from_utf8(cell).ok()?.trim() {
        "" => Some(f64::NAN),
        "True" | "true" => Some(1.0),
        "False" | "false" => Some(0.0),
        text => text.parse().ok(),
    }
}
