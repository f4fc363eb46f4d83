//! No file that the master reads does any harm, whatever its content.

use robustness::changes::mutate;
use robustness::corpus::replay;
use robustness::system_files as targets;

/// Typical words of SSP's XML.
const XML: [&[u8]; 20] = [
    b"<",
    b">",
    b"/>",
    b"\"",
    b"&#x0;",
    b"&#10;",
    b"&amp;",
    b"<!DOCTYPE x [<!ENTITY a 'a'>]>",
    b"<!--",
    b"-->",
    b"<ssd:Annotations>",
    b"</ssd:Annotations>",
    b" name=\"x\"",
    b" source=\"x\"",
    b" value=\"1\"",
    b" xmlns:ssc=\"\"",
    b"<ssc:Real unit=\"m\"/>",
    b"<ssc:LinearTransformation factor=\"2\"/>",
    b"<ssd:Elements/>",
    b"<ssd:System name=\"x\"/>",
];
/// Typical words of CSV.
const CSV: [&[u8]; 10] =
    [b",", b"\"", b"\"\"", b"\n", b"\r\n", b"\r", b"time", b"\xef\xbb\xbf", b"1e308", b"-1e-308"];

#[test]
fn system_structures_do_no_harm() {
    replay("system_structure", targets::system_structure);
    mutate("system_structure", &XML, targets::system_structure, 3000);
}

#[test]
fn parameter_values_do_no_harm() {
    replay("parameter_values", targets::parameter_values);
    mutate("parameter_values", &XML, targets::parameter_values, 5000);
}

#[test]
fn parameter_mappings_do_no_harm() {
    replay("parameter_mapping", targets::parameter_mapping);
    mutate("parameter_mapping", &XML, targets::parameter_mapping, 5000);
}

#[test]
fn signal_dictionaries_do_no_harm() {
    replay("signal_dictionary", targets::signal_dictionary);
    mutate("signal_dictionary", &XML, targets::signal_dictionary, 5000);
}

#[test]
fn signal_tables_do_no_harm() {
    replay("signal_table", targets::signal_table);
    mutate("signal_table", &CSV, targets::signal_table, 5000);
}
