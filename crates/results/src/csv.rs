//! Writes comma-separated values (RFC 4180) in the layout of `FMPy`.

mod lines;

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::ledger::Ledger;
use super::pace::Pace;
use super::{Column, ColumnKind, ResultsError, Row, Sink, TIME, Widths, check_names, create_file};
use lines::Lines;

/// Number of buffered bytes at which the sink writes to the file.
const BUFFER: usize = 256 * 1024;
/// Longest time that a row stays in the buffer while further rows arrive.
const INTERVAL: Duration = Duration::from_millis(100);

/// A sink that writes CSV: one line per row, the time first, then the columns in their order.
///
/// The first line contains the names, quoted. A Real has the fewest digits that read back as the same
/// number (Schubfach; Giulietti 2020), NaN is `NaN`, infinity `inf`; a Boolean is 0 or 1; a String is
/// quoted; a cell without a value is empty. The layout has no units.
#[derive(Debug)]
pub struct CsvSink {
    path: PathBuf,
    file: File,
    widths: Widths,
    /// Type of each column, and whether it is clocked.
    cells: Vec<(ColumnKind, bool)>,
    /// Complete lines that are not yet in the file.
    lines: Lines,
    /// Length of the file, at the end of a line.
    written: u64,
    /// Keeps the lines for the process that supervises this one, if there is one.
    ledger: Option<Ledger>,
    pace: Pace,
}

impl CsvSink {
    /// Creates the file and writes its first line.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`] for two columns of one name, [`ResultsError::InUse`] if another run is
    /// writing the file, [`ResultsError::Write`] if the file cannot be created.
    pub fn create(path: &Path, columns: &[Column]) -> Result<Self, ResultsError> {
        check_names(columns)?;
        let mut lines = Lines::new(columns, 2 * BUFFER);
        let names = columns.iter().map(|column| column.name.as_str());
        lines.begin(std::iter::once(TIME).chain(names));
        lines.quote(TIME);
        for column in columns {
            lines.push(b',');
            lines.quote(&column.name);
        }
        lines.push(b'\n');
        let file = create_file(path)?;
        let mut sink = Self {
            path: path.to_owned(),
            ledger: Ledger::enter(path, &file),
            file,
            widths: Widths::new(columns),
            cells: columns.iter().map(|column| (column.kind, column.clocked)).collect(),
            lines,
            written: 0,
            pace: Pace::new(INTERVAL),
        };
        sink.write_rows()?;
        Ok(sink)
    }

    fn enter_written(&self, is_complete: bool) {
        if let Some(ledger) = self.ledger {
            ledger.written(self.written, is_complete);
        }
    }

    /// Appends the lines to the file; after a failure the file keeps its former content.
    fn write_rows(&mut self) -> Result<(), ResultsError> {
        match self.file.write_all(self.lines.bytes()) {
            Ok(()) => {
                self.written += self.lines.bytes().len() as u64;
                self.lines.clear();
                self.enter_written(false);
                Ok(())
            }
            Err(source) => {
                // A reader could take an incomplete line for a row. A pipe cannot be truncated.
                let _ = self.file.set_len(self.written);
                let _ = self.file.seek(SeekFrom::Start(self.written));
                Err(ResultsError::Write { path: self.path.clone(), source })
            }
        }
    }
}

impl Sink for CsvSink {
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError> {
        self.widths.check(row)?;
        let start = self.lines.bytes().len();
        let lines = &mut self.lines;
        let mut reals = row.reals.iter();
        let mut integers = row.integers.iter();
        let mut booleans = row.booleans.iter();
        let mut strings = row.strings.iter();
        let mut present = row.present.iter();
        lines.begin(row.strings.iter().map(String::as_str));
        lines.real(time);
        for (kind, clocked) in &self.cells {
            lines.push(b',');
            let shown = !clocked || present.next().copied().unwrap_or(true);
            match kind {
                ColumnKind::Real => {
                    if let Some(value) = reals.next().filter(|_| shown) {
                        lines.real(*value);
                    }
                }
                ColumnKind::Integer | ColumnKind::Long => {
                    if let Some(value) = integers.next().filter(|_| shown) {
                        lines.integer(*value);
                    }
                }
                ColumnKind::Boolean => {
                    if let Some(value) = booleans.next().filter(|_| shown) {
                        lines.push(if *value == 0 { b'0' } else { b'1' });
                    }
                }
                ColumnKind::String => {
                    if let Some(text) = strings.next().filter(|_| shown) {
                        lines.quote(text);
                    }
                }
            }
        }
        lines.push(b'\n');
        let rows = self.lines.bytes();
        let is_kept = self.ledger.is_none_or(|ledger| ledger.keep(rows, start));
        if rows.len() >= BUFFER || !is_kept || self.pace.due() { self.write_rows() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.write_rows()
    }

    fn finish(mut self: Box<Self>) -> Result<(), ResultsError> {
        self.write_rows()?;
        self.enter_written(true);
        Ok(())
    }
}

impl Drop for CsvSink {
    fn drop(&mut self) {
        // No caller is left to receive the error.
        let _ = self.write_rows();
    }
}

#[cfg(test)]
mod tests;
