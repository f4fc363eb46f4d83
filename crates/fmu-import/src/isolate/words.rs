//! Encodes the values of a step as words of the shared memory, without allocation; `postcard` would decode them into
//! new vectors in every step. All other messages are bytes, which are packed into words here.
//!
//! The FMU may have overwritten the shared memory, so the reader loads each word once and checks it.

use std::sync::atomic::{AtomicU64, Ordering};

/// Number of bytes in a word.
const BYTES: usize = 8;

/// A type that is encoded in one word.
pub(super) trait Word: Copy {
    fn to_word(self) -> u64;
    /// Decodes a word; `None` if it is not a value of this type.
    fn from_word(word: u64) -> Option<Self>;
}

macro_rules! words {
    ($($type:ty: $value:ident => $to_word:expr, $word:ident => $from_word:expr;)*) => {
        $(impl Word for $type {
            fn to_word(self) -> u64 {
                let $value = self;
                $to_word
            }

            fn from_word($word: u64) -> Option<Self> {
                $from_word
            }
        })*
    };
}

words! {
    u64: value => value, word => Some(word);
    f64: value => value.to_bits(), word => Some(f64::from_bits(word));
    u32: value => value.into(), word => word.try_into().ok();
    i64: value => value.cast_unsigned(), word => Some(word.cast_signed());
    i32: value => i64::from(value).cast_unsigned(), word => word.cast_signed().try_into().ok();
}

/// Returns the words that hold `bytes`; the last one is filled with zeros.
pub(super) fn words_of(bytes: &[u8]) -> impl Iterator<Item = u64> {
    bytes.chunks(BYTES).map(|chunk| {
        let mut word = [0; BYTES];
        word[..chunk.len()].copy_from_slice(chunk);
        u64::from_le_bytes(word)
    })
}

/// Writes values to an area from its start. Values that do not fit are dropped.
pub(super) struct Writer<'a> {
    words: &'a [AtomicU64],
    position: usize,
}

impl<'a> Writer<'a> {
    pub(super) fn new(words: &'a [AtomicU64]) -> Self {
        Self { words, position: 0 }
    }

    /// Returns whether all values fitted.
    pub(super) fn fits(&self) -> bool {
        self.position <= self.words.len()
    }

    #[inline]
    pub(super) fn put<T: Word>(&mut self, value: T) {
        if let Some(word) = self.words.get(self.position) {
            word.store(value.to_word(), Ordering::Relaxed);
        }
        self.position = self.position.saturating_add(1);
    }

    /// Writes the values without their number; writes nothing if not all fit.
    #[inline]
    pub(super) fn put_all<T: Word>(&mut self, values: &[T]) {
        let end = self.position.saturating_add(values.len());
        if let Some(words) = self.words.get(self.position..end) {
            for (word, value) in words.iter().zip(values) {
                word.store(value.to_word(), Ordering::Relaxed);
            }
        }
        self.position = end;
    }

    /// Writes the number of values and the values.
    #[inline]
    pub(super) fn put_list<T: Word>(&mut self, values: &[T]) {
        self.put(values.len() as u64);
        self.put_all(values);
    }

    /// Writes as many of `bytes` as fit, after their number.
    pub(super) fn put_part(&mut self, bytes: &[u8]) {
        let room = self.words.len().saturating_sub(self.position).saturating_sub(1);
        let part = &bytes[..bytes.len().min(BYTES * room)];
        self.put(part.len() as u64);
        words_of(part).for_each(|word| self.put(word));
    }
}

