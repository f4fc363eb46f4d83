//! The corpora of the fuzz targets, once more.

use std::path::Path;

use crate::targets;

/// Gives each file of a corpus to its target.
fn replay(name: &str, target: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(name);
    let files: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
    assert!(!files.is_empty());
    for file in files {
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

#[test]
#[cfg_attr(miri, ignore = "reads files")]
fn call_sequences_of_the_corpus_are_answered_as_the_standard_says() {
    replay("call_sequence", targets::call_sequence);
}
