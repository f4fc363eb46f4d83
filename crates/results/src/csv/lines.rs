//! A buffer of CSV lines, written cell by cell.

use super::{Column, ColumnKind};

/// Largest length of a Real and of an Integer: -1.7976931348623157e+308, -9223372036854775808.
const REAL: usize = 24;
const INTEGER: usize = 20;

/// A buffer with room for the next row, so that cells need no check of the capacity.
///
/// A cell is copied by two moves of fixed length that may overlap, because a copy of variable length
/// takes as long as formatting a number.
#[derive(Debug)]
pub(super) struct Lines {
    bytes: Vec<u8>,
    used: usize,
    /// Largest length in bytes of a row without its texts.
    row: usize,
}

impl Lines {
    pub(super) fn new(columns: &[Column], room: usize) -> Self {
        let width = |column: &Column| match column.kind {
            ColumnKind::Real => REAL,
            ColumnKind::Integer | ColumnKind::Long => INTEGER,
            ColumnKind::Boolean => 1,
            ColumnKind::String => 0,
        };
        let row = REAL + columns.iter().map(|column| 1 + width(column)).sum::<usize>() + 1;
        Self { bytes: vec![0; room + row], used: 0, row }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[..self.used]
    }

    pub(super) fn clear(&mut self) {
        self.used = 0;
    }

    /// Reserves memory for a line with the given texts.
    pub(super) fn begin<'a>(&mut self, texts: impl Iterator<Item = &'a str>) {
        let texts: usize = texts.map(|text| 2 * text.len() + 3).sum();
        let room = self.row + texts;
        if self.bytes.len() - self.used < room {
            self.bytes.resize(self.used + room, 0);
        }
    }

    pub(super) fn push(&mut self, letter: u8) {
        self.bytes[self.used] = letter;
        self.used += 1;
    }

    /// Writes the shortest decimal that reads back as the same bits, always with a point or an exponent,
    /// so that no reader infers the type integer from the first rows.
    pub(super) fn real(&mut self, value: f64) {
        if value.is_finite() {
            self.cell(zmij::Buffer::new().format_finite(value));
        } else if value.is_nan() {
            self.cell("NaN");
        } else {
            self.cell(if value > 0.0 { "inf" } else { "-inf" });
        }
    }

    pub(super) fn integer(&mut self, value: i64) {
        self.cell(itoa::Buffer::new().format(value));
    }

    fn cell(&mut self, text: &str) {
        let (text, count) = (text.as_bytes(), text.len());
        let place = &mut self.bytes[self.used..self.used + count];
        self.used += count;
        match count {
            16..=32 => {
                place[..16].copy_from_slice(&text[..16]);
                place[count - 16..].copy_from_slice(&text[count - 16..]);
            }
            8..16 => {
                place[..8].copy_from_slice(&text[..8]);
                place[count - 8..].copy_from_slice(&text[count - 8..]);
            }
            _ => place.copy_from_slice(text),
        }
    }

    /// Writes a text in quotation marks and doubles the quotation marks inside.
    pub(super) fn quote(&mut self, text: &str) {
        self.push(b'"');
        for (place, part) in text.split('"').enumerate() {
            if place > 0 {
                self.push(b'"');
                self.push(b'"');
            }
            self.bytes[self.used..self.used + part.len()].copy_from_slice(part.as_bytes());
            self.used += part.len();
        }
        self.push(b'"');
    }
}
