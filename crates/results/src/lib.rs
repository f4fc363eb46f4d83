//! Results of a run: the columns, the files they are written to as the run goes, and the way back.
//!
//! [`create`] opens a [`Sink`] by the ending of the file: [`CsvSink`] or [`ParquetSink`].
//! [`Selection`] chooses the variables, [`Decimation`] the instants; [`Table`] reads a file.
#![forbid(unsafe_code)]

mod csv;
mod decimation;
mod envelope;
mod pace;
mod parquet;
mod read;
mod select;

use std::collections::HashSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

pub use csv::CsvSink;
pub use decimation::{Decimation, Due};
pub use envelope::Envelope;
pub use parquet::ParquetSink;
pub use read::Table;
pub use select::{Selection, SelectionError};

/// Name of the first column of every file, in s.
pub const TIME: &str = "time";

/// One recorded variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// As in `plant.x_p`.
    pub name: String,
    /// What its values are.
    pub kind: ColumnKind,
    /// Unit of the values, where one is stated.
    pub unit: Option<String>,
}

/// The types of FMI 2.0; an Enumeration is an Integer here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// fmi2Real.
    Real,
    /// fmi2Integer.
    Integer,
    /// fmi2Boolean.
    Boolean,
    /// fmi2String.
    String,
}

/// The values of one instant, each list in the order of the columns of its kind.
#[derive(Debug, Clone, Copy, Default)]
pub struct Row<'a> {
    /// Of the Real columns.
    pub reals: &'a [f64],
    /// Of the Integer columns.
    pub integers: &'a [i32],
    /// Of the Boolean columns: zero is false.
    pub booleans: &'a [i32],
    /// Of the String columns.
    pub strings: &'a [String],
}

/// A place that takes the rows of a run, one after another. One that is dropped without
/// [`Sink::finish`] keeps every row that it was given, as far as the disk allows.
pub trait Sink: Send {
    /// Takes the values at `time` in s. CSV allocates nothing here; Parquet does where it hands a
    /// block of rows over.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Values`] where the row does not fit the columns; [`ResultsError::Write`].
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError>;

    /// Hands every row so far to the operating system; the file is then whole and readable.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Write`].
    fn flush(&mut self) -> Result<(), ResultsError>;

    /// Ends the file.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Write`].
    fn finish(self: Box<Self>) -> Result<(), ResultsError>;
}

/// Why results cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// The ending says no format.
    #[error("{}: results are written as .csv or .parquet", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// Two columns of one name cannot be told apart by a reader.
    #[error("two columns of the results have the name {name:?}")]
    Duplicate {
        /// The name.
        name: String,
    },
    /// A row with more or fewer values than columns.
    #[error("a row has {found} values of type {kind:?}, expected {expected}")]
    Values {
        /// Their type.
        kind: ColumnKind,
        /// Columns of that type.
        expected: usize,
        /// Values in the row.
        found: usize,
    },
    /// Another process, or another sink of this one, writes to the file.
    #[error(
        "{}: another run writes its results to this file, expected one that ends first, or another \
         folder or file (--out, --results)",
        path.display()
    )]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The file cannot be made or has no more room.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// The file cannot be read, or is not what its ending says.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A cell that holds no number.
    #[error("{}, line {line}: {name} is {text:?}, expected a number", path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: u64,
        /// The column.
        name: String,
        /// The cell.
        text: String,
    },
    /// A column of texts where numbers are wanted.
    #[error("{}: {name} holds texts, expected numbers", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// The column.
        name: String,
    },
    /// A name that the file does not have.
    #[error("{}: {source}", path.display())]
    Selection {
        /// The file.
        path: PathBuf,
        /// Which name.
        source: SelectionError,
    },
}

/// The formats of results, by the ending of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Parquet,
}

impl Format {
    fn of(path: &Path) -> Result<Self, ResultsError> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        if ending == "csv" {
            Ok(Self::Csv)
        } else if ending == "parquet" {
            Ok(Self::Parquet)
        } else {
            Err(ResultsError::Format { path: path.to_owned() })
        }
    }
}

