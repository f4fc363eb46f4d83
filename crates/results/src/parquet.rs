//! Apache Parquet: a binary file of typed columns.

mod block;
mod footer;
mod tail;

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
use tail::Tail;

pub(super) use footer::units;

/// The first and the last bytes of a Parquet file.
const MAGIC: &[u8] = b"PAR1";
/// Longest time that a row stays in memory only, while further rows arrive.
const INTERVAL: Duration = Duration::from_millis(500);
/// Size of a page of a column in bytes.
const PAGE: usize = 1 << 20;

/// A sink that writes Parquet: `time` and Real as DOUBLE, Integer as INT32, Long as INT64, Boolean as BOOLEAN,
/// String as UTF-8; only values of clocked columns can be null. The footer's metadata contains the units.
///
/// Rows are collected in a block of bounded size, which becomes a row group. A partly filled block is written again by
/// the next write. The file is readable at every instant, also if the process is killed during a write or the disk is
/// full: then it has the rows of the last complete write. An unfinished file may have unused bytes between the row
/// groups, at most 48 MiB.
#[derive(Debug)]
pub struct ParquetSink {
    tail: Tail,
    widths: Widths,
    properties: Arc<WriterProperties>,
    footer: Footer,
    /// For each column of the file, its number among the clocked columns; `None` for a column that is not clocked.
    clocked: Vec<Option<usize>>,
    block: Block,
    /// End of the row groups of full blocks.
    end: u64,
    /// Number of rows of the present block that are in the file.
    written: usize,
    /// Buffer for the row group of the next write, reused to save allocations.
    bytes: Vec<u8>,
    pace: Pace,
}

impl ParquetSink {
    /// Creates the file without rows.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`] for two columns of one name or a column named [`TIME`],
    /// [`ResultsError::InUse`] if another run is writing the file, [`ResultsError::Write`] if the file cannot be
    /// created.
    pub fn create(path: &Path, columns: &[Column]) -> Result<Self, ResultsError> {
        check_names(columns)?;
        let failed = |source| write_error(path, source);
        let mut footer = Footer::new(columns).map_err(failed)?;
        let first = footer.render(None).map_err(failed)?;
        let tail = Tail::create(OutputFile::create(path)?, first)?;
        tail.file.record(false);
        Ok(Self {
            end: tail.start(),
            tail,
            widths: Widths::new(columns),
            properties: Arc::new(properties(columns)),
            footer,
            clocked: clocked(columns),
            block: Block::new(columns),
            written: 0,
            bytes: Vec::new(),
            pace: Pace::new(INTERVAL),
        })
    }

    /// Writes the rows of the block and the footer, unless the file has them already; starts the next block if this one
    /// is full. With `last`, also moves the tail so that the file has no unused bytes.
    fn write_rows(&mut self, last: bool) -> Result<(), ResultsError> {
        self.tail.file.verify()?;
        let (rows, full) = (self.block.rows, self.block.is_full());
        let has_unused_bytes = self.tail.start() > self.end;
        if rows == self.written && !full && !(last && has_unused_bytes) {
            return Ok(());
        }
        let path = self.tail.file.path().to_owned();
        let failed = |error| write_error(&path, error);
        let group = self.encode().map_err(failed)?;
        let metadata = footer::at_offset(&group, self.end).map_err(failed)?;
        let footer = self.footer.render(Some(metadata.clone())).map_err(failed)?;
        // The end of the tail is rounded up.
        let end = self.end + (self.bytes.len() + footer.len() + 8) as u64;
        let fits = end <= self.tail.start();
        let is_partial = self.written > 0;
        // At or behind `end`, so that a tail at `self.end` fits in front of the tail at this offset.
        let offset = self.tail.file.length().max(end);
        if !fits && !is_partial {
            self.tail.move_footer(offset)?;
        } else if !fits {
            let group = footer::at_offset(&group, offset).map_err(failed)?;
            let footer = self.footer.render(Some(group)).map_err(failed)?;
            self.tail.replace(offset, &self.bytes, footer)?;
            self.written = rows;
        }
        if fits || !is_partial || full || last {
            self.tail.replace(self.end, &self.bytes, footer)?;
            self.written = rows;
        }
        self.tail.file.record(false);
        if full {
            let size = self.bytes.len() as u64;
            self.footer.groups.push(metadata);
            self.tail.detach_group(size);
            self.end += size;
            self.block.clear();
            self.written = 0;
        }
        Ok(())
    }

