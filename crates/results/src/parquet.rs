//! Apache Parquet: a binary file of typed columns.

mod block;
mod footer;

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use ::parquet::basic::Encoding;
use ::parquet::column::writer::ColumnWriter;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::RowGroupMetaData;
use ::parquet::file::properties::{EnabledStatistics, WriterProperties};
use ::parquet::file::writer::{SerializedRowGroupWriter, TrackedWrite};
use ::parquet::schema::types::ColumnPath;

use super::pace::Pace;
use super::{Column, ColumnKind, ResultsError, Row, Sink, TIME, Widths, check_names, create_file};
use block::Block;
use footer::Footer;

pub(super) use footer::units;

/// What a Parquet file begins and ends with.
const MAGIC: &[u8] = b"PAR1";
/// Longest time that a row is in memory only, while rows keep coming.
const INTERVAL: Duration = Duration::from_secs(1);
/// Bytes of a page of a column.
const PAGE: usize = 1 << 20;

/// Writes typed columns: `time` and Real as DOUBLE, Integer as INT32, Boolean as BOOLEAN, String
/// as UTF-8; no value is null. Units stand in the footer's metadata.
///
/// Rows gather in a block of bounded size, which becomes a row group. Every hand-over, of a full
/// block or of one that is still filling, writes the row group with a footer behind it in one
/// piece over the footer before: the file is readable after each. A block that is still filling
/// is written again by the next one. Where the disk has no room for a hand-over the file is what it
/// was after the last one.
#[derive(Debug)]
pub struct ParquetSink {
    path: PathBuf,
    file: File,
    widths: Widths,
    properties: Arc<WriterProperties>,
    footer: Footer,
    block: Block,
    /// Where the row groups of full blocks end.
    end: u64,
    /// Length of the file.
    length: u64,
    /// Rows of the block that are in the file.
    written: usize,
    /// What is written next; kept for its memory.
    bytes: Vec<u8>,
    pace: Pace,
}

impl ParquetSink {
    /// Makes the file, without rows at first.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`], [`ResultsError::Write`].
    pub fn create(path: &Path, columns: &[Column]) -> Result<Self, ResultsError> {
        check_names(columns)?;
        let failed = |source| write_error(path, source);
        let mut sink = Self {
            path: path.to_owned(),
            file: create_file(path)?,
            widths: Widths::new(columns),
            properties: Arc::new(properties(columns)),
            footer: Footer::new(columns).map_err(failed)?,
            block: Block::new(columns),
            end: 0,
            length: 0,
            written: 0,
            bytes: MAGIC.to_vec(),
            pace: Pace::new(INTERVAL),
        };
        sink.footer.append(&mut sink.bytes, None).map_err(failed)?;
        sink.write()?;
        sink.end = MAGIC.len() as u64;
        Ok(sink)
    }

    /// Writes the rows of the block and the footer; starts the next block where this one is full.
    fn hand_over(&mut self) -> Result<(), ResultsError> {
        let rows = self.block.rows();
        if rows == self.written && !self.block.is_full() {
            return Ok(());
        }
        let (group, size) = self.compose(rows)?;
        if let Err(error) = self.write() {
            self.go_back();
            return Err(error);
        }
        self.written = rows;
        if self.block.is_full() {
            self.footer.keep(group);
            self.end += size;
            self.block.clear();
            self.written = 0;
        }
        Ok(())
    }

    /// Puts the first `rows` of the block as a row group into `bytes`, and the footer behind it: the
    /// group and its size.
    fn compose(&mut self, rows: usize) -> Result<(RowGroupMetaData, u64), ResultsError> {
        let group = self.encode(rows).map_err(|source| write_error(&self.path, source))?;
        let size = self.bytes.len() as u64;
        let done = self.footer.append(&mut self.bytes, Some(group.clone()));
        done.map_err(|source| write_error(&self.path, source))?;
        Ok((group, size))
    }

