//! What the XML readers accept and refuse.

use std::time::{Duration, Instant};

use proptest::prelude::*;
use ssp::structure::{Element, Transformation};
use ssp::{read_ssb, read_ssd, read_ssm, read_ssv};

use crate::bench::{root, ssd, ssv};

#[test]
fn prefixes_are_free_and_a_type_may_stand_in_another_namespace_of_ssp() {
    let text = r#"<SystemStructureDescription name="n" version="1.0" xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription">
<System name="s"><Elements><Component name="a" source="a.fmu"><Connectors>
<Connector name="y" kind="output"><Real/></Connector></Connectors></Component></Elements>
<Connections><Connection startElement="a" startConnector="y" endConnector="z"><LinearTransformation factor="3"/></Connection></Connections>
</System></SystemStructureDescription>"#;
    let structure = read_ssd(text.as_bytes()).unwrap().0;
    let Element::Component(component) = &structure.system.elements[0] else {
        panic!("expected a component")
    };
    assert!(component.base.connectors[0].kind_of_value.is_some());
    let connection = &structure.system.connections[0];
    let expected = Transformation::Linear { factor: 3.0, offset: 0.0 };
    assert_eq!(connection.conversion.transformation, Some(expected));
}

#[test]
fn unknown_elements_geometry_and_foreign_annotations_are_skipped() {
    let geometry = r#"<ssd:ElementGeometry x1="0" y1="0" x2="1" y2="1"/>"#;
    let note = r#"<ssd:Annotations><ssc:Annotation type="org.x"><x:Connections xmlns:x="urn:x"/></ssc:Annotation></ssd:Annotations>"#;
    let text = ssd(&format!("{geometry}{}{note}", root("<ssd:System name='t'/>", "")), "");
    let structure = read_ssd(text.as_bytes()).unwrap().0;
    assert_eq!(structure.system.elements.len(), 1);
    assert_eq!(structure.system.connections.len(), 0);
}

/// Compares what the reader of SSD files says of each text.
fn refused(cases: &[(String, &str)]) {
    for (text, expected) in cases {
        assert_eq!(read_ssd(text.as_bytes()).unwrap_err().to_string(), *expected, "{text}");
    }
}

#[test]
fn what_is_wrong_with_a_file_is_said_with_line_column_and_expectation() {
    refused(&[
        (
            String::new(),
            "line 1, column 1: expected well-formed XML, found: a file without an element",
        ),
        (
            "<a:b version='1.0'/>".to_owned(),
            "line 1, column 1: <a:b>: expected the root element SystemStructureDescription of the namespace \"http://ssp-standard.org/SSP1/SystemStructureDescription\", found namespace \"\"",
        ),
        (
            "<SystemStructureDescription/>".to_owned(),
            "line 1, column 1: <SystemStructureDescription>: expected the root element SystemStructureDescription of the namespace \"http://ssp-standard.org/SSP1/SystemStructureDescription\", found namespace \"\"",
        ),
        (
            "<!DOCTYPE x [<!ENTITY e 'e'>]><x/>".to_owned(),
            "line 1, column 1: expected no document type declaration, found <!DOCTYPE",
        ),
        (
            ssd("", "").replace("version=\"1.0\"\n", "version=\"3.0\"\n"),
            "line 2, column 1: <SystemStructureDescription>: expected version 1.0 or 2.0, found \"3.0\"",
        ),
        (
            ssd("", "<ssd:DefaultExperiment startTime='3' stopTime='2'/>"),
            "line 9, column 38: <DefaultExperiment>: expected a stopTime of at least 3, found 2",
        ),
        (
            ssd(
                "",
                "<ssd:Units><ssc:Unit name='x'><ssc:BaseUnit factor='0'/></ssc:Unit></ssd:Units>",
            ),
            "line 9, column 68: <BaseUnit>: expected a factor other than zero, found 0",
        ),
        (
            ssd("", "<ssd:DefaultExperiment startTime='inf'/>"),
            "line 9, column 38: <DefaultExperiment>: expected a finite number in the attribute startTime, found \"inf\"",
        ),
    ]);
}

#[test]
fn what_is_wrong_with_a_component_is_said_with_line_column_and_expectation() {
    let component = |attributes: &str, inside: &str| {
        ssd(&root(&format!("<ssd:Component {attributes}>{inside}</ssd:Component>"), ""), "")
    };
    refused(&[
        (
            component("name='a' source=''", ""),
            "line 9, column 39: <Component>: expected the path of a file in the attribute source, found nothing",
        ),
        (
            component("name='' source='a'", ""),
            "line 9, column 39: <Component>: expected a name, found an empty one",
        ),
        (
            component("name='a' source='a' type='application/x-other'", ""),
            "line 9, column 39: <Component>: expected the type application/x-fmu-sharedlibrary, application/x-ssp-definition or application/x-ssp-package, found \"application/x-other\"",
        ),
        (
            component(
                "name='a' source='a'",
                "<ssd:Connectors>\n<ssd:Connector name='y' kind='out'/></ssd:Connectors>",
            ),
            "line 10, column 1: <Connector>: expected one of the kinds input, output, parameter, calculatedParameter, inout, structuralParameter, constant, local, unspecified, found \"out\"",
        ),
        (
            component(
                "name='a' source='a'",
                "\n<ssd:Connectors><ssd:Connector name='y' kind='input'/><ssd:Connector name='y' kind='output'/></ssd:Connectors>",
            ),
            "line 9, column 39: <Component>: expected connectors of different names, found two called \"y\"",
        ),
        (
            component(
                "name='a' source='a'",
                "<ssd:ParameterBindings>\n<ssd:ParameterBinding/></ssd:ParameterBindings>",
            ),
            "line 10, column 1: <ParameterBinding>: expected a source or an element ParameterSet, found neither",
        ),
    ]);
}

