//! The examples of docs/reference/scenario.md.

use super::{Document, scenario, setup, system};

/// Returns the code blocks of the document that are files.
fn blocks() -> Vec<String> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/scenario.md");
    let text = std::fs::read_to_string(path).unwrap();
    let parts = text.split("```toml\n").skip(1);
    parts.map(|part| part.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn every_example_of_the_document_is_read_and_fits_its_system() {
    let folder = tempfile::tempdir().unwrap();
    let csv = "time,force,plant.force,F\n0,0,0,1\n1,2,0,1\n";
    std::fs::write(folder.path().join("inputs.csv"), csv).unwrap();
    let blocks = blocks();
    assert!(blocks.len() > 15, "{}", blocks.len());
    for block in blocks {
        let actual = scenario(&block).resolve(&system().0, &setup(folder.path()));
        assert!(actual.is_ok(), "{block}\n{}", actual.err().unwrap());
    }
}

#[test]
fn a_scenario_written_out_and_read_again_is_the_same() {
    let text = blocks().concat();
    let first = scenario(&text);
    let written = toml::to_string(&Document { scenario: first.clone() }).unwrap();
    assert_eq!(scenario(&written), first, "{written}");
    for kind in ["bias", "gain", "drift", "stuck", "dropout", "delay", "quantisation", "noise"] {
        assert!(written.contains(kind), "{kind} is missing in {written}");
    }
}
