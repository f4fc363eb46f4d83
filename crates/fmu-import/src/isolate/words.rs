//! Encodes values as words of the shared memory. The other process may have written anything, so the
//! reader loads each word once and checks it.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes in a word.
const BYTES: usize = 8;

/// A type that is encoded in one word.
pub(super) trait Word: Copy {
    fn to_word(self) -> u64;
    /// Decodes a word; `None` if it is not a value of this type.
    fn from_word(word: u64) -> Option<Self>;
}

impl Word for u64 {
    fn to_word(self) -> u64 {
        self
    }

    fn from_word(word: u64) -> Option<Self> {
        Some(word)
    }
}

impl Word for f64 {
    fn to_word(self) -> u64 {
        self.to_bits()
    }

    fn from_word(word: u64) -> Option<Self> {
        Some(f64::from_bits(word))
    }
}

impl Word for u32 {
    fn to_word(self) -> u64 {
        self.into()
    }

    fn from_word(word: u64) -> Option<Self> {
        word.try_into().ok()
    }
}

impl Word for i32 {
    fn to_word(self) -> u64 {
        i64::from(self).cast_unsigned()
    }

    fn from_word(word: u64) -> Option<Self> {
        word.cast_signed().try_into().ok()
    }
}

impl Word for usize {
    fn to_word(self) -> u64 {
        self as u64
    }

    fn from_word(word: u64) -> Option<Self> {
        word.try_into().ok()
    }
}

impl Word for bool {
    fn to_word(self) -> u64 {
        self.into()
    }

    fn from_word(word: u64) -> Option<Self> {
        (word <= 1).then_some(word == 1)
    }
}

/// Writes values to an area from its start. Values that do not fit are not written.
pub(super) struct Writer<'a> {
    words: &'a [AtomicU64],
    at: usize,
}

impl<'a> Writer<'a> {
    pub(super) fn new(words: &'a [AtomicU64]) -> Self {
        Self { words, at: 0 }
    }

    /// Returns whether all values fitted.
    pub(super) fn fits(&self) -> bool {
        self.at <= self.words.len()
    }

    /// Returns the number of free words.
    pub(super) fn room(&self) -> usize {
        self.words.len().saturating_sub(self.at)
    }

    #[inline]
    pub(super) fn put<T: Word>(&mut self, value: T) {
        if let Some(word) = self.words.get(self.at) {
            word.store(value.to_word(), Ordering::Relaxed);
        }
        self.at = self.at.saturating_add(1);
    }

    /// Writes the values without their number.
    #[inline]
    pub(super) fn put_all<T: Word>(&mut self, values: &[T]) {
        let end = self.at.saturating_add(values.len());
        if let Some(words) = self.words.get(self.at..end) {
            for (word, value) in words.iter().zip(values) {
                word.store(value.to_word(), Ordering::Relaxed);
            }
        }
        self.at = end;
    }

    /// Writes the number of values and the values.
    #[inline]
    pub(super) fn put_list<T: Word>(&mut self, values: &[T]) {
        self.put(values.len());
        self.put_all(values);
    }

    /// Writes the number of bytes and the bytes.
    pub(super) fn put_bytes(&mut self, bytes: &[u8]) {
        self.put(bytes.len());
        for chunk in bytes.chunks(BYTES) {
            let mut word = [0; BYTES];
            word[..chunk.len()].copy_from_slice(chunk);
            self.put(u64::from_le_bytes(word));
        }
    }
}

/// Reads values from an area from its start. All methods return `None` if the area ends or a word is
/// invalid.
pub(super) struct Reader<'a> {
    words: &'a [AtomicU64],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(words: &'a [AtomicU64]) -> Self {
        Self { words, at: 0 }
    }

    /// Returns the next `count` words.
    #[inline]
    fn next(&mut self, count: usize) -> Option<&'a [AtomicU64]> {
        let end = self.at.checked_add(count)?;
        let words = self.words.get(self.at..end)?;
        self.at = end;
        Some(words)
    }

    #[inline]
    pub(super) fn take<T: Word>(&mut self) -> Option<T> {
        let word = self.next(1)?.first()?;
        T::from_word(word.load(Ordering::Relaxed))
    }

    /// Fills `values`.
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
        let count = self.take()?;
        self.take_counted(count, values)
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
        let mut left: usize = self.take()?;
        for word in self.next(left.div_ceil(BYTES))? {
            let word = word.load(Ordering::Relaxed).to_le_bytes();
            let used = left.min(BYTES);
            bytes.extend_from_slice(&word[..used]);
            left -= used;
        }
        Some(())
    }

    /// Reads a text; invalid UTF-8 is replaced.
    pub(super) fn take_text(&mut self) -> Option<String> {
        let mut bytes = Vec::new();
        self.take_bytes(&mut bytes)?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
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
        writer.put_bytes("grün, nine+".as_bytes());
        writer.put(true);
        assert!(writer.fits());
        let mut reader = Reader::new(&area);
        assert_eq!(reader.take::<i32>(), Some(-7));
        let mut values = vec![9.0];
        reader.take_list(&mut values).unwrap();
        assert_eq!(values, [1.5, 0.0, f64::INFINITY]);
        assert!(values[1].is_sign_negative());
        assert_eq!(reader.take_text().as_deref(), Some("grün, nine+"));
        assert_eq!(reader.take::<bool>(), Some(true));
    }

    #[test]
    fn what_does_not_fit_is_not_written() {
        let area = area(3);
        let mut writer = Writer::new(&area);
        writer.put_list(&[1_u32, 2, 3]);
        assert!(!writer.fits());
        writer.put_bytes(&[255; 100]);
        assert_eq!(writer.room(), 0);
        assert!(area[1..].iter().all(|word| word.load(Ordering::Relaxed) == 0));
    }

    #[test]
    fn counts_beyond_the_memory_are_refused() {
        let area = area(4);
        for count in [4, 5, u64::MAX, u64::MAX / 8, 1 << 63] {
            area[0].store(count, Ordering::Relaxed);
            assert_eq!(Reader::new(&area).take_list(&mut Vec::<f64>::new()), None, "{count}");
            if count > 24 {
                assert_eq!(Reader::new(&area).take_text(), None, "{count}");
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
        assert_eq!(Reader::new(&area).take::<bool>(), None);
    }
}
