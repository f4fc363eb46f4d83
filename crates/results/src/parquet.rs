//! Apache Parquet: a binary file of typed columns.

mod block;
mod footer;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use ::parquet::basic::Encoding;
use ::parquet::column::writer::{ColumnWriter, ColumnWriterImpl};
use ::parquet::data_type::DataType;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::RowGroupMetaData;
use ::parquet::file::properties::{EnabledStatistics, WriterProperties};
use ::parquet::file::writer::{SerializedRowGroupWriter, TrackedWrite};
use ::parquet::schema::types::ColumnPath;

use super::output::OutputFile;
use super::pace::Pace;
use super::{Column, ColumnKind, ResultsError, Row, Sink, TIME, Widths, check_names};
use block::Block;
use footer::Footer;

pub(super) use footer::units;

/// The first and the last bytes of a Parquet file.
const MAGIC: &[u8] = b"PAR1";
/// Longest time that a row stays in memory only, while further rows arrive.
const INTERVAL: Duration = Duration::from_secs(1);
/// Size of a page of a column in bytes.
const PAGE: usize = 1 << 20;

/// A sink that writes Parquet: `time` and Real as DOUBLE, Integer as INT32, Boolean as BOOLEAN, String
/// as UTF-8; only values of clocked columns are null. The footer's metadata contains the units.
///
/// Rows are collected in a block of bounded size, which becomes a row group. A single write replaces
/// the previous footer by the row group and a new footer, so that the file is always readable. A partly
/// filled block is written again by the next write. If the disk is full, the file keeps the content of
/// the last successful write.
#[derive(Debug)]
pub struct ParquetSink {
    file: OutputFile,
    widths: Widths,
    properties: Arc<WriterProperties>,
    footer: Footer,
    /// For each column of the file, its number among the clocked ones.
    clocked: Vec<Option<usize>>,
    block: Block,
    /// End of the row groups of full blocks.
    end: u64,
    /// Number of rows of the present block that are in the file.
    written: usize,
    /// Buffer for the next write, reused to save allocations.
    bytes: Vec<u8>,
    pace: Pace,
}

impl ParquetSink {
    /// Creates the file without rows.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`] for two columns of one name, [`ResultsError::InUse`] if another run is
    /// writing the file, [`ResultsError::Write`] if the file cannot be created.
    pub fn create(path: &Path, columns: &[Column]) -> Result<Self, ResultsError> {
        check_names(columns)?;
        let failed = |source| write_error(path, source);
        let mut sink = Self {
            file: OutputFile::create(path)?,
            widths: Widths::new(columns),
            properties: Arc::new(properties(columns)),
            footer: Footer::new(columns).map_err(failed)?,
            clocked: clocked(columns),
            block: Block::new(columns),
            end: 0,
            written: 0,
            bytes: MAGIC.to_vec(),
            pace: Pace::new(INTERVAL),
        };
        sink.footer.append(&mut sink.bytes, None).map_err(failed)?;
        sink.write()?;
        sink.file.record(false);
        sink.end = MAGIC.len() as u64;
        Ok(sink)
    }

    /// Writes the rows of the block and the footer; starts the next block if this one is full.
    fn write_rows(&mut self) -> Result<(), ResultsError> {
        self.file.verify()?;
        let rows = self.block.rows();
        if rows == self.written && !self.block.is_full() {
            return Ok(());
        }
        let (group, size) = self.compose(rows)?;
        if let Err(error) = self.write() {
            self.restore_end();
            return Err(error);
        }
        self.written = rows;
        self.file.record(false);
        if self.block.is_full() {
            self.footer.keep(group);
            self.end += size;
            self.block.clear();
            self.written = 0;
        }
        Ok(())
    }

    /// Encodes the first `rows` of the block as a row group, followed by the footer, to `bytes`. Returns the
    /// metadata of the row group and its size.
    fn compose(&mut self, rows: usize) -> Result<(RowGroupMetaData, u64), ResultsError> {
        let group = self.encode(rows).map_err(|source| write_error(self.file.path(), source))?;
        let size = self.bytes.len() as u64;
        let done = self.footer.append(&mut self.bytes, Some(group.clone()));
        done.map_err(|source| write_error(self.file.path(), source))?;
        Ok((group, size))
    }

