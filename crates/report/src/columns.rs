//! The numbers of a page, as compressed columns; equal columns are stored once.

use std::collections::HashMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::compress_to_vec_zlib;
use serde::Serialize;

/// Level of the compression, from 0 to 10.
const LEVEL: u8 = 6;

/// The columns of a page, by number. Equal columns, such as columns of connected variables, have the same number.
#[derive(Default, Serialize)]
#[serde(transparent)]
pub(crate) struct Columns {
    list: Vec<Column>,
    #[serde(skip)]
    numbers: HashMap<String, usize>,
}

/// A column of numbers.
#[derive(Serialize)]
#[serde(untagged)]
enum Column {
    /// The value of all rows; `null` is NaN.
    Constant { constant: Option<f64> },
    /// The numbers in double precision, little endian: all first bytes, then all second bytes and so on, because
    /// neighbouring numbers have most bytes in common; compressed (zlib), in base64.
    Block { block: String },
}

impl Columns {
    /// Adds a column, unless there is an equal one; returns its number.
    pub(crate) fn add(&mut self, values: &[f64]) -> usize {
        let (key, column) = if let Some(value) = constant(values) {
            let constant = Some(value).filter(|value| !value.is_nan());
            (format!("{value:?}"), Column::Constant { constant })
        } else {
            let block = STANDARD.encode(compress_to_vec_zlib(&planes(values), LEVEL));
            (block.clone(), Column::Block { block })
        };
        *self.numbers.entry(key).or_insert_with(|| {
            self.list.push(column);
            self.list.len() - 1
        })
    }
}

/// Returns the value of all rows, NaN without rows; `None` if rows differ, and for infinity, which JSON cannot express.
fn constant(values: &[f64]) -> Option<f64> {
    let first = values.first().copied().unwrap_or(f64::NAN);
    let same = values
        .iter()
        .all(|value| value.to_bits() == first.to_bits() || value.is_nan() && first.is_nan());
    (same && !first.is_infinite()).then_some(first)
}

/// Returns all first bytes of the numbers, then all second bytes and so on.
fn planes(values: &[f64]) -> Vec<u8> {
    let bytes: Vec<[u8; 8]> = values.iter().map(|value| value.to_le_bytes()).collect();
    (0..8).flat_map(|plane| bytes.iter().map(move |bytes| bytes[plane])).collect()
}
