//! Reads Parquet files without nested columns.

use std::fs::File;
use std::path::Path;

use ::parquet::basic::{ConvertedType, LogicalType, Type as Physical};
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::DataType;
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::schema::types::ColumnDescriptor;

use super::{Clock, Column, ResultsError, Visitor, unreadable};
use crate::ColumnKind;
use crate::parquet::units;

/// Number of rows read at once.
const ROWS: usize = 8192;

fn open(path: &Path) -> Result<SerializedFileReader<File>, ResultsError> {
    let file = File::open(path).map_err(|error| unreadable(path, &error))?;
    SerializedFileReader::new(file).map_err(|error| unreadable(path, &error))
}

pub(super) fn columns(path: &Path) -> Result<Vec<Column>, ResultsError> {
    let reader = open(path)?;
    let file = reader.metadata().file_metadata();
    let mut units = units(file);
    file.schema_descr()
        .columns()
        .iter()
        .map(|column| {
            let name = column.path().parts().join(".");
            if column.max_rep_level() > 0 || column.path().parts().len() > 1 {
                return Err(unreadable(path, &format!("{name} is nested, expected plain columns")));
            }
            let kind = match column.physical_type() {
                Physical::DOUBLE | Physical::FLOAT => ColumnKind::Real,
                Physical::INT32 | Physical::INT64 if divisor(column) > 1.0 => ColumnKind::Real,
                Physical::INT32 | Physical::INT64 => ColumnKind::Integer,
                Physical::BOOLEAN => ColumnKind::Boolean,
                _ => ColumnKind::String,
            };
            let clocked = column.max_def_level() > 0;
            Ok(Column { unit: units.remove(&name), name, kind, clocked })
        })
        .collect()
}

/// Returns the number by which the integers of a column are divided: for decimals a power of ten, for times and
/// timestamps the number of their units in 1 s, otherwise 1.
fn divisor(column: &ColumnDescriptor) -> f64 {
    let is_time =
        |logical: &LogicalType| matches!(logical, LogicalType::Time(_) | LogicalType::Timestamp(_));
    match column.converted_type() {
        ConvertedType::DECIMAL => 10_f64.powi(column.type_scale()),
        ConvertedType::TIME_MILLIS | ConvertedType::TIMESTAMP_MILLIS => 1e3,
        ConvertedType::TIME_MICROS | ConvertedType::TIMESTAMP_MICROS => 1e6,
        // Nanoseconds have no converted type.
        ConvertedType::NONE if column.logical_type_ref().is_some_and(is_time) => 1e9,
        _ => 1.0,
    }
}

pub(super) fn visit(
    path: &Path,
    columns: &[Column],
    positions: &[usize],
    visitor: &mut Visitor<'_>,
) -> Result<(), ResultsError> {
    if let Some(text) = positions.iter().find(|place| columns[**place].kind == ColumnKind::String) {
        let name = columns[*text].name.clone();
        return Err(ResultsError::Text { path: path.to_owned(), name });
    }
    let reader = open(path)?;
    let length = std::fs::metadata(path).map_err(|error| unreadable(path, &error))?.len();
    let mut clock = Clock::new(path, columns, positions[0]);
    let (mut number, mut order) = (0_u64, Ok(()));
    for group in 0..reader.num_row_groups() {
        let mut visit = |time: f64, row: &[f64]| {
            number += 1;
            if order.is_ok() {
                order = clock.check(time, || format!("row {number}"));
            }
            if order.is_ok() {
                visitor(time, row);
            }
        };
        check_places(&reader, group, positions, length)
            .and_then(|()| visit_group(&reader, group, positions, &mut visit))
            .map_err(|error| unreadable(path, &error))?;
    }
    order
}