/// Makes the file of results, whose folder is made where it is missing; the ending chooses the
/// format: `.csv` or `.parquet`.
///
/// # Errors
///
/// [`ResultsError::Format`], [`ResultsError::Duplicate`], [`ResultsError::InUse`],
/// [`ResultsError::Write`].
pub fn create(path: &Path, columns: &[Column]) -> Result<Box<dyn Sink>, ResultsError> {
    Ok(match Format::of(path)? {
        Format::Csv => Box::new(CsvSink::create(path, columns)?),
        Format::Parquet => Box::new(ParquetSink::create(path, columns)?),
    })
}

/// Names that differ from each other and from the time's.
fn check_names(columns: &[Column]) -> Result<(), ResultsError> {
    let mut known = HashSet::from([TIME]);
    match columns.iter().find(|column| !known.insert(&column.name)) {
        Some(column) => Err(ResultsError::Duplicate { name: column.name.clone() }),
        None => Ok(()),
    }
}

/// How many columns there are of each kind, to hold rows against.
#[derive(Debug, Clone, Copy)]
struct Widths {
    reals: usize,
    integers: usize,
    booleans: usize,
    strings: usize,
}

impl Widths {
    fn new(columns: &[Column]) -> Self {
        let count = |kind| columns.iter().filter(|column| column.kind == kind).count();
        Self {
            reals: count(ColumnKind::Real),
            integers: count(ColumnKind::Integer),
            booleans: count(ColumnKind::Boolean),
            strings: count(ColumnKind::String),
        }
    }

    fn check(&self, row: &Row<'_>) -> Result<(), ResultsError> {
        for (kind, expected, found) in [
            (ColumnKind::Real, self.reals, row.reals.len()),
            (ColumnKind::Integer, self.integers, row.integers.len()),
            (ColumnKind::Boolean, self.booleans, row.booleans.len()),
            (ColumnKind::String, self.strings, row.strings.len()),
        ] {
            if expected != found {
                return Err(ResultsError::Values { kind, expected, found });
            }
        }
        Ok(())
    }
}

/// An empty file in a folder that is made where it is missing. It is this process's alone as long as
/// it is open.
fn create_file(path: &Path) -> Result<File, ResultsError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let failed = |source| ResultsError::Write { path: path.to_owned(), source };
    folder.map_or(Ok(()), fs::create_dir_all).map_err(failed)?;
    let file = open_alone(path).map_err(failed)?;
    let file = file.ok_or_else(|| ResultsError::InUse { path: path.to_owned() })?;
    let length = file.metadata().map_err(failed)?.len();
    if length > 0 {
        tracing::info!("{}: replaces the results of an earlier run", path.display());
        file.set_len(0).map_err(failed)?;
    }
    Ok(file)
}

/// Opens a file for writing, its content as it is; none where another process has it open so. The
/// lock ends with the process, however that ends.
#[cfg(not(windows))]
fn open_alone(path: &Path) -> io::Result<Option<File>> {
    let file = File::options().write(true).create(true).truncate(false).open(path)?;
    // A device or a pipe may be for many.
    if !file.metadata()?.is_file() {
        return Ok(Some(file));
    }
    match file.try_lock() {
        // A file system without locks cannot tell.
        Ok(()) | Err(fs::TryLockError::Error(_)) => Ok(Some(file)),
        Err(fs::TryLockError::WouldBlock) => Ok(None),
    }
}

/// As on other systems; readers may open the file, writers may not.
#[cfg(windows)]
fn open_alone(path: &Path) -> io::Result<Option<File>> {
    use std::os::windows::fs::OpenOptionsExt as _;
    const FILE_SHARE_READ: u32 = 1;
    const ERROR_SHARING_VIOLATION: i32 = 32;
    let mut options = File::options();
    options.write(true).create(true).truncate(false).share_mode(FILE_SHARE_READ);
    match options.open(path) {
        Err(error) if error.raw_os_error() == Some(ERROR_SHARING_VIOLATION) => Ok(None),
        opened => opened.map(Some),
    }
}

#[cfg(test)]
mod tests;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
