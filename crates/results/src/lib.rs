//! Result files of simulations: writes CSV and Parquet row by row during a run, and reads them.
//!
//! [`create`] opens a [`Sink`] by the extension of the file: [`CsvSink`] or [`ParquetSink`].
//! [`MemorySink`] keeps the rows in memory instead.
//! [`Selection`] selects variables, [`Decimation`] selects communication points; [`Table`] reads a
//! file, of this or another program.
#![forbid(unsafe_code)]

mod csv;
mod decimation;
mod envelope;
mod identity;
pub mod ledger;
mod memory;
mod output;
mod pace;
mod parquet;
mod read;
mod select;

use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use csv::CsvSink;
pub use decimation::{Decimation, Due};
pub use envelope::Envelope;
pub use memory::{Columns, MemorySink, Recorded, Texts, Values};
#[cfg(unix)]
pub use output::reserve_standard_output;
pub use output::{STANDARD_OUTPUT, is_stream};
pub use parquet::ParquetSink;
pub use read::{Table, seconds_since_1970};
pub use select::{Selection, SelectionError};

/// Name of the first column of every file: time in s.
pub const TIME: &str = "time";

/// A recorded variable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Name, such as `plant.x_p`.
    pub name: String,
    /// Type of the values.
    pub kind: ColumnKind,
    /// Unit of the values, if known.
    pub unit: Option<String>,
    /// Whether the variable has a value at the ticks of a clock only: the cells of other rows are empty.
    pub clocked: bool,
}

impl Column {
    /// Whether the variable keeps its value between two rows: it is not interpolated, and drawn as stairs.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.kind != ColumnKind::Real
    }
}

/// The type of a column: a base type of FMI 2.0, or an integer of 64 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ColumnKind {
    /// `fmi2Real`.
    Real,
    /// `fmi2Integer`, Enumerations, and the integer types of FMI 3.0 that fit into 32 bits with a sign.
    Integer,
    /// Integers that need 64 bits: `Int64`, `UInt64`, `UInt32`, and Enumerations with an item beyond 32 bits. The
    /// values are in [`Row::integers`].
    Long,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`.
    String,
}

/// The values of a row except its time, by type, each in the order of the columns of that type.
#[derive(Debug, Clone, Copy, Default)]
pub struct Row<'a> {
    /// Values of the Real columns.
    pub reals: &'a [f64],
    /// Values of the Integer and Long columns. Parquet and [`MemorySink`] limit a value to the type of its column;
    /// CSV writes it in full.
    pub integers: &'a [i64],
    /// Values of the Boolean columns: zero is false.
    pub booleans: &'a [i32],
    /// Values of the String columns.
    pub strings: &'a [String],
    /// For each clocked column, in order, whether it has a value in this row; columns beyond the end have a value.
    pub present: &'a [bool],
}

/// A writer of result rows. A sink that is dropped without [`Sink::finish`] still writes every row, if
/// the disk allows it.
pub trait Sink: Send {
    /// Adds the row at `time` in s, to the file now or later. CSV allocates no memory here, unless texts are very
    /// long or earlier writes failed; Parquet allocates for texts and when it writes a block of rows.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Values`] if the row does not match the columns; the errors of [`Sink::flush`] if rows
    /// are written to the file now.
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError>;

    /// Passes every row so far to the operating system; the file is then complete and readable.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Write`] if the file cannot be written; [`ResultsError::Length`],
    /// [`ResultsError::Overwritten`], [`ResultsError::Gone`] or [`ResultsError::Forked`] if an FMU or another
    /// program has interfered with it.
    fn flush(&mut self) -> Result<(), ResultsError>;

    /// Completes and closes the file.
    ///
    /// # Errors
    ///
    /// Same as [`Sink::flush`].
    fn finish(self: Box<Self>) -> Result<(), ResultsError>;
}

