//! Writes comma-separated values (RFC 4180) in the layout of `FMPy`.

mod lines;

use std::path::Path;
use std::time::Duration;

use super::output::OutputFile;
use super::pace::Pace;
use super::{Column, ColumnKind, ResultsError, Row, Sink, TIME, Widths, check_names};
use lines::Lines;

/// Number of buffered bytes at which the sink writes to the file.
const BUFFER: usize = 256 * 1024;
/// Longest time that a row stays in the buffer while further rows arrive.
const INTERVAL: Duration = Duration::from_millis(100);

/// A sink that writes CSV: one line per row, the time first, then the columns in their order.
///
/// The first line contains the names, quoted. A Real has the fewest digits that read back as the same
/// number (Schubfach; Giulietti 2020), NaN is `NaN`, infinity `inf` or `-inf`; a Boolean is 0 or 1; a
/// String is quoted; a cell without a value is empty. The file has no units.
#[derive(Debug)]
pub struct CsvSink {
    file: OutputFile,
    widths: Widths,
    /// Type of each column, and whether it is clocked.
    cells: Vec<(ColumnKind, bool)>,
    /// Complete lines that are not yet in the file.
    lines: Lines,
    pace: Pace,
}

impl CsvSink {
    /// Creates the file and writes its first line.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`] for two columns of one name or a column named [`TIME`],
    /// [`ResultsError::InUse`] if another run is writing the file, [`ResultsError::Write`] if the file cannot be
    /// created.
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
        let mut sink = Self {
            file: OutputFile::create(path)?,
            widths: Widths::new(columns),
            cells: columns.iter().map(|column| (column.kind, column.clocked)).collect(),
            lines,
            pace: Pace::new(INTERVAL),
        };
        sink.write_rows()?;
        Ok(sink)
    }

    /// Verifies the file and appends the lines. After a failure the lines stay in the buffer.
    fn write_rows(&mut self) -> Result<(), ResultsError> {
        self.file.verify()?;
        if self.lines.bytes().is_empty() {
            return Ok(());
        }
        self.file.append(self.lines.bytes())?;
        self.lines.clear();
        self.file.record(false);
        Ok(())
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
        let is_kept = self.file.keep(rows, start);
        if rows.len() >= BUFFER || !is_kept || self.pace.due() { self.write_rows() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.write_rows()
    }

    fn finish(mut self: Box<Self>) -> Result<(), ResultsError> {
        self.write_rows()?;
        self.file.verify_path()?;
        self.file.record(true);
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
