//! The shared memory of master and worker: 64-bit words, every access atomic.
#![expect(unsafe_code, reason = "a mapping becomes a slice of atomics")]

use std::fs::File;
use std::io;
use std::sync::atomic::AtomicU64;

use memmap2::{MmapOptions, MmapRaw};
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, fcntl_get_seals, memfd_create};

/// Number of bytes of a word.
const WORD: usize = size_of::<AtomicU64>();

/// A mapping of an anonymous file with sealed length (`memfd`).
pub(super) struct Region {
    map: MmapRaw,
}

impl Region {
    /// Creates memory of `words` zeros; returns the memory and the file through which another process maps this memory.
    pub(super) fn create(words: usize) -> io::Result<(Self, File)> {
        let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
        let file = File::from(memfd_create("fmu", flags)?);
        let bytes = words.checked_mul(WORD).and_then(|bytes| u64::try_from(bytes).ok());
        file.set_len(bytes.ok_or(io::ErrorKind::OutOfMemory)?)?;
        fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
        Ok((Self::map(&file)?, file))
    }

    /// Maps the memory behind `file`, which [`Region::create`] created in another process.
    pub(super) fn attach(file: &File) -> io::Result<Self> {
        let sealed = fcntl_get_seals(file)?;
        if !sealed.contains(SealFlags::SHRINK) {
            return Err(io::Error::other("the length of the shared file is not sealed"));
        }
        Self::map(file)
    }

    fn map(file: &File) -> io::Result<Self> {
        Ok(Self { map: MmapOptions::new().map_raw(file)? })
    }

    #[inline]
    pub(super) fn words(&self) -> &[AtomicU64] {
        let length = self.map.len() / WORD;
        #[expect(clippy::cast_ptr_alignment, reason = "a mapping starts at a page")]
        let first = self.map.as_mut_ptr().cast::<AtomicU64>();
        // SAFETY: the mapping starts at a page, so it is aligned; it is `length` words long and lives
        // as long as `self`; its file is sealed, so no process can shrink it; every process accesses
        // it by atomics only, for which all bit patterns are valid.
        unsafe { std::slice::from_raw_parts(first, length) }
    }
}
