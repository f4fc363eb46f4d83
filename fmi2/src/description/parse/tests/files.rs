//! The file as such: encoding, well-formedness, positions.

use std::fmt::Write as _;

use super::*;

#[test]
fn errors_point_at_the_line_and_column_of_the_element() {
    let xml = "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"M\" guid=\"1\">\n\
               <!-- \u{3b1}\u{3b2} --><ModelVariables>\n \u{20}<ScalarVariable name=\"x\"/>\n\
               </ModelVariables><ModelStructure/></fmiModelDescription>";
    match ModelDescription::parse(xml).unwrap_err() {
        ParseError::Attribute { at, .. } => assert_eq!(at, Position { line: 3, column: 3 }),
        other => panic!("{other}"),
    }
    let xml = "<fmiModelDescription>\n<!-- \u{3b1}\u{3b2} --></b>";
    match ModelDescription::parse(xml).unwrap_err() {
        ParseError::Xml { at, .. } => assert_eq!(at, Position { line: 2, column: 12 }),
        other => panic!("{other}"),
    }
}

#[test]
fn encodings_other_than_utf_8_are_decoded_or_named() {
    let latin = with(X, "").replace("UTF-8", "ISO-8859-1").replace("\"M\"", "\"K\u{f6}rper\"");
    let bytes: Vec<u8> = latin.chars().map(|character| character as u8).collect();
    assert_eq!(ModelDescription::parse(&bytes).unwrap().model_name, "K\u{f6}rper");

    let marked = [b"\xef\xbb\xbf".as_slice(), with(X, "").as_bytes()].concat();
    assert_eq!(ModelDescription::parse(marked).unwrap().model_name, "M");

    let undeclared = bytes.iter().skip_while(|byte| **byte != b'\n').copied().collect::<Vec<_>>();
    let error = ModelDescription::parse(undeclared).unwrap_err();
    assert!(error.to_string().contains("0xf6"), "{error}");
    for declared in ["windows-1252", "UTF-16", "Shift_JIS"] {
        let error = ModelDescription::parse(with(X, "").replace("UTF-8", declared)).unwrap_err();
        assert!(error.to_string().contains(declared), "{error}");
    }
    assert!(ModelDescription::parse(b"\xff\xfe<\0").unwrap_err().to_string().contains("UTF-16"));
}

#[test]
fn hostile_files_end_in_an_error() {
    let entities = r#"<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><fmiModelDescription/>"#;
    assert!(matches!(ModelDescription::parse(entities), Err(ParseError::Doctype { .. })));
    let deep = "<a>".repeat(1_000_000);
    assert!(matches!(ModelDescription::parse(deep), Err(ParseError::Limit { .. })));
    let mut wide = String::from("<a");
    for number in 0..300 {
        write!(wide, " a{number}=''").unwrap();
    }
    assert!(matches!(ModelDescription::parse(wide + "/>"), Err(ParseError::Limit { .. })));
    for text in [
        "",
        "<",
        "<a",
        "<a>",
        "</a>",
        "<a></b>",
        "<a/><b/>",
        "PK\u{3}\u{4}",
        "<a b='&undefined;'/>",
        "<a b='&#0;'/>",
        "<a b='1' b='2'/>",
        "<a b=1/>",
        "<?xml",
        "<a><VendorAnnotations>",
    ] {
        let error = ModelDescription::parse(text).unwrap_err();
        assert!(matches!(error, ParseError::Xml { .. }), "{text}: {error}");
    }
}

#[test]
fn every_truncation_of_a_file_is_an_error_and_no_panic() {
    let whole = with(X, r#"<Outputs><Unknown index="1" dependencies=""/></Outputs>"#);
    for length in 0..whole.len() {
        assert!(ModelDescription::parse(&whole[..length]).is_err(), "{length}");
    }
    ModelDescription::parse(&whole).unwrap();
}
