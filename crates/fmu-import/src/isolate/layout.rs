//! What stands where in the shared memory.

use std::fs::File;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};

use super::region::Region;

/// Words between fields that different processes write: one or two lines of a cache.
const APART: usize = 16;
const TURN: usize = 0;
const MASTER_SLEEPS: usize = APART;
const WORKER_SLEEPS: usize = 2 * APART;
const COMMAND: usize = 3 * APART;
const PLACE: usize = 4 * APART;
const LOG_HEAD: usize = 5 * APART;
const LOG_DROPPED: usize = 5 * APART + 1;
const LOG_TAIL: usize = 6 * APART;
const MARK: usize = 7 * APART;
const ATTACHED: usize = 7 * APART + 1;
const NO_MEMORY: usize = 7 * APART + 2;
const AREA: usize = 8 * APART;

/// Words of the ring of messages: 256 KiB.
const RING: usize = 1 << 15;
/// Words for arguments and results beside those that depend on the FMU: 64 KiB.
const LEAST: usize = 1 << 13;
/// Words for each variable: `advance` with its derivatives of two orders needs 16 where each
/// variable is input and output.
const FOR_EACH: usize = 16;
/// What [`MARK`] holds: "fmu" and the version of this layout.
const MARKED: u64 = 0x666d_7500_0000_0002;

/// The shared memory by its parts.
pub(super) struct Shared {
    region: Region,
}

impl Shared {
    /// New memory for an FMU with that many variables, and the file behind it.
    pub(super) fn create(variables: usize) -> io::Result<(Self, File)> {
        let area = FOR_EACH.saturating_mul(variables).saturating_add(LEAST);
        let (region, file) = Region::create(area.saturating_add(AREA + RING))?;
        let shared = Self { region };
        shared.word(MARK).store(MARKED, Ordering::SeqCst);
        Ok((shared, file))
    }

    /// The memory that a master made.
    pub(super) fn attach(file: &File) -> io::Result<Self> {
        let shared = Self { region: Region::attach(file)? };
        let words = shared.region.words();
        if words.len() < AREA + LEAST + RING || words[MARK].load(Ordering::SeqCst) != MARKED {
            return Err(io::Error::other("it is no memory of this version of the program"));
        }
        Ok(shared)
    }

    #[inline]
    fn word(&self, position: usize) -> &AtomicU64 {
        &self.region.words()[position]
    }

    /// Counts the turns: odd when the worker is to act, even when the master is.
    #[inline]
    pub(super) fn turn(&self) -> &AtomicU64 {
        self.word(TURN)
    }

    /// Whether the master waits to be woken.
    #[inline]
    pub(super) fn master_sleeps(&self) -> &AtomicU64 {
        self.word(MASTER_SLEEPS)
    }

    /// Whether the worker waits to be woken.
    #[inline]
    pub(super) fn worker_sleeps(&self) -> &AtomicU64 {
        self.word(WORKER_SLEEPS)
    }

    /// What the worker is to do.
    #[inline]
    pub(super) fn command(&self) -> &AtomicU64 {
        self.word(COMMAND)
    }

    /// The function that the worker is in.
    #[inline]
    pub(super) fn place(&self) -> &AtomicU64 {
        self.word(PLACE)
    }

    /// Words of messages written so far.
    #[inline]
    pub(super) fn log_head(&self) -> &AtomicU64 {
        self.word(LOG_HEAD)
    }

    /// Words of messages read so far.
    #[inline]
    pub(super) fn log_tail(&self) -> &AtomicU64 {
        self.word(LOG_TAIL)
    }

    /// Messages for which there was no room.
    #[inline]
    pub(super) fn log_dropped(&self) -> &AtomicU64 {
        self.word(LOG_DROPPED)
    }

    /// Not 0 once a worker serves.
    pub(super) fn attached(&self) -> &AtomicU64 {
        self.word(ATTACHED)
    }

    /// Not 0 where the FMU crashed after an allocation had failed.
    pub(super) fn no_memory(&self) -> &AtomicU64 {
        self.word(NO_MEMORY)
    }

    /// Arguments, then results.
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
