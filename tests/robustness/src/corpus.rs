//! Passes the corpora of the fuzz targets unchanged to the targets. Other crates compile this file
//! into their tests.

use std::path::{Path, PathBuf};

/// The files of a corpus.
pub fn files(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(name);
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let mut files: Vec<_> = files.collect();
    assert!(!files.is_empty());
    files.sort();
    files
}

/// Passes each file of a corpus to its target.
pub fn replay(name: &str, target: fn(&[u8])) {
    for file in files(name) {
        let outcome = std::panic::catch_unwind(|| target(&std::fs::read(&file).unwrap()));
        assert!(outcome.is_ok(), "{}: {:?}", file.display(), outcome.err());
    }
}
