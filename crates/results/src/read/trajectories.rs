//! Reads results of Dymola and OpenModelica: MAT files of version 4 with trajectories.
//!
//! Such a file has matrices by name. `Aclass` states the layout, `name` and `description` have a text for each
//! variable. `dataInfo` has four integers for each variable: the matrix with its values (0: the time, 1: `data_1` with
//! the values that are constant, 2: `data_2` with the values that vary), the row in this matrix, negative for a
//! variable with the opposite sign, and the kind of interpolation. Only the layout `binTrans` is read, in which
//! `data_2` is written time by time; both tools write it.

use std::fs::File;
use std::io::{BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;

use super::{Clock, Column, ResultsError, Visitor, unreadable};
use crate::ColumnKind;

/// Largest number of bytes of a matrix that is read as a whole.
const WHOLE: u64 = 1 << 30;

/// The places of the values in a file.
#[derive(Debug)]
pub(super) struct Layout {
    /// The matrix of the values that vary.
    varying: Matrix,
    /// The values of each column.
    places: Vec<Place>,
}

/// The values of a column.
#[derive(Debug, Clone, Copy)]
enum Place {
    Constant(f64),
    /// The row of the matrix, and the sign.
    Varying(usize, f64),
}

/// A matrix of the file, stored column after column.
#[derive(Debug, Clone, Copy)]
struct Matrix {
    offset: u64,
    rows: usize,
    columns: usize,
    precision: Precision,
}

/// The format of the numbers of a matrix.
#[derive(Debug, Clone, Copy)]
struct Precision {
    /// Number of bytes of a number.
    size: usize,
    /// Returns the little-endian number in `size` bytes; NaN for another number of bytes.
    number: fn(&[u8]) -> f64,
}

impl Precision {
    /// Returns the format for the digit that the header of a matrix states.
    fn of(digit: u32) -> Option<Self> {
        fn number<const N: usize, T: Into<f64>>(bytes: &[u8], number: fn([u8; N]) -> T) -> f64 {
            bytes.try_into().map_or(f64::NAN, |bytes| number(bytes).into())
        }
        let (size, number): (_, fn(&[u8]) -> f64) = match digit {
            0 => (8, |bytes| number(bytes, f64::from_le_bytes)),
            1 => (4, |bytes| number(bytes, f32::from_le_bytes)),
            2 => (4, |bytes| number(bytes, i32::from_le_bytes)),
            3 => (2, |bytes| number(bytes, i16::from_le_bytes)),
            4 => (2, |bytes| number(bytes, u16::from_le_bytes)),
            5 => (1, |bytes| number(bytes, u8::from_le_bytes)),
            _ => return None,
        };
        Some(Self { size, number })
    }
}

impl Matrix {
    /// Returns the number of bytes; `None` on overflow.
    fn size(&self) -> Option<u64> {
        let count = self.rows.checked_mul(self.columns)?.checked_mul(self.precision.size)?;
        u64::try_from(count).ok()
    }
}

/// An open file and its length.
struct Source<'a> {
    path: &'a Path,
    file: BufReader<File>,
    length: u64,
}

