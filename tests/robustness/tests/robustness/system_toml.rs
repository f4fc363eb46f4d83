//! No `system.toml` does any harm, whatever its content.

use robustness::system_toml::system_toml;
use robustness::{changes, corpus};

/// Typical words of TOML and of this file.
const WORDS: [&[u8]; 22] = [
    b"[",
    b"]",
    b"[[",
    b"]]",
    b"{",
    b"}",
    b"=",
    b".",
    b"\"",
    b"'''",
    b"\n",
    b"\\u0000",
    b"nan",
    b"-inf",
    b"1979-05-27T07:32:00Z",
    b"\n[settings]\n",
    b"\n[[scenario.signal]]\nvariable = 'a.u'\n",
    b"\n[[scenario.fault]]\nconnection = 'a.u'\n",
    b"\nsine = { amplitude = 1, frequency = 2 }\n",
    b"\nsteps = [[0, false], [4, true]]\n",
    b"\nevery = 'never'\n",
    b"\nfile = 'x'\n",
];

#[test]
fn the_corpus_of_the_fuzz_target_does_no_harm() {
    corpus::replay("system_toml", system_toml);
}

#[test]
fn changed_files_do_no_harm() {
    changes::mutate("system_toml", &WORDS, system_toml, 5000);
}
