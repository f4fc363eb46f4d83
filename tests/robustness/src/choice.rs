//! Arguments chosen by bytes; zero always gives a harmless choice.

use std::ffi::CString;

use crate::array::{Array, Shape, Text};

/// The bytes that determine one call.
pub struct Choice<'a> {
    bytes: std::slice::Iter<'a, u8>,
    /// Whether arguments that the standard forbids may be chosen.
    pub hostile: bool,
}

impl<'a> Choice<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes: bytes.iter(), hostile: true }
    }

    pub fn byte(&mut self) -> u8 {
        self.bytes.next().copied().unwrap_or(0)
    }

    pub fn of<T: Clone>(&mut self, from: &[T]) -> T {
        from[usize::from(self.byte()) % from.len()].clone()
    }

    /// Chooses one of `fine`, or of `odd` if hostile arguments are allowed.
    pub fn either<T: Clone>(&mut self, fine: &[T], odd: &[T]) -> T {
        if self.rarely() { self.of(odd) } else { self.of(fine) }
    }

    /// True for one byte of eight, if hostile arguments are allowed.
    pub fn rarely(&mut self) -> bool {
        self.byte() >= 224 && self.hostile
    }

    pub fn shape(&mut self) -> Shape {
        match self.byte() {
            _ if !self.hostile => Shape::Right,
            0..=231 => Shape::Right,
            232..=239 => Shape::Null,
            240..=247 => Shape::Misaligned,
            248..=255 => Shape::Huge,
        }
    }

    /// An array of `count` items.
    pub fn array<T>(&mut self, count: usize, mut item: impl FnMut(&mut Self) -> T) -> Array<T> {
        let shape = self.shape();
        Array { items: (0..count).map(|_| item(self)).collect(), shape }
    }

    /// Chooses an array of one element for a function that writes to it; `before` is its content.
    pub fn place<T: Clone>(&mut self, before: T) -> Array<T> {
        let shape = match self.shape() {
            Shape::Huge => Shape::Right,
            shape => shape,
        };
        Array { items: vec![before], shape }
    }

    /// Chooses the length of arrays.
    pub fn count(&mut self) -> usize {
        self.of(&[1, 2, 3, 1, 0])
    }

    /// Chooses a value reference below `count` that `fits`, or any other.
    pub fn reference(&mut self, count: u32, fits: impl Fn(u32) -> bool) -> u32 {
        let fine: Vec<_> = (0..count).filter(|place| fits(*place)).collect();
        let odd: Vec<_> = (0..count).chain([count, 1 << 31, u32::MAX]).collect();
        if fine.is_empty() { self.of(&odd) } else { self.either(&fine, &odd) }
    }

    pub fn real(&mut self) -> f64 {
        const ODD: [f64; 8] =
            [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1e300, 5e-324, 11.0, -11.0];
        let fine = f64::from(self.byte() % 16) - 4.0;
        self.either(&[fine], &ODD)
    }

    pub fn text(&mut self) -> Text {
        let bytes = match self.byte() {
            byte @ 0..=199 => vec![b'a' + byte % 26; usize::from(byte % 5)],
            200..=227 => "100 %s%n #1 ä".into(),
            228..=243 => vec![b'x'; 5000],
            244..=249 if self.hostile => vec![0xff, 0xfe],
            250..=255 if self.hostile => return None,
            _ => Vec::new(),
        };
        CString::new(bytes).ok()
    }
}

/// The status that an array requires: an error, unless it is usable or empty.
pub fn usable<T>(array: &Array<T>) -> bool {
    match array.shape {
        Shape::Right => true,
        Shape::Null | Shape::Misaligned => array.items.is_empty(),
        Shape::Huge => false,
    }
}