impl<'a> Source<'a> {
    fn open(path: &'a Path) -> Result<Self, ResultsError> {
        let opened = File::open(path).and_then(|file| Ok((file.metadata()?.len(), file)));
        let (length, file) = opened.map_err(|error| unreadable(path, &error))?;
        Ok(Self { path, file: BufReader::new(file), length })
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<(), ResultsError> {
        self.file.read_exact(bytes).map_err(|error| unreadable(self.path, &error))
    }

    fn seek(&mut self, offset: u64) -> Result<(), ResultsError> {
        let moved = self.file.seek(SeekFrom::Start(offset));
        moved.map(drop).map_err(|error| unreadable(self.path, &error))
    }

    /// Reads the header at `offset`; returns the name of the matrix, the matrix, and the offset of its end.
    fn matrix(&mut self, offset: u64) -> Result<(String, Matrix, u64), ResultsError> {
        let foreign = |reason: &str| unreadable(self.path, &format!("{reason}, {EXPECTED}"));
        let mut header = [0; 20];
        self.file
            .seek(SeekFrom::Start(offset))
            .and_then(|_| self.file.read_exact(&mut header))
            .map_err(|_| foreign("it is cut or damaged"))?;
        if header.starts_with(b"MATLAB") || header.starts_with(b"\x89HDF") {
            return Err(foreign("it is a MAT file of version 5 or later"));
        }
        let (words, _) = header.as_chunks();
        let [kind, rows, columns, is_complex, length] =
            std::array::from_fn(|at| u32::from_le_bytes(words[at]));
        let Some(precision) = Precision::of(kind / 10) else {
            return Err(foreign("it is no MAT file of version 4 with little-endian numbers"));
        };
        if kind % 10 > 1 || is_complex != 0 {
            return Err(foreign("it has a matrix that is sparse or complex"));
        }
        if !(1..256).contains(&length) {
            let reason = format!("it has a matrix whose name has {length} bytes, not 1 to 255");
            return Err(foreign(&reason));
        }
        let mut name = vec![0; length as usize];
        self.file.read_exact(&mut name).map_err(|_| foreign("it is cut"))?;
        let name = text(name.iter().copied());
        let offset = offset + 20 + u64::from(length);
        let matrix = Matrix { offset, rows: rows as usize, columns: columns as usize, precision };
        let end = matrix.size().and_then(|size| offset.checked_add(size));
        match end.filter(|end| *end <= self.length) {
            Some(end) => Ok((name, matrix, end)),
            None => Err(foreign("it is cut")),
        }
    }

    /// Reads all numbers of a matrix; none if it has more than [`WHOLE`] bytes.
    fn numbers(&mut self, matrix: &Matrix) -> Result<Vec<f64>, ResultsError> {
        let size = matrix.size().filter(|size| *size <= WHOLE).unwrap_or(0);
        let mut bytes = vec![0; usize::try_from(size).unwrap_or(0)];
        self.seek(matrix.offset)?;
        self.read(&mut bytes)?;
        let Precision { size, number } = matrix.precision;
        Ok(bytes.chunks_exact(size).map(number).collect())
    }

    /// Reads the columns of a matrix of character codes as texts.
    fn texts(&mut self, matrix: &Matrix) -> Result<Vec<String>, ResultsError> {
        let codes = self.numbers(matrix)?;
        Ok(codes
            .chunks(matrix.rows.max(1))
            .map(|codes| text(codes.iter().copied().map(byte)))
            .collect())
    }
}

/// The end of the message about a file that is not supported.
const EXPECTED: &str = "expected results of Dymola or OpenModelica (version 4, binTrans); \
                        save others as CSV or Parquet first";

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a character code")]
fn byte(number: f64) -> u8 {
    number as u8
}

/// Returns a text without the zeros and spaces at its end.
fn text(bytes: impl Iterator<Item = u8>) -> String {
    let bytes: Vec<u8> = bytes.collect();
    String::from_utf8_lossy(&bytes).trim_end_matches(['\0', ' ']).to_owned()
}

pub(super) fn columns(path: &Path) -> Result<(Layout, Vec<Column>), ResultsError> {
    let mut source = Source::open(path)?;
    let mut matrices = std::collections::BTreeMap::new();
    let mut offset = 0;
    while offset < source.length {
        let (name, matrix, end) = source.matrix(offset)?;
        matrices.insert(name, matrix);
        offset = end;
    }
    let foreign = |reason: String| unreadable(path, &format!("{reason}, {EXPECTED}"));
    let matrix = |name: &str| {
        matrices.get(name).copied().ok_or_else(|| foreign(format!("it has no matrix {name}")))
    };
    check_class(&source.numbers(&matrix("Aclass")?)?).map_err(foreign)?;
    let names = source.texts(&matrix("name")?)?;
    let descriptions = match matrices.get("description").copied() {
        Some(matrix) => source.texts(&matrix)?,
        None => Vec::new(),
    };
    let information = source.numbers(&matrix("dataInfo")?)?;
    let varying = matrix("data_2")?;
    let (constant_rows, constants) = match matrices.get("data_1").copied() {
        Some(matrix) => (matrix.rows, source.numbers(&matrix)?),
        None => (0, Vec::new()),
    };
    let mut entries = Vec::new();
    for (at, name) in names.into_iter().enumerate() {
        let [group, row] = [0, 1].map(|field| information.get(4 * at + field).copied());
        let row = row.filter(|row| row.abs() >= 1.0).unwrap_or(f64::NAN);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 0")]
        let index = (row.abs() - 1.0) as usize;
        let place = match group {
            Some(1.0) if index < constant_rows => {
                constants.get(index).map(|value| Place::Constant(value * row.signum()))
            }
            Some(0.0 | 2.0) if index < varying.rows => Some(Place::Varying(index, row.signum())),
            _ => None,
        };
        let place = place.filter(|_| !row.is_nan());
        let place = place.ok_or_else(|| foreign(format!("it has no values of {name}")))?;
        let unit = descriptions.get(at).and_then(|text| unit(text));
        let name = if group == Some(0.0) { super::super::TIME.to_owned() } else { name };
        entries.push((Column { name, kind: ColumnKind::Real, unit, clocked: false }, place));
    }
    // Variables that vary come first: large models have thousands of parameters.
    entries.sort_by_key(|(_, place)| matches!(place, Place::Constant(_)));
    let (columns, places) = entries.into_iter().unzip();
    Ok((Layout { varying, places }, columns))
}

/// Checks the first and the fourth row of `Aclass`, a matrix of character codes with four rows: the class and the
/// layout of the file.
fn check_class(codes: &[f64]) -> Result<(), String> {
    let line = |row: usize| text(codes.iter().skip(row).step_by(4).copied().map(byte));
    match (line(0).as_str(), line(3).as_str()) {
        ("Atrajectory", "binTrans") => Ok(()),
        (class, layout) => Err(format!("its class is {class:?} and its layout {layout:?}")),
    }
}

/// Returns the unit at the end of a description: `rad` of `angle [rad]` and, as Dymola writes it, of
/// `angle [rad|deg]`; `None` without one, as in `on [:#(type=Boolean)]`.
fn unit(description: &str) -> Option<String> {
    let (_, unit) = description.strip_suffix(']')?.rsplit_once('[')?;
    let unit = unit.split(['|', ':']).next().unwrap_or_default().trim();
    (!unit.is_empty()).then(|| unit.to_owned())
}

pub(super) fn visit(
    path: &Path,
    layout: &Layout,
    columns: &[Column],
    positions: &[usize],
    visitor: &mut Visitor<'_>,
) -> Result<(), ResultsError> {
    let Layout { varying, places } = layout;
    if varying.size() == Some(0) {
        // An empty matrix may state any number of columns, so they are not read.
        return Ok(());
    }
    let mut source = Source::open(path)?;
    source.seek(varying.offset)?;
    let Precision { size, number } = varying.precision;
    let mut bytes = vec![0; varying.rows * size];
    let mut row = vec![0.0; positions.len()];
    let mut clock = Clock::new(path, columns, positions[0]);
    for column in 1..=varying.columns {
        source.read(&mut bytes)?;
        for (value, position) in row.iter_mut().zip(positions) {
            *value = match places[*position] {
                Place::Constant(value) => value,
                Place::Varying(index, sign) => {
                    sign * number(&bytes[index * size..(index + 1) * size])
                }
            };
        }
        clock.check(row[0], || format!("row {column}"))?;
        visitor(row[0], &row[1..]);
    }
    Ok(())
}