    /// Restores the end of the file, which a failed write has overwritten. This needs no additional
    /// space on the disk. If it also fails, the file keeps the row groups of full blocks, with a shorter
    /// footer.
    fn restore_end(&mut self) {
        let length = self.file.length();
        let _ = self.file.set_length(length);
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
        let _ = self.file.set_length(self.end);
        self.bytes.clear();
        if self.footer.append(&mut self.bytes, None).is_ok() {
            // The caller reports the error of the write instead.
            let _ = self.write();
        }
        self.written = 0;
    }

    /// Encodes the first `rows` of the block as a row group to `bytes`.
    fn encode(&mut self, rows: usize) -> Result<RowGroupMetaData, ParquetError> {
        self.bytes.clear();
        let mut bytes = TrackedWrite::new(std::mem::take(&mut self.bytes));
        let schema = self.footer.schema();
        let mut group =
            SerializedRowGroupWriter::new(schema, self.properties.clone(), &mut bytes, 0, None);
        let mut reader = self.block.reader(rows);
        let mut clocked = self.clocked.iter();
        while let Some(mut column) = group.next_column()? {
            let levels = clocked.next().copied().flatten().map(|own| self.block.levels(own, rows));
            let levels = levels.as_deref();
            match column.untyped() {
                ColumnWriter::DoubleColumnWriter(writer) => {
                    write(writer, reader.reals(), levels)?;
                }
                ColumnWriter::Int32ColumnWriter(writer) => {
                    write(writer, reader.integers(), levels)?;
                }
                ColumnWriter::Int64ColumnWriter(writer) => {
                    write(writer, reader.longs(), levels)?;
                }
                ColumnWriter::BoolColumnWriter(writer) => {
                    write(writer, reader.booleans(), levels)?;
                }
                ColumnWriter::ByteArrayColumnWriter(writer) => {
                    write(writer, &reader.strings(), levels)?;
                }
                _ => return Err(ParquetError::General("a column of another type".to_owned())),
            }
            column.close()?;
        }
        let metadata = group.close()?;
        self.bytes = bytes.into_inner()?;
        footer::moved(&metadata, self.end)
    }

    /// Writes `bytes` after the row groups of full blocks, as the end of the file.
    fn write(&mut self) -> Result<(), ResultsError> {
        self.file.write_at(self.end, &self.bytes)?;
        self.file.set_length(self.end + self.bytes.len() as u64)
    }
}

impl Sink for ParquetSink {
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError> {
        self.widths.check(row)?;
        if self.block.is_full() {
            self.write_rows()?;
        }
        self.block.push(time, row);
        if self.block.is_full() || self.pace.due() { self.write_rows() } else { Ok(()) }
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

impl Drop for ParquetSink {
    fn drop(&mut self) {
        // No caller is left to receive the error.
        let _ = self.write_rows();
    }
}

/// Returns for each column of the file its number among the clocked ones; the time is the first column.
fn clocked(columns: &[Column]) -> Vec<Option<usize>> {
    let mut count = 0..;
    let number = |column: &Column| if column.clocked { count.next() } else { None };
    std::iter::once(None).chain(columns.iter().map(number)).collect()
}

/// Writes the values of a column; those whose level is 0 are null.
fn write<T: DataType>(
    writer: &mut ColumnWriterImpl<'_, T>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let Some(levels) = levels else {
        return writer.write_batch(values, None, None).map(|_| ());
    };
    let there = values.iter().zip(levels).filter(|(_, level)| **level > 0);
    let there: Vec<T::T> = there.map(|(value, _)| value.clone()).collect();
    writer.write_batch(&there, Some(levels), None).map(|_| ())
}

/// Returns the encodings: plain for numbers, which copies the memory; a dictionary for texts, which
/// repeat.
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
