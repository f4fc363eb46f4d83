//! Random changes of the corpora of the fuzz targets, the same in every run. Other crates compile
//! this file into their tests.

use std::time::{Duration, Instant};

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::TestRunner;

use crate::corpus;

/// A change: its kind, its place, and two numbers.
pub type Change = (u8, u32, u32, u8);

/// Numbers at limits, which are inserted besides single bytes and words of the format.
const NUMBERS: [&[u8]; 8] = [
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"NaN",
    b"INF",
    b"1e999",
    b"4294967296",
    b"-1",
];
/// Time limit for one small file: far more than any target needs on a busy machine.
const LONGEST: Duration = Duration::from_secs(20);

pub fn changed(data: &[u8], words: &[&[u8]], changes: &[Change]) -> Vec<u8> {
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
                let number = usize::from(*byte) % (NUMBERS.len() + words.len());
                let word = NUMBERS.iter().chain(words).nth(number).unwrap();
                bytes.splice(at..at, word.iter().copied());
            }
        }
    }
    bytes
}

/// Passes `count` changed files of a corpus to a target; `words` are typical words of its format.
pub fn mutate(name: &str, words: &[&[u8]], target: fn(&[u8]), count: usize) {
    let files: Vec<_> =
        corpus::files(name).iter().map(|file| std::fs::read(file).unwrap()).collect();
    let mut runner = TestRunner::deterministic();
    let strategy = vec((0..7_u8, any::<u32>(), any::<u32>(), any::<u8>()), 1..6);
    for number in 0..count {
        let changes = strategy.new_tree(&mut runner).unwrap().current();
        let bytes = changed(&files[number % files.len()], words, &changes);
        let begin = Instant::now();
        let outcome = std::panic::catch_unwind(|| target(&bytes));
        let text = String::from_utf8_lossy(&bytes);
        assert!(outcome.is_ok(), "{name} {number}: {:?}\n{text:?}", outcome.err());
        assert!(begin.elapsed() < LONGEST, "{name} {number}: {:?}\n{text:?}", begin.elapsed());
    }
}
