use super::tag::Value;
use super::*;
use crate::description::{Elements, Guid, sample};

#[test]
fn a_description_with_everything_reads_back_equal() {
    let description = sample::complete();
    assert_eq!(ModelDescription::parse(description.to_xml()).unwrap(), description);
}

#[test]
fn a_description_of_fmi_3_with_everything_reads_back_equal() {
    let description = sample::complete_3();
    let (read, warnings) = ModelDescription::read(description.to_xml()).unwrap();
    assert_eq!(warnings, []);
    assert_eq!(read, description);
}

#[test]
fn an_alias_is_rendered_in_its_variable() {
    let mut description = sample::complete_3();
    let xml = description.to_xml();
    assert_eq!(xml.matches("<Alias ").count(), 2);
    assert!(xml.contains("<Alias name=\"phi\"/>"), "{xml}");
    // The order of the variables does not matter.
    let position =
        description.variables.iter().position(|variable| variable.name == "phi").unwrap();
    let alias = description.variables.remove(position);
    description.variables.push(alias);
    let again = ModelDescription::parse(description.to_xml()).unwrap();
    assert_eq!(again.variables[position].alias_of.as_deref(), Some("x"));
}

#[test]
fn single_precision_has_the_digits_of_its_own() {
    let mut description = sample::complete_3();
    let gains = description.variables.iter_mut().find(|variable| variable.name == "gains").unwrap();
    gains.kind = Kind::Float32(RealType { start: Some(f64::from(0.1_f32)), ..RealType::default() });
    let xml = description.to_xml();
    assert!(xml.contains("name=\"gains\"") && xml.contains(" start=\"0.1\""), "{xml}");
    let elements = Elements::Real(vec![f64::INFINITY, f64::NEG_INFINITY, 0.5]);
    description
        .variables
        .iter_mut()
        .find(|variable| variable.name == "gains")
        .unwrap()
        .start_elements = Some(elements);
    assert!(description.to_xml().contains(" start=\"INF -INF 0.5\""));
}

#[test]
fn an_empty_description_has_no_empty_list() {
    let xml =
        ModelDescription { fmi_version: "2.0".into(), ..ModelDescription::default() }.to_xml();
    let expected = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
        <fmiModelDescription fmiVersion=\"2.0\" modelName=\"\" guid=\"\">\n  \
        <ModelVariables>\n  </ModelVariables>\n  <ModelStructure/>\n</fmiModelDescription>\n";
    assert_eq!(xml, expected);
}

#[test]
fn numbers_read_back_to_the_same_bits() {
    for value in [
        0.0,
        -0.0,
        0.1,
        1.0 / 3.0,
        f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
        -123_456_789.123_456_79,
        1e16,
        2f64.powi(60) + 256.0,
    ] {
        let text = value.text();
        assert_eq!(text.parse::<f64>().unwrap().to_bits(), value.to_bits(), "{text}");
        assert!(text.len() <= 25, "{text}");
    }
}

#[test]
fn text_is_escaped_and_characters_that_xml_forbids_are_replaced() {
    let mut description = sample::complete();
    description.model_name = "a\u{0}b\u{1b}c\u{ffff}d".to_owned();
    description.author = Some("<&>\"'\n\r\t".to_owned());
    let xml = description.to_xml();
    assert!(xml.contains("author=\"&lt;&amp;&gt;&quot;&apos;&#10;&#13;&#9;\""), "{xml}");
    let parsed = ModelDescription::parse(xml).unwrap();
    assert_eq!(parsed.model_name, "a\u{fffd}b\u{fffd}c\u{fffd}d");
    assert_eq!(parsed.author, description.author);
}

#[test]
fn the_hash_depends_on_everything_but_the_guid() {
    let description = sample::complete();
    let guid = Guid::of(&description);
    let text = guid.to_string();
    let digits: Vec<usize> = text.trim_matches(['{', '}']).split('-').map(str::len).collect();
    assert_eq!(digits, [8, 4, 4, 4, 12]);
    let renamed = ModelDescription { guid: text, ..description.clone() };
    assert_eq!(Guid::of(&renamed), guid);
    let mut changed = description.clone();
    changed.variables[0].value_reference += 1;
    assert_ne!(Guid::of(&changed), guid);
    let mut changed = description;
    changed.structure.outputs[1].dependencies = None;
    assert_ne!(Guid::of(&changed), guid);
}

/// The ten other attributes are absent; each is serialised as a zero.
#[test]
fn the_serialized_form_of_a_real_has_relative_quantity_only_if_it_is_stated() {
    let form = |relative_quantity| {
        let real = RealType { relative_quantity, ..RealType::default() };
        postcard::to_stdvec(&real).unwrap()
    };
    assert_eq!(form(None), [0_u8; 10]);
    assert_eq!(form(Some(true))[10..], [9_u8, 1, 1]);
}

/// Computed with `hashlib.sha256` of Python: the length of "2.0", the text, and 20 zeros for all
/// fields that are absent or empty.
#[test]
fn the_guid_is_the_sha_256_of_the_serialized_form() {
    let description = ModelDescription { fmi_version: "2.0".into(), ..ModelDescription::default() };
    assert_eq!(Guid::of(&description).to_string(), "{18ca65ba-6482-8b67-e6b8-2e07b28dc8f5}");
}