/// The error of writing or reading results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ResultsError {
    /// The extension of the file is neither `.csv` nor `.parquet`.
    #[error("{}: results are written as .csv or .parquet", path.display())]
    Format { path: PathBuf },
    /// The extension of a file that is read is none of `.csv`, `.parquet` and `.mat`.
    #[error(
        "{}: expected results as .csv, .parquet or .mat (of Dymola or OpenModelica); save them as CSV or \
         Parquet first",
        path.display()
    )]
    Extension { path: PathBuf },
    /// Two columns have the same name.
    #[error("two columns of the results have the name {name:?}")]
    Duplicate { name: String },
    /// The number of values of a type in a row differs from the number of columns of this type.
    #[error("a row has {actual} values of type {kind:?}, expected {expected}")]
    Values {
        /// Type of the values; Integer stands for Integer and Long.
        kind: ColumnKind,
        expected: usize,
        actual: usize,
    },
    /// Another process or another sink is writing the file.
    #[error(
    "{}: another run writes its results to this file; wait for its end or select another \
     folder or file (--out, --results)",
        path.display()
    )]
    InUse { path: PathBuf },
    /// The file cannot be created or written.
    #[error("cannot write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    /// The length of the file differs from the number of bytes that were written.
    #[error(
        "{}: the file has {actual} bytes, expected {expected}: an FMU or another program has changed it \
         during the run. With --isolate no FMU reaches the files of the command",
        path.display()
    )]
    Length { path: PathBuf, expected: u64, actual: u64 },
    /// The write position of the open file was moved, so rows may be overwritten.
    #[error(
        "{}: an FMU has used the descriptor of this file and may have overwritten rows. With --isolate \
         no FMU reaches the files of the command",
        path.display()
    )]
    Overwritten { path: PathBuf },
    /// The path no longer leads to the file that was written, or the descriptor of a pipe or a device is lost.
    #[error("{}: the file was deleted, moved or replaced during the run", path.display())]
    Gone { path: PathBuf },
    /// The process is a copy (fork) of the process that writes the file.
    #[error(
        "{}: an FMU has duplicated the process of the run (fork) and returned in both; only the first \
         process writes the results",
        path.display()
    )]
    Forked { path: PathBuf },
    /// The file cannot be read, or its content does not match its extension.
    #[error("cannot read {}: {reason}", path.display())]
    Read { path: PathBuf, reason: String },
    /// A cell does not contain a number.
    #[error("{}, line {line}: {name} is {text:?}, expected a number", path.display())]
    Number { path: PathBuf, line: u64, name: String, text: String },
    /// A time is earlier than the time of the row before.
    #[error(
        "{}, {place}: {name} is {time} after {before}, expected times that do not decrease{hint}",
        path.display()
    )]
    Order {
        path: PathBuf,
        /// Line or row, counted from 1.
        place: String,
        name: String,
        time: f64,
        before: f64,
        /// Says if the column is the time because it is the first one; otherwise empty.
        hint: &'static str,
    },
    /// A column contains texts; numbers are required.
    #[error("{}: {name} holds texts, expected numbers", path.display())]
    Text { path: PathBuf, name: String },
    /// A pattern matches no column, or the selection is empty.
    #[error("{}: {source}", path.display())]
    Selection { path: PathBuf, source: SelectionError },
}

/// Creates a result file, and the folder of the file if the folder is missing. The extension `.csv` or `.parquet`
/// selects the format. A pipe or a device takes CSV only, and needs no extension.
///
/// # Errors
///
/// [`ResultsError::Format`] for another extension, [`ResultsError::Duplicate`] for two columns of one
/// name or a column named [`TIME`], [`ResultsError::InUse`] if another run is writing the file,
/// [`ResultsError::Write`] if the file cannot be created, or for Parquet to a pipe or a device.
pub fn create(path: &Path, columns: &[Column]) -> Result<Box<dyn Sink>, ResultsError> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    match (ending.to_str(), is_stream(path)) {
        (Some("parquet"), true) => {
            let source = io::Error::other("a pipe or a device takes CSV only");
            Err(ResultsError::Write { path: path.to_owned(), source })
        }
        (Some("parquet"), false) => Ok(Box::new(ParquetSink::create(path, columns)?)),
        (Some("csv"), _) | (_, true) => Ok(Box::new(CsvSink::create(path, columns)?)),
        _ => Err(ResultsError::Format { path: path.to_owned() }),
    }
}

/// Checks that the names of the columns differ from each other and from [`TIME`].
fn check_names(columns: &[Column]) -> Result<(), ResultsError> {
    let mut known = HashSet::from([TIME]);
    match columns.iter().find(|column| !known.insert(&column.name)) {
        Some(column) => Err(ResultsError::Duplicate { name: column.name.clone() }),
        None => Ok(()),
    }
}

/// The types of the values of a row, and the number of columns of each; Long columns count as Integer.
#[derive(Debug, Clone, Copy)]
struct Widths([(ColumnKind, usize); 4]);

impl Widths {
    fn new(columns: &[Column]) -> Self {
        let count = |kind| columns.iter().filter(|column| column.kind == kind).count();
        Self([
            (ColumnKind::Real, count(ColumnKind::Real)),
            (ColumnKind::Integer, count(ColumnKind::Integer) + count(ColumnKind::Long)),
            (ColumnKind::Boolean, count(ColumnKind::Boolean)),
            (ColumnKind::String, count(ColumnKind::String)),
        ])
    }

    fn check(&self, row: &Row<'_>) -> Result<(), ResultsError> {
        let Row { reals, integers, booleans, strings, .. } = row;
        let lengths = [reals.len(), integers.len(), booleans.len(), strings.len()];
        match self.0.into_iter().zip(lengths).find(|((_, expected), actual)| expected != actual) {
            Some(((kind, expected), actual)) => {
                Err(ResultsError::Values { kind, expected, actual })
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