/// Checks that the footer states places inside the file for the columns. The crate `parquet` panics otherwise.
fn check_places(
    reader: &SerializedFileReader<File>,
    group: usize,
    positions: &[usize],
    length: u64,
) -> Result<(), ParquetError> {
    let group = reader.metadata().row_group(group);
    for position in positions {
        let column = group.columns().get(*position);
        let inside = column.is_some_and(|column| {
            let data = column.data_page_offset();
            let start = column.dictionary_page_offset().unwrap_or(data);
            let end = start.checked_add(column.compressed_size());
            let end = end.and_then(|end| u64::try_from(end).ok());
            start >= 0
                && data >= 0
                && column.compressed_size() >= 0
                && end.is_some_and(|end| end <= length)
        });
        if !inside {
            return Err(ParquetError::General("a column lies outside the file".to_owned()));
        }
    }
    Ok(())
}

fn visit_group(
    reader: &SerializedFileReader<File>,
    group: usize,
    positions: &[usize],
    visitor: &mut Visitor<'_>,
) -> Result<(), ParquetError> {
    let group = reader.get_row_group(group)?;
    let mut readers = positions
        .iter()
        .map(|position| group.get_column_reader(*position))
        .collect::<Result<Vec<_>, _>>()?;
    let (is_unsigned, divisors): (Vec<bool>, Vec<f64>) = positions
        .iter()
        .map(|position| {
            let column = group.metadata().column(*position).column_descr();
            let kind = column.converted_type();
            (matches!(kind, ConvertedType::UINT_32 | ConvertedType::UINT_64), divisor(column))
        })
        .unzip();
    let mut cells = vec![Vec::with_capacity(ROWS); positions.len()];
    let mut row = vec![0.0; positions.len()];
    loop {
        for ((reader, cells), is_unsigned) in readers.iter_mut().zip(&mut cells).zip(&is_unsigned) {
            read(reader, cells, *is_unsigned)?;
        }
        let rows = cells[0].len();
        if cells.iter().any(|cells| cells.len() != rows) {
            return Err(ParquetError::General("its columns differ in length".to_owned()));
        }
        if rows == 0 {
            return Ok(());
        }
        for place in 0..rows {
            for ((value, cells), divisor) in row.iter_mut().zip(&cells).zip(&divisors) {
                *value = cells[place] / divisor;
            }
            visitor(row[0], &row[1..]);
        }
    }
}

/// Replaces `cells` by the next cells of a column as numbers, none after the last row. `is_unsigned`: the integers of
/// the column have no sign. A column of texts is an error.
fn read(
    reader: &mut ColumnReader,
    cells: &mut Vec<f64>,
    is_unsigned: bool,
) -> Result<(), ParquetError> {
    match reader {
        ColumnReader::DoubleColumnReader(reader) => batch(reader, cells, |value| *value),
        ColumnReader::FloatColumnReader(reader) => batch(reader, cells, |value| f64::from(*value)),
        ColumnReader::Int32ColumnReader(reader) => batch(reader, cells, |value| {
            if is_unsigned { value.cast_unsigned().into() } else { (*value).into() }
        }),
        #[expect(clippy::cast_precision_loss, reason = "beyond 2^53 a drawing shows no difference")]
        ColumnReader::Int64ColumnReader(reader) => batch(reader, cells, |value| {
            if is_unsigned { value.cast_unsigned() as f64 } else { *value as f64 }
        }),
        ColumnReader::BoolColumnReader(reader) => {
            batch(reader, cells, |value| f64::from(u8::from(*value)))
        }
        _ => Err(ParquetError::General("a column without numbers".to_owned())),
    }
}

/// Replaces `cells` by the next [`ROWS`] or fewer cells, converted by `number`; null is NaN.
fn batch<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    cells: &mut Vec<f64>,
    number: impl Fn(&T::T) -> f64,
) -> Result<(), ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::with_capacity(ROWS));
    reader.read_records(ROWS, Some(&mut levels), None, &mut values)?;
    cells.clear();
    if levels.is_empty() {
        cells.extend(values.iter().map(number));
    } else {
        let mut values = values.iter();
        let cell = |level: &i16| {
            if *level > 0 { values.next().map_or(f64::NAN, &number) } else { f64::NAN }
        };
        cells.extend(levels.iter().map(cell));
    }
    Ok(())
}
