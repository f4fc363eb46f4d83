//! Replays the corpora of the fuzz targets.

use robustness::corpus::replay;
use robustness::exporter as targets;

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
fn archives_of_the_corpus_do_no_harm() {
    replay("package", targets::package);
}

#[test]
#[cfg_attr(miri, ignore = "reads files")]
fn call_sequences_of_the_corpus_are_answered_as_the_standard_says() {
    replay("call_sequence", targets::call_sequence);
}