    /// Encodes the block as a row group to `bytes`; returns its metadata for offset 0.
    fn encode(&mut self) -> Result<Arc<RowGroupMetaData>, ParquetError> {
        self.bytes.clear();
        let mut bytes = TrackedWrite::new(std::mem::take(&mut self.bytes));
        let schema = self.footer.schema.clone();
        let mut group =
            SerializedRowGroupWriter::new(schema, self.properties.clone(), &mut bytes, 0, None);
        let block = &self.block;
        let (mut reals, mut integers) =
            (block.columns(&block.reals), block.columns(&block.integers));
        let (mut longs, mut booleans) =
            (block.columns(&block.longs), block.columns(&block.booleans));
        let mut strings = (0..).map(|number| block.texts(number));
        let mut clocked = self.clocked.iter();
        while let Some(mut column) = group.next_column()? {
            let levels = clocked.next().copied().flatten().map(|number| block.levels(number));
            let levels = levels.as_deref();
            match column.untyped() {
                ColumnWriter::DoubleColumnWriter(writer) => write(writer, reals.next(), levels),
                ColumnWriter::Int32ColumnWriter(writer) => write(writer, integers.next(), levels),
                ColumnWriter::Int64ColumnWriter(writer) => write(writer, longs.next(), levels),
                ColumnWriter::BoolColumnWriter(writer) => write(writer, booleans.next(), levels),
                ColumnWriter::ByteArrayColumnWriter(writer) => {
                    write(writer, strings.next().as_deref(), levels)
                }
                _ => Err(ParquetError::General("a column of another type".to_owned())),
            }?;
            column.close()?;
        }
        let metadata = group.close()?;
        self.bytes = bytes.into_inner()?;
        Ok(metadata)
    }
}

impl Sink for ParquetSink {
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError> {
        self.widths.check(row)?;
        if self.block.is_full() {
            self.write_rows(false)?;
        }
        self.block.push(time, row);
        if self.block.is_full() || self.pace.due() { self.write_rows(false) } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.write_rows(false)
    }

    fn finish(mut self: Box<Self>) -> Result<(), ResultsError> {
        self.write_rows(true)?;
        self.tail.file.verify_path()?;
        self.tail.file.record(true);
        Ok(())
    }
}

impl Drop for ParquetSink {
    fn drop(&mut self) {
        // No caller is left to receive the error.
        let _ = self.write_rows(true);
    }
}

/// Returns for each column of the file, of which the time is the first, its number among the clocked columns; `None`
/// for a column that is not clocked.
fn clocked(columns: &[Column]) -> Vec<Option<usize>> {
    let mut count = 0..;
    let number = |column: &Column| if column.clocked { count.next() } else { None };
    std::iter::once(None).chain(columns.iter().map(number)).collect()
}

/// Writes the values of a column. `levels` are their definition levels: 0 makes a value null. Without levels, no value
/// is null.
fn write<T: DataType>(
    writer: &mut ColumnWriterImpl<'_, T>,
    values: Option<&[T::T]>,
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let values = values.unwrap_or_default();
    let written = if let Some(levels) = levels {
        let present = values.iter().zip(levels).filter(|(_, level)| **level > 0);
        let present: Vec<T::T> = present.map(|(value, _)| value.clone()).collect();
        writer.write_batch(&present, Some(levels), None)
    } else {
        writer.write_batch(values, None, None)
    };
    written.map(|_| ())
}

/// Returns the settings of the writer: a plain encoding for numbers, which copies the memory; a dictionary for
/// texts, which repeat; no statistics.
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
