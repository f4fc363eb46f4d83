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
    pub(super) rows: usize,
    /// Number of rows for which the block has room.
    pub(super) room: usize,
    pub(super) reals: Vec<f64>,
    pub(super) integers: Vec<i32>,
    pub(super) longs: Vec<i64>,
    /// For each value of [`Row::integers`], whether its column is a Long.
    is_long: Vec<bool>,
    pub(super) booleans: Vec<bool>,
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

    /// Returns the definition levels of the clocked column number `clocked`: 0 for null, else 1.
    pub(super) fn levels(&self, clocked: usize) -> Vec<i16> {
        let flags = self.present.iter().skip(clocked).step_by(self.clocked.max(1));
        flags.map(|present| i16::from(*present)).collect()
    }

    /// Iterates over the columns whose values are in `values`, an array of this block.
    pub(super) fn columns<'a, T>(&'a self, values: &'a [T]) -> impl Iterator<Item = &'a [T]> {
        values.chunks(self.room + PADDING).map(move |column| &column[..self.rows])
    }

    /// Returns the texts of the String column number `number`.
    pub(super) fn texts(&self, number: usize) -> Vec<ByteArray> {
        let text = |row| {
            let place = row * self.strings + number;
            let start = if place == 0 { 0 } else { self.ends[place - 1] };
            ByteArray::from(self.texts[start..self.ends[place]].to_vec())
        };
        (0..self.rows).map(text).collect()
    }
}