    /// Makes the file what it was before a hand-over that failed: its end has been written over. What
    /// is written had its place in the file, and needs no more of the disk. Where even that fails the
    /// row groups of full blocks are left, with a footer that is shorter than any before.
    fn go_back(&mut self) {
        let _ = self.file.set_len(self.length);
        let composed = match self.written {
            0 => {
                self.bytes.clear();
                self.footer.append(&mut self.bytes, None).is_ok()
            }
            rows => self.compose(rows).is_ok(),
        };
        if composed && self.write().is_ok() {
            return;
        }
        let _ = self.file.set_len(self.end);
        self.bytes.clear();
        if self.footer.append(&mut self.bytes, None).is_ok() {
            // The error that led here is the one that is told.
            let _ = self.write();
        }
        self.written = 0;
    }

    /// The first `rows` of the block as a row group, in `bytes`.
    fn encode(&mut self, rows: usize) -> Result<RowGroupMetaData, ParquetError> {
        self.bytes.clear();
        let mut bytes = TrackedWrite::new(std::mem::take(&mut self.bytes));
        let schema = self.footer.schema();
        let mut group =
            SerializedRowGroupWriter::new(schema, self.properties.clone(), &mut bytes, 0, None);
        let mut reader = self.block.reader(rows);
        while let Some(mut column) = group.next_column()? {
            match column.untyped() {
                ColumnWriter::DoubleColumnWriter(writer) => {
                    writer.write_batch(reader.reals(), None, None)?;
                }
                ColumnWriter::Int32ColumnWriter(writer) => {
                    writer.write_batch(reader.integers(), None, None)?;
                }
                ColumnWriter::BoolColumnWriter(writer) => {
                    writer.write_batch(reader.booleans(), None, None)?;
                }
                ColumnWriter::ByteArrayColumnWriter(writer) => {
                    writer.write_batch(&reader.strings(), None, None)?;
                }
                _ => return Err(ParquetError::General("a column of another type".to_owned())),
            }
            column.close()?;
        }
        let metadata = group.close()?;
        self.bytes = bytes.into_inner()?;
        footer::moved(&metadata, self.end)
    }

    /// Puts `bytes` behind the row groups of full blocks, and nothing behind them.
    fn write(&mut self) -> Result<(), ResultsError> {
        let length = self.end + self.bytes.len() as u64;
        self.file
            .seek(SeekFrom::Start(self.end))
            .and_then(|_| self.file.write_all(&self.bytes))
            .and_then(|()| if length < self.length { self.file.set_len(length) } else { Ok(()) })
            .map_err(|source| ResultsError::Write { path: self.path.clone(), source })?;
        self.length = length;
        Ok(())
    }
}

impl Sink for ParquetSink {
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError> {
        self.widths.check(row)?;
        if self.block.is_full() {
            self.hand_over()?;
        }
        self.block.push(time, row);
        if self.block.is_full() || self.pace.due() { self.hand_over() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.hand_over()
    }

    fn finish(mut self: Box<Self>) -> Result<(), ResultsError> {
        self.hand_over()
    }
}

impl Drop for ParquetSink {
    fn drop(&mut self) {
        // Nobody is left to be told of a failure.
        let _ = self.hand_over();
    }
}

/// Numbers plain, which is a copy of the memory; texts, which repeat, by a dictionary.
fn properties(columns: &[Column]) -> WriterProperties {
    let mut properties = WriterProperties::builder()
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::PLAIN)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_offset_index_disabled(true)
        .set_data_page_size_limit(PAGE)
        .set_data_page_row_count_limit(usize::MAX)
        .set_write_batch_size(PAGE / size_of::<f64>());
    for column in columns.iter().filter(|column| column.kind == ColumnKind::String) {
        let path = ColumnPath::new(vec![column.name.clone()]);
        properties = properties.set_column_dictionary_enabled(path, true);
    }
    properties.build()
}

fn write_error(path: &Path, source: ParquetError) -> ResultsError {
    ResultsError::Write { path: path.to_owned(), source: std::io::Error::other(source) }
}

#[cfg(test)]
mod tests;