#[test]
fn parameter_sets_mappings_and_dictionaries_say_what_they_miss() {
    for (parameters, expected) in [
        (
            "<ssv:Parameter name='a'/>",
            "one of Real, Integer, Boolean, String, Enumeration and Binary, found none of them",
        ),
        (
            "<ssv:Parameter name='a'><ssv:Real/></ssv:Parameter>",
            "<Real>: expected the attribute value, found none",
        ),
        (
            "<ssv:Parameter name='a'><ssv:Integer value='3000000000'/></ssv:Parameter>",
            "found \"3000000000\"",
        ),
    ] {
        let text = read_ssv(ssv(parameters).as_bytes()).unwrap_err().to_string();
        assert!(text.ends_with(expected), "{text}");
    }
    let mapping = |entries: &str| {
        format!(
            r#"<ssm:ParameterMapping version="1.0" xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">{entries}</ssm:ParameterMapping>"#
        )
    };
    let entry = "<ssm:MappingEntry source='a' target='b'/>";
    let twice = read_ssm(mapping(&entry.repeat(2)).as_bytes()).unwrap_err().to_string();
    assert!(twice.ends_with("expected targets of different names, found two called \"b\""));
    let ambiguous = "<ssm:MappingEntry source='a' target='b'><ssc:BooleanMappingTransformation><ssc:MapEntry source='1' target='0'/><ssc:MapEntry source='true' target='1'/></ssc:BooleanMappingTransformation></ssm:MappingEntry>";
    let text = read_ssm(mapping(ambiguous).as_bytes()).unwrap_err().to_string();
    assert!(text.ends_with("expected a source that no other entry has, found a second one"));
    let dictionary = r#"<ssb:SignalDictionary version="1.0" xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"><ssb:DictionaryEntry name="s"/></ssb:SignalDictionary>"#;
    let text = read_ssb(dictionary.as_bytes()).unwrap_err().to_string();
    assert!(text.ends_with("<DictionaryEntry>: expected the type of the signal, found none"));
}

#[test]
fn nesting_and_size_are_bounded() {
    let deep = ssd(&"<ssd:Elements><ssd:System name='s'>".repeat(40), "");
    let text = read_ssd(deep.as_bytes()).unwrap_err().to_string();
    assert!(text.ends_with("expected at most 64 levels of nested elements, found more"), "{text}");
    let many = ssd(&"<x/>".repeat(4_000_000), "");
    let text = read_ssd(many.as_bytes()).unwrap_err().to_string();
    assert!(text.starts_with("expected at most 4000000 tags, found more; this limit"), "{text}");
    let large = ssd(&" ".repeat(65 << 20), "");
    let text = read_ssd(large.as_bytes()).unwrap_err().to_string();
    assert!(text.starts_with("expected at most 67108864 bytes, found more; this limit"), "{text}");
}

#[test]
fn namespaces_cost_no_more_than_their_length() {
    let begin = Instant::now();
    let long =
        format!("<ssd:a xmlns:x='{}'>{}</ssd:a>", "n".repeat(4 << 20), "<x:b/>".repeat(1 << 18));
    let declared: Vec<String> = (0..200).map(|k| format!(" xmlns:p{k}='n'")).collect();
    let outer = format!("<ssd:a{}>", declared.concat()).repeat(40);
    let many = format!("{outer}{}{}", "<ssd:b/>".repeat(1 << 17), "</ssd:a>".repeat(40));
    assert!(read_ssd(ssd(&(long + &many), "").as_bytes()).is_ok());
    // With a copy and a search for each tag, a third of this file took 12 s.
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
}

#[test]
fn characters_that_xml_does_not_have_are_refused() {
    for (character, name) in
        [("\0", "0000"), ("&#1;", "0001"), ("\u{1f}", "001F"), ("\u{ffff}", "FFFF")]
    {
        let text = ssd(&root(&format!("<ssd:System name='a{character}'/>"), ""), "");
        let message = read_ssd(text.as_bytes()).unwrap_err().to_string();
        let expected = format!(
            "line 9, column 39: <System>: expected characters of XML in the attribute name, found U+{name}"
        );
        assert_eq!(message, expected);
    }
}

proptest! {
    #[test]
    fn whatever_bytes_there_are_the_readers_answer(
        cut in 0_usize..2000,
        at in 0_usize..2000,
        byte in any::<u8>(),
    ) {
        let system = r#"<ssd:Elements><ssd:Component name="a" source="a.fmu"><ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real unit="m"/></ssd:Connector></ssd:Connectors></ssd:Component></ssd:Elements>"#;
        let mut bytes = ssd(system, "<ssd:DefaultExperiment startTime='1'/>").into_bytes();
        let length = bytes.len();
        bytes[at % length] = byte;
        bytes.truncate(length - cut % length);
        let _ = read_ssd(&bytes);
        let _ = read_ssv(&bytes);
        let _ = read_ssm(&bytes);
        let _ = read_ssb(&bytes);
    }
}
