//! The layout of the shared memory.

use std::fs::File;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};

use super::function::known_name;
use super::region::Region;
use super::words::{Reader, Writer};

/// Distance in words between fields that different processes write: one or two cache lines.
const SPACING: usize = 16;
const MAGIC: usize = 7 * SPACING;
/// The name of the C function that the worker calls: the number of its bytes, then the bytes.
const NAME: usize = MAGIC + 3;
const AREA: usize = 8 * SPACING;

/// Words of the ring of messages: 256 KiB.
const RING: usize = 1 << 15;
/// Minimum number of words for arguments and results: 64 KiB.
const MIN_AREA: usize = 1 << 13;
/// Words for arguments and results per variable. A step needs 2 + 3 n words for an input with derivatives of n orders
/// and 1 + 2 n for an output. 16 words are enough for 4 orders, because no variable is both.
const WORDS_PER_VARIABLE: usize = 16;
/// The content of [`MAGIC`]: "fmu" and the version of this layout.
const MAGIC_NUMBER: u64 = 0x666d_7500_0000_0004;

/// Defines a method for each field, a word at a position.
macro_rules! fields {
    ($($(#[$doc:meta])* $field:ident = $position:expr;)*) => {
        impl Shared {
            $($(#[$doc])*
            #[inline]
            pub(super) fn $field(&self) -> &AtomicU64 {
                self.word($position)
            })*
        }
    };
}

fields! {
    /// The turn counter: odd during the worker's turn, even during the master's turn.
    turn = 0;
    /// Not 0 while the master sleeps and must be woken.
    master_sleeps = SPACING;
    /// Not 0 while the worker sleeps and must be woken.
    worker_sleeps = 2 * SPACING;
    /// The command for the worker.
    command = 3 * SPACING;
    /// The number of the function that the worker executes: the command, or the present part of the command.
    place = 4 * SPACING;
    /// Number of words written to the message ring.
    log_head = 5 * SPACING;
    /// Number of messages dropped because the ring was full.
    log_dropped = 5 * SPACING + 1;
    /// Number of words read from the message ring.
    log_tail = 6 * SPACING;
    /// Not 0 once the worker is ready for commands.
    attached = MAGIC + 1;
    /// Not 0 if the FMU crashed after a failed allocation.
    no_memory = MAGIC + 2;
}

/// The shared memory, with access to its fields.
pub(super) struct Shared {
    region: Region,
}

impl Shared {
    /// Creates memory for an FMU with `variables` variables; returns the memory and its file, for the worker.
    pub(super) fn create(variables: usize) -> io::Result<(Self, File)> {
        let area = WORDS_PER_VARIABLE.saturating_mul(variables).saturating_add(MIN_AREA);
        let (region, file) = Region::create(area.saturating_add(AREA + RING))?;
        let shared = Self { region };
        shared.word(MAGIC).store(MAGIC_NUMBER, Ordering::SeqCst);
        Ok((shared, file))
    }

    /// Maps the memory that a master created.
    pub(super) fn attach(file: &File) -> io::Result<Self> {
        let shared = Self { region: Region::attach(file)? };
        let words = shared.region.words();
        if words.len() < AREA + MIN_AREA + RING
            || words[MAGIC].load(Ordering::SeqCst) != MAGIC_NUMBER
        {
            return Err(io::Error::other("another version of the program created the memory"));
        }
        Ok(shared)
    }

    #[inline]
    fn word(&self, position: usize) -> &AtomicU64 {
        &self.region.words()[position]
    }

    /// Stores the name of the C function that the worker calls; empty between two calls.
    pub(super) fn set_function(&self, name: &str) {
        Writer::new(&self.region.words()[NAME..AREA]).put_part(name.as_bytes());
    }

    /// Returns the name of the C function that the worker calls; `None` between two calls, and for unknown bytes.
    pub(super) fn function(&self) -> Option<&'static str> {
        let mut name = Vec::new();
        Reader::new(&self.region.words()[NAME..AREA]).take_bytes(&mut name)?;
        known_name(str::from_utf8(&name).ok()?)
    }

    /// The area for the arguments of a command, then for its results.
    #[inline]
    pub(super) fn area(&self) -> &[AtomicU64] {
        let words = self.region.words();
        &words[AREA..words.len() - RING]
    }

    /// The ring of messages.
    #[inline]
    pub(super) fn ring(&self) -> &[AtomicU64] {
        let words = self.region.words();
        &words[words.len() - RING..]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_function_that_the_worker_calls_has_its_name_until_it_returns() {
        let (shared, _) = Shared::create(1).unwrap();
        assert_eq!(shared.function(), None);
        for name in ["fmi2GetDerivatives", "fmi3GetEventIndicators", "unloading the library"] {
            shared.set_function(name);
            assert_eq!(shared.function(), Some(name));
        }
        shared.set_function("");
        assert_eq!(shared.function(), None);
        shared.word(NAME).store(u64::MAX, Ordering::Relaxed);
        assert_eq!(shared.function(), None, "a number of bytes beyond the memory");
    }
}