/// Reads values from an area from its start. All methods return `None` if the area is too short or a word is invalid.
pub(super) struct Reader<'a> {
    words: &'a [AtomicU64],
    position: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(words: &'a [AtomicU64]) -> Self {
        Self { words, position: 0 }
    }

    /// Returns the next `count` words.
    #[inline]
    fn next(&mut self, count: usize) -> Option<&'a [AtomicU64]> {
        let end = self.position.checked_add(count)?;
        let words = self.words.get(self.position..end)?;
        self.position = end;
        Some(words)
    }

    #[inline]
    pub(super) fn take<T: Word>(&mut self) -> Option<T> {
        let word = self.next(1)?.first()?;
        T::from_word(word.load(Ordering::Relaxed))
    }

    /// Reads as many values as `values` has, without their number.
    #[inline]
    pub(super) fn take_all<T: Word>(&mut self, values: &mut [T]) -> Option<()> {
        let words = self.next(values.len())?;
        for (value, word) in values.iter_mut().zip(words) {
            *value = T::from_word(word.load(Ordering::Relaxed))?;
        }
        Some(())
    }

    /// Reads a number, then that many values, and replaces the content of `values`.
    #[inline]
    pub(super) fn take_list<T: Word>(&mut self, values: &mut Vec<T>) -> Option<()> {
        let count: u64 = self.take()?;
        self.take_counted(count.try_into().ok()?, values)
    }

    /// Reads `count` values and replaces the content of `values`.
    #[inline]
    pub(super) fn take_counted<T: Word>(
        &mut self,
        count: usize,
        values: &mut Vec<T>,
    ) -> Option<()> {
        let words = self.next(count)?;
        values.clear();
        for word in words {
            values.push(T::from_word(word.load(Ordering::Relaxed))?);
        }
        Some(())
    }

    /// Reads a number, then that many bytes, and appends them to `bytes`.
    pub(super) fn take_bytes(&mut self, bytes: &mut Vec<u8>) -> Option<()> {
        let count = usize::try_from(self.take::<u64>()?).ok()?;
        let words = self.next(count.div_ceil(BYTES))?;
        let end = bytes.len() + count;
        bytes.extend(words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()));
        bytes.truncate(end);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(words: usize) -> Vec<AtomicU64> {
        (0..words).map(|_| AtomicU64::new(0)).collect()
    }

    #[test]
    fn what_is_written_is_read() {
        let area = area(32);
        let mut writer = Writer::new(&area);
        writer.put(-7_i32);
        writer.put_list(&[1.5, -0.0, f64::INFINITY]);
        writer.put_part(b"nine byte");
        assert!(writer.fits());
        let mut reader = Reader::new(&area);
        assert_eq!(reader.take::<i32>(), Some(-7));
        let mut values = vec![9.0];
        reader.take_list(&mut values).unwrap();
        assert_eq!(values, [1.5, 0.0, f64::INFINITY]);
        assert!(values[1].is_sign_negative());
        let mut bytes = b"and ".to_vec();
        reader.take_bytes(&mut bytes).unwrap();
        assert_eq!(bytes, b"and nine byte");
    }

    #[test]
    fn values_that_do_not_fit_are_not_written_and_bytes_are_written_in_part() {
        let few = area(3);
        let mut writer = Writer::new(&few);
        writer.put_list(&[1_u32, 2, 3]);
        assert!(!writer.fits());
        writer.put_part(&[255; 100]);
        assert!(few[1..].iter().all(|word| word.load(Ordering::Relaxed) == 0));
        let few = area(3);
        Writer::new(&few).put_part(&[1; 18]);
        let mut bytes = Vec::new();
        Reader::new(&few).take_bytes(&mut bytes).unwrap();
        assert_eq!(bytes, [1; 16]);
    }

    #[test]
    fn counts_beyond_the_memory_are_refused() {
        let area = area(4);
        for count in [4, 5, u64::MAX, u64::MAX / 8, 1 << 63] {
            area[0].store(count, Ordering::Relaxed);
            assert_eq!(Reader::new(&area).take_list(&mut Vec::<f64>::new()), None, "{count}");
            if count > 24 {
                assert_eq!(Reader::new(&area).take_bytes(&mut Vec::new()), None, "{count}");
            }
        }
        assert_eq!(Reader::new(&area).take_all(&mut [0.0; 5]), None);
    }

    #[test]
    fn words_that_are_no_value_of_their_type_are_refused() {
        let area = area(1);
        area[0].store(1 << 40, Ordering::Relaxed);
        assert_eq!(Reader::new(&area).take::<u32>(), None);
        assert_eq!(Reader::new(&area).take::<i32>(), None);
    }
}
