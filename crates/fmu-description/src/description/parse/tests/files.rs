//! Encoding, well-formedness and positions of the file.

use crate::defect::Position;
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

/// Returns the model name, and the actual content that the only warning states.
fn named(bytes: &[u8]) -> (String, String) {
    let (description, warnings) = ModelDescription::read(bytes).unwrap();
    let [warning] = warnings.as_slice() else { panic!("{warnings:?}") };
    (description.model_name, warning.actual.clone())
}

#[test]
fn encodings_that_other_importers_read_are_read_with_a_warning() {
    let xml = with(X, "").replace("\"M\"", "\"K\u{f6}rper\"");
    let latin = xml.replace("UTF-8", "ISO-8859-1");
    let latin: Vec<u8> = latin.chars().map(|character| character as u8).collect();
    let declared = "encoding \"ISO-8859-1\"".to_owned();
    assert_eq!(named(&latin), ("K\u{f6}rper".to_owned(), declared));
    // In windows-1252 the byte 0x80 is the euro sign.
    let windows = with(X, "").replace("UTF-8", "windows-1252").replace("\"M\"", "\"#\"");
    let windows: Vec<u8> =
        windows.bytes().map(|byte| if byte == b'#' { 0x80 } else { byte }).collect();
    assert_eq!(named(&windows), ("\u{20ac}".to_owned(), "encoding \"windows-1252\"".to_owned()));

    let wide = xml.replace("UTF-8", "UTF-16");
    let little: Vec<u8> = wide.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let big: Vec<u8> = wide.encode_utf16().flat_map(u16::to_be_bytes).collect();
    for (mark, bytes, name) in [
        ([0xff, 0xfe].as_slice(), &little, "UTF-16LE"),
        (&[0xfe, 0xff], &big, "UTF-16BE"),
        (&[], &little, "UTF-16LE"),
        (&[], &big, "UTF-16BE"),
    ] {
        let computed = format!("encoding {name:?}");
        assert_eq!(named(&[mark, bytes].concat()), ("K\u{f6}rper".to_owned(), computed));
    }
    let marked = [b"\xef\xbb\xbf".as_slice(), xml.as_bytes()].concat();
    assert_eq!(named(&marked), ("K\u{f6}rper".to_owned(), "a byte order mark".to_owned()));
}

#[test]
fn a_text_that_cannot_be_decoded_is_refused_with_its_encoding() {
    let latin = with(X, "").replace("\"M\"", "\"\u{f6}\"");
    let latin: Vec<u8> = latin.chars().map(|character| character as u8).collect();
    let error = ModelDescription::parse(latin).unwrap_err().to_string();
    assert!(error.contains("0xf6") && error.contains("line 2"), "{error}");
    for declared in ["UTF-16", "EBCDIC-CP-US"] {
        let error = ModelDescription::parse(with(X, "").replace("UTF-8", declared)).unwrap_err();
        assert!(error.to_string().contains(declared), "{error}");
    }
    let half = ModelDescription::parse(b"\xff\xfe<\0\0\xdc").unwrap_err().to_string();
    assert!(half.contains("UTF-16LE"), "{half}");
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
    let long = " ".repeat(ModelDescription::MOST_BYTES + 1);
    assert!(matches!(ModelDescription::parse(long), Err(ParseError::Length { .. })));
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
fn xml_that_strict_parsers_refuse_is_read() {
    for (ordered, computed) in [
        (" guid=", " xsi:noNamespaceSchemaLocation='fmi2ModelDescription.xsd' guid="),
        (" guid=", " description='a < b'guid="),
        (" guid=", " description='bell \u{7} &#1;' guid="),
        ("<ModelVariables>", "<!-- a -- b --><ModelVariables>"),
        ("<ModelVariables>", "&nbsp; ]]> <ModelVariables>"),
        (
            "<ModelVariables>",
            "<VendorAnnotations><x:y z:a=''/></VendorAnnotations><ModelVariables>",
        ),
        ("</fmiModelDescription>", "</fmiModelDescription> end of file"),
    ] {
        let xml = with(X, "").replace(ordered, computed);
        let description = ModelDescription::parse(&xml);
        assert_eq!(description.map(|byte| byte.variables.len()), Ok(1), "{computed}");
    }
}

/// A description with many copies of one element, which must be refused.
fn flooded(element: &str, count: usize) -> String {
    let xml = with(&element.repeat(count), "");
    match ModelDescription::parse(xml).unwrap_err() {
        ParseError::Limit { what, .. } => what.to_owned(),
        other => panic!("{other}"),
    }
}

#[test]
fn files_with_millions_of_elements_attributes_or_variables_are_refused() {
    assert_eq!(flooded("<a/>", 4_000_001), "elements");
    let mut hundred = "<a".to_owned();
    for number in 0..100 {
        write!(hundred, " a{number}=''").unwrap();
    }
    assert_eq!(flooded(&(hundred + "/>"), 120_001), "attributes in all");
    assert_eq!(flooded("<ScalarVariable/>", 1_000_001), "variables");
}

#[test]
fn a_file_full_of_faults_is_read_with_a_bounded_number_of_warnings() {
    let xml = with(&"<what/>".repeat(100_000), "");
    let (_, warnings) = ModelDescription::read(xml).unwrap();
    assert_eq!(warnings.len(), 1001);
    assert!(warnings[1000].to_string().contains("the others are not listed"));
}

#[test]
fn every_truncation_of_a_file_is_an_error_and_no_panic() {
    let whole = with(X, r#"<Outputs><Unknown index="1" dependencies=""/></Outputs>"#);
    for length in 0..whole.len() {
        assert!(ModelDescription::parse(&whole[..length]).is_err(), "{length}");
    }
    ModelDescription::parse(&whole).unwrap();
}

#[test]
fn elements_may_nest_64_levels_deep_also_in_annotations() {
    let is_too_deep = |text: String| {
        let error = ModelDescription::parse(text).unwrap_err();
        matches!(error, ParseError::Limit { what: "levels of nested elements", limit: 64, .. })
    };
    let nested = |around: &str, levels: usize, inner: &str| {
        let closed = format!("{}{inner}{}", "<a>".repeat(levels), "</a>".repeat(levels));
        format!("<fmiModelDescription><{around}>{closed}</{around}></fmiModelDescription>")
    };
    for around in ["b", "VendorAnnotations", "Annotations"] {
        assert!(!is_too_deep(nested(around, 62, "")), "{around}");
        assert!(!is_too_deep(nested(around, 61, "<c/>")), "{around}");
        assert!(is_too_deep(nested(around, 63, "")), "{around}");
        assert!(is_too_deep(nested(around, 62, "<c/>")), "{around}");
    }
}
