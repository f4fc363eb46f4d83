//! The corpora of the fuzz targets, once more.

use std::path::{Path, PathBuf};

use crate::targets;

/// The files of a corpus.
pub(crate) fn corpus(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(name);
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let mut files: Vec<_> = files.collect();
    assert!(!files.is_empty());
    files.sort();
    files
}

/// Gives each file of a corpus to its target.
fn replay(name: &str, target: fn(&[u8])) {
    for file in corpus(name) {
        let outcome = std::panic::catch_unwind(|| target(&std::fs::read(&file).unwrap()));
        assert!(outcome.is_ok(), "{}: {:?}", file.display(), outcome.err());
    }
}

#[test]
#[cfg_attr(miri, ignore = "reads files")]
fn serialized_states_of_the_corpus_do_no_harm() {
    replay("serialized_state", targets::serialized_state);
}

#[test]
#[cfg_attr(miri, ignore = "reads files")]
fn resource_locations_of_the_corpus_do_no_harm() {
    replay("resource_location", targets::resource_location);
}

#[test]
#[cfg_attr(miri, ignore = "reads files")]
fn model_descriptions_of_the_corpus_do_no_harm() {
    replay("model_description", targets::model_description);
}

#[cfg(feature = "package")]
#[test]
fn archives_of_the_corpus_do_no_harm() {
    replay("package", targets::package);
}

#[test]
#[cfg_attr(miri, ignore = "reads files")]
fn call_sequences_of_the_corpus_are_answered_as_the_standard_says() {
    replay("call_sequence", targets::call_sequence);
}
