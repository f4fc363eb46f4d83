//! The identity of a file, independent of its path.

use std::fs::Metadata;

/// Device and number of a file.
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

    /// The same for all files: while the file is open, nobody can delete or replace it.
    #[cfg(not(unix))]
    pub(super) fn new(_: &Metadata) -> Self {
        Self { device: 0, inode: 0 }
    }
}
