//! The fuzz targets for a short fixed count: the corpora, changed here and there, the same way in
//! every run. What it finds is found without a nightly toolchain.
#![cfg(not(miri))]

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

use crate::replay::corpus;
use crate::targets;

/// A change: what, where, and two numbers for it.
type Change = (u8, u32, u32, u8);

/// What is put in, besides single bytes: numbers at the edge, and what XML and ZIP live on.
const WORDS: [&[u8]; 24] = [
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"PK\x01\x02",
    b"PK\x03\x04",
    b"PK\x05\x06",
    b"../",
    b"/",
    b"<",
    b">",
    b"/>",
    b"\"",
    b"&#x0;",
    b"&amp;",
    b"<!DOCTYPE x [<!ENTITY a 'a'>]>",
    b"<!--",
    b"-->",
    b"NaN",
    b"INF",
    b"1e999",
    b"4294967296",
    b"-1",
    b" dependencies=\"1 2\"",
    b"<ScalarVariable name=\"x\" valueReference=\"0\"><Real/></ScalarVariable>",
];

fn changed(data: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    for (what, at, more, byte) in changes {
        let at = *at as usize % (bytes.len() + 1);
        let end = (at + *more as usize % 64).min(bytes.len());
        match what {
            0 if at < bytes.len() => bytes[at] = *byte,
            1 if at < bytes.len() => bytes[at] ^= 1 << (byte % 8),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let part = bytes[at..end].to_vec();
                bytes.splice(end..end, part);
            }
            _ => {
                let word = WORDS[usize::from(*byte) % WORDS.len()];
                bytes.splice(at..at, word.iter().copied());
            }
        }
    }
    bytes
}

/// Gives `count` changed files of a corpus to a target.
fn mutate(name: &str, target: fn(&[u8]), count: usize) {
    let files: Vec<_> = corpus(name).iter().map(|file| std::fs::read(file).unwrap()).collect();
    let mut runner = TestRunner::deterministic();
    let strategy = vec((0..7_u8, any::<u32>(), any::<u32>(), any::<u8>()), 1..6);
    for number in 0..count {
        let changes = strategy.new_tree(&mut runner).unwrap().current();
        let bytes = changed(&files[number % files.len()], &changes);
        let outcome = std::panic::catch_unwind(|| target(&bytes));
        let text = String::from_utf8_lossy(&bytes);
        assert!(outcome.is_ok(), "{name} {number}: {:?}\n{text:?}", outcome.err());
    }
}

#[test]
fn changed_model_descriptions_do_no_harm() {
    mutate("model_description", targets::model_description, 5000);
}

#[cfg(feature = "package")]
#[test]
fn changed_archives_do_no_harm() {
    mutate("package", targets::package, 3000);
}

#[test]
fn changed_resource_locations_do_no_harm() {
    mutate("resource_location", targets::resource_location, 5000);
}

#[test]
fn changed_serialized_states_do_no_harm() {
    mutate("serialized_state", targets::serialized_state, 1000);
}

#[test]
fn changed_call_sequences_are_answered_as_the_standard_says() {
    mutate("call_sequence", targets::call_sequence, 1000);
}

#[test]
fn a_change_is_made_where_it_says() {
    assert_eq!(changed(b"abcd", &[(0, 1, 0, b'X')]), b"aXcd");
    assert_eq!(changed(b"abcd", &[(2, 1, 2, 0)]), b"ad");
    assert_eq!(changed(b"abcd", &[(3, 2, 0, 0)]), b"ab");
    assert_eq!(changed(b"abcd", &[(4, 1, 2, 0)]), b"abcbcd");
    assert_eq!(changed(b"ab", &[(6, 2, 0, 7)]), b"ab/");
}
