//! The identity of a file, independent of its path.

use std::fs::Metadata;

/// Device and inode of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Identity {
    pub(super) device: u64,
    pub(super) inode: u64,
}

impl Identity {
    #[cfg(unix)]
    pub(super) fn new(metadata: &Metadata) -> Self {
        use std::os::unix::fs::MetadataExt as _;
        Self { device: metadata.dev(), inode: metadata.ino() }
    }

    /// Returns the same identity for all files: nobody can delete or replace an open file.
    #[cfg(not(unix))]
    pub(super) fn new(_: &Metadata) -> Self {
        Self { device: 0, inode: 0 }
    }
}
