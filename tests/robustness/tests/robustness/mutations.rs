//! Runs the fuzz targets for a short fixed count, without a nightly toolchain.
#![cfg(not(miri))]

use robustness::changes::{changed, mutate};
use robustness::exporter as targets;

/// Typical words of XML, ZIP and URIs.
const WORDS: [&[u8]; 16] = [
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
    b" dependencies=\"1 2\"",
    b"<ScalarVariable name=\"x\" valueReference=\"0\"><Real/></ScalarVariable>",
];

/// Words of the descriptions of FMI 3.0.
const WORDS_3: [&[u8]; 12] = [
    b"<Dimension start=\"3\"/>",
    b"<Dimension valueReference=\"1\"/>",
    b"<Dimension start=\"18446744073709551615\"/>",
    b"<Float32 name=\"f\" valueReference=\"1\" start=\"1 2 3\"/>",
    b"<UInt64 name=\"n\" valueReference=\"1\" causality=\"structuralParameter\" start=\"2\"/>",
    b"<Clock name=\"c\" valueReference=\"1\" intervalVariability=\"constant\" intervalDecimal=\"0.1\"/>",
    b"<Binary name=\"b\" valueReference=\"1\"><Start value=\"0f\"/></Binary>",
    b"<Alias name=\"a\" displayUnit=\"deg\"/>",
    b" clocks=\"1 2\"",
    b" start=\"1 2 3\"",
    b" derivative=\"1\"",
    b" fmiVersion=\"3.0\"",
];

#[test]
fn changed_model_descriptions_do_no_harm() {
    mutate("model_description", &WORDS, targets::model_description, 5000);
}

#[test]
fn changed_model_descriptions_of_fmi_3_do_no_harm() {
    mutate("model_description", &WORDS_3, targets::model_description, 5000);
}

#[test]
fn changed_archives_do_no_harm() {
    mutate("package", &WORDS, targets::package, 3000);
}

#[test]
fn changed_resource_locations_do_no_harm() {
    mutate("resource_location", &WORDS, targets::resource_location, 5000);
}

#[test]
fn changed_serialized_states_do_no_harm() {
    mutate("serialized_state", &WORDS, targets::serialized_state, 1000);
}

#[test]
fn changed_call_sequences_are_answered_as_the_standard_says() {
    mutate("call_sequence", &WORDS, targets::call_sequence, 1000);
}

#[test]
fn each_change_is_made_at_its_place() {
    assert_eq!(changed(b"abcd", &[], &[(0, 1, 0, b'X')]), b"aXcd");
    assert_eq!(changed(b"abcd", &[], &[(2, 1, 2, 0)]), b"ad");
    assert_eq!(changed(b"abcd", &[], &[(3, 2, 0, 0)]), b"ab");
    assert_eq!(changed(b"abcd", &[], &[(4, 1, 2, 0)]), b"abcbcd");
    assert_eq!(changed(b"ab", &[b"/"], &[(6, 2, 0, 8)]), b"ab/");
    assert_eq!(changed(b"ab", &[b"/"], &[(6, 0, 0, 3)]), b"NaNab");
}
