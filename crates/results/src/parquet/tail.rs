//! The end of a Parquet file: its last row group and its footer, replaced so that the file is readable
//! at every instant, whenever the process is killed.
//!
//! The last eight bytes of a file are the length L of the footer and `PAR1`. A reader takes the L bytes before these
//! eight, decodes the metadata at their start, and ignores what follows the metadata. So one write of eight bytes, at a
//! multiple of eight, replaces one footer by another. A kill can cut a longer write between two pages of memory, but
//! not this one.
//!
//! A new tail behind the present one first gets its last eight bytes, with the L that leads to the present footer; then
//! all bytes before these eight; then its own L. A new tail that fits in front of the present one is written, and the
//! file is then cut behind it.

use super::{MAGIC, OutputFile, ResultsError};

/// Number of bytes of the footer length and [`MAGIC`] at the end of a file. Each tail ends at a multiple of `LINK`.
const LINK: usize = 8;

/// A file with a footer.
#[derive(Debug)]
pub(super) struct Tail {
    pub(super) file: OutputFile,
    /// Start of the present tail.
    start: u64,
    /// Start of the present footer.
    footer_start: u64,
    /// The present footer, including its last eight bytes.
    footer: Vec<u8>,
}

impl Tail {
    /// Writes the first footer of an empty file.
    pub(super) fn create(mut file: OutputFile, footer: Vec<u8>) -> Result<Self, ResultsError> {
        let start = MAGIC.len() as u64;
        file.append(MAGIC)?;
        let mut tail = Self { file, start, footer_start: start, footer: Vec::new() };
        if let Err(error) = tail.replace(start, &[], footer) {
            // Without a footer it is no Parquet file.
            tail.file.abandon();
            return Err(error);
        }
        Ok(tail)
    }

    /// Returns the start of the present tail. A new tail must end at or before it, or start at or behind the end of
    /// the file.
    pub(super) fn start(&self) -> u64 {
        self.start
    }

    /// Removes the first `size` bytes, which are a full row group now, from the tail; they stay in the file.
    pub(super) fn detach_group(&mut self, size: u64) {
        self.start += size;
    }

    /// Moves the present footer, without a row group, to `offset`, at or behind the end of the file.
    pub(super) fn move_footer(&mut self, offset: u64) -> Result<(), ResultsError> {
        let footer = self.footer.clone();
        self.replace(offset, &[], footer)
    }

    /// Replaces the present tail by the row group `group` at `offset` and `footer`. After a failure the present tail
    /// remains.
    pub(super) fn replace(
        &mut self,
        offset: u64,
        group: &[u8],
        footer: Vec<u8>,
    ) -> Result<(), ResultsError> {
        let length = self.file.length();
        let content = offset + (group.len() + footer.len()) as u64;
        let end = content.next_multiple_of(LINK as u64);
        let footer_start = end - footer.len() as u64;
        let written = self.write(offset, group, footer_start, &footer);
        if let Err(error) = written.and_then(|()| self.file.set_length(end)) {
            let _ = self.file.set_length(length);
            return Err(error);
        }
        (self.start, self.footer_start, self.footer) = (offset, footer_start, footer);
        Ok(())
    }

    /// Writes the row group at `offset` and the footer at `start`, so that the file is readable after each call of
    /// the operating system.
    fn write(
        &mut self,
        offset: u64,
        group: &[u8],
        start: u64,
        footer: &[u8],
    ) -> Result<(), ResultsError> {
        let (metadata, link) = footer.split_at(footer.len() - LINK);
        let place = start + metadata.len() as u64;
        if place >= self.file.length()
            && let Ok(back) = u32::try_from(place - self.footer_start)
        {
            self.file.write_at(place, &[&back.to_le_bytes(), MAGIC].concat())?;
        }
        self.file.write_at(offset, group)?;
        self.file.write_at(start, metadata)?;
        self.file.write_at(place, link)
    }
}
