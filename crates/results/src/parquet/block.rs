//! A block of rows, stored by column, which becomes a row group.

use ::parquet::data_type::ByteArray;

use super::{Column, ColumnKind, Row};
use crate::memory::limited;

/// Approximate size of the values of a block in bytes.
const BYTES: usize = 16 << 20;
/// Range of the number of rows of a block: few rows for many columns, many rows for few columns.
const ROWS: std::ops::RangeInclusive<usize> = 512..=65_536;
/// Unused values between neighbouring columns: one cache line. With a distance of a power of two all
/// columns of a row would map to the same set of the cache.
const PADDING: usize = 8;

/// Columns of fixed capacity. Texts of all columns are stored together, row by row.
#[derive(Debug)]
pub(super) struct Block {
    /// Number of rows.
    rows: usize,
    /// Capacity in rows.
    room: usize,
    reals: Vec<f64>,
    integers: Vec<i32>,
    longs: Vec<i64>,
    /// For each value of [`Row::integers`], whether its column is a Long.
    is_long: Vec<bool>,
    booleans: Vec<bool>,
    texts: Vec<u8>,
    /// End of each text in `texts`.
    ends: Vec<usize>,
    /// Number of texts in a row.
    strings: usize,
    /// For each row, whether each clocked column has a value.
    present: Vec<bool>,
    /// Number of clocked columns.
    clocked: usize,
}

impl Block {
    pub(super) fn new(columns: &[Column]) -> Self {
        let count = |kind| columns.iter().filter(|column| column.kind == kind).count();
        let (reals, integers) = (1 + count(ColumnKind::Real), count(ColumnKind::Integer));
        let (booleans, strings) = (count(ColumnKind::Boolean), count(ColumnKind::String));
        let longs = count(ColumnKind::Long);
        let width = 8 * (reals + longs) + 4 * integers + booleans + 16 * strings;
        let room = (BYTES / width).clamp(*ROWS.start(), *ROWS.end());
        let stride = room + PADDING;
        Self {
            rows: 0,
            room,
            reals: vec![0.0; reals * stride],
            integers: vec![0; integers * stride],
            longs: vec![0; longs * stride],
            is_long: columns
                .iter()
                .filter(|column| matches!(column.kind, ColumnKind::Integer | ColumnKind::Long))
                .map(|column| column.kind == ColumnKind::Long)
                .collect(),
            booleans: vec![false; booleans * stride],
            texts: Vec::new(),
            ends: Vec::with_capacity(strings * room),
            strings,
            present: Vec::new(),
            clocked: columns.iter().filter(|column| column.clocked).count(),
        }
    }

    #[cfg(test)]
    pub(super) fn room(&self) -> usize {
        self.room
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn is_full(&self) -> bool {
        self.rows == self.room || self.texts.len() >= BYTES
    }

    pub(super) fn clear(&mut self) {
        self.rows = 0;
        self.texts.clear();
        self.ends.clear();
        self.present.clear();
    }

    /// Adds a row. The block must not be full.
    pub(super) fn push(&mut self, time: f64, row: &Row<'_>) {
        let stride = self.room + PADDING;
        let reals = self.reals[self.rows..].iter_mut().step_by(stride);
        for (place, value) in reals.zip(std::iter::once(&time).chain(row.reals)) {
            *place = *value;
        }
        // `skip` instead of a slice: a type without columns has no storage, and a slice would panic.
        let mut integers = self.integers.iter_mut().skip(self.rows).step_by(stride);
        let mut longs = self.longs.iter_mut().skip(self.rows).step_by(stride);
        for (is_long, value) in self.is_long.iter().zip(row.integers) {
            if *is_long {
                longs.next().into_iter().for_each(|place| *place = *value);
            } else {
                integers.next().into_iter().for_each(|place| *place = limited(*value));
            }
        }
        let booleans = self.booleans.iter_mut().skip(self.rows).step_by(stride);
        for (place, value) in booleans.zip(row.booleans) {
            *place = *value != 0;
        }
        for text in row.strings {
            self.texts.extend_from_slice(text.as_bytes());
            self.ends.push(self.texts.len());
        }
        let present =
            (0..self.clocked).map(|number| row.present.get(number).copied().unwrap_or(true));
        self.present.extend(present);
        self.rows += 1;
    }

    /// Returns the definition levels of the first `rows` of the clocked column number `clocked`: 0 for null, else 1.
    pub(super) fn levels(&self, clocked: usize, rows: usize) -> Vec<i16> {
        let flags = self.present.iter().skip(clocked).step_by(self.clocked.max(1));
        flags.take(rows).map(|present| i16::from(*present)).collect()
    }

    /// Returns a reader of the first `rows` of the columns, or of all rows if there are fewer.
    pub(super) fn reader(&self, rows: usize) -> Reader<'_> {
        let rows = rows.min(self.rows);
        Reader { block: self, rows, reals: 0, integers: 0, longs: 0, booleans: 0, strings: 0 }
    }
}

/// A reader that returns the columns of each type one after another; a call beyond the last column panics.
pub(super) struct Reader<'a> {
    block: &'a Block,
    rows: usize,
    reals: usize,
    integers: usize,
    longs: usize,
    booleans: usize,
    strings: usize,
}

impl Reader<'_> {
    pub(super) fn reals(&mut self) -> &[f64] {
        column(&self.block.reals, &mut self.reals, self.block, self.rows)
    }

    pub(super) fn integers(&mut self) -> &[i32] {
        column(&self.block.integers, &mut self.integers, self.block, self.rows)
    }

    pub(super) fn longs(&mut self) -> &[i64] {
        column(&self.block.longs, &mut self.longs, self.block, self.rows)
    }

    pub(super) fn booleans(&mut self) -> &[bool] {
        column(&self.block.booleans, &mut self.booleans, self.block, self.rows)
    }

    pub(super) fn strings(&mut self) -> Vec<ByteArray> {
        let first = self.strings;
        self.strings += 1;
        let ends = &self.block.ends;
        (0..self.rows)
            .map(|row| {
                let place = row * self.block.strings + first;
                let start = if place == 0 { 0 } else { ends[place - 1] };
                ByteArray::from(self.block.texts[start..ends[place]].to_vec())
            })
            .collect()
    }
}

fn column<'a, T>(values: &'a [T], next: &mut usize, block: &Block, rows: usize) -> &'a [T] {
    let start = *next * (block.room + PADDING);
    *next += 1;
    &values[start..start + rows]
}
