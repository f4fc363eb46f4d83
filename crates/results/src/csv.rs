//! Comma-separated values in the layout of `FMPy`, RFC 4180.

mod lines;

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::pace::Pace;
use super::{Column, ColumnKind, ResultsError, Row, Sink, TIME, Widths, check_names, create_file};
use lines::Lines;

/// Bytes that are gathered before they go to the operating system.
const BUFFER: usize = 256 * 1024;
/// Longest time that a row waits for it while rows keep coming.
const INTERVAL: Duration = Duration::from_millis(100);

/// Writes one line for each row: the time, then the columns in their order.
///
/// The first line has the names, quoted. A Real has the fewest digits that read back as the same
/// number (Schubfach; Giulietti 2020), not-a-number is `NaN`, infinity `inf`; a Boolean is 0 or 1;
/// a String is quoted. Units have no place in this layout.
#[derive(Debug)]
pub struct CsvSink {
    path: PathBuf,
    file: File,
    widths: Widths,
    kinds: Vec<ColumnKind>,
    /// Whole lines that are not yet in the file.
    lines: Lines,
    /// Length of the file: always whole lines.
    written: u64,
    pace: Pace,
}

impl CsvSink {
    /// Makes the file and writes its first line.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`], [`ResultsError::Write`].
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
            path: path.to_owned(),
            file: create_file(path)?,
            widths: Widths::new(columns),
            kinds: columns.iter().map(|column| column.kind).collect(),
            lines,
            written: 0,
            pace: Pace::new(INTERVAL),
        };
        sink.hand_over()?;
        Ok(sink)
    }

    /// Appends the lines to the file, or leaves it as it was.
    fn hand_over(&mut self) -> Result<(), ResultsError> {
        match self.file.write_all(self.lines.bytes()) {
            Ok(()) => {
                self.written += self.lines.bytes().len() as u64;
                self.lines.clear();
                Ok(())
            }
            Err(source) => {
                // Half a line would be read as a row; what cannot be cut, as a pipe, stays.
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
        let lines = &mut self.lines;
        let mut reals = row.reals.iter();
        let mut integers = row.integers.iter();
        let mut booleans = row.booleans.iter();
        let mut strings = row.strings.iter();
        lines.begin(row.strings.iter().map(String::as_str));
        lines.real(time);
        for kind in &self.kinds {
            lines.push(b',');
            match kind {
                ColumnKind::Real => reals.next().into_iter().for_each(|value| lines.real(*value)),
                ColumnKind::Integer => {
                    integers.next().into_iter().for_each(|value| lines.integer(*value));
                }
                ColumnKind::Boolean => booleans
                    .next()
                    .into_iter()
                    .for_each(|value| lines.push(if *value == 0 { b'0' } else { b'1' })),
                ColumnKind::String => strings.next().into_iter().for_each(|text| lines.quote(text)),
            }
        }
        lines.push(b'\n');
        if self.lines.bytes().len() >= BUFFER || self.pace.due() {
            self.hand_over()
        } else {
            Ok(())
        }
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.hand_over()
    }

    fn finish(mut self: Box<Self>) -> Result<(), ResultsError> {
        self.hand_over()
    }
}

impl Drop for CsvSink {
    fn drop(&mut self) {
        // Nobody is left to be told of a failure.
        let _ = self.hand_over();
    }
}

#[cfg(test)]
mod tests;
