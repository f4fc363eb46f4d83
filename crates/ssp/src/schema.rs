//! What the standard has where (the XSDs of SSP 1.0 and 2.0): everything else is named in a warning.

use std::collections::BTreeMap;

use fmu_description::Position;

use super::xml::Node;

/// Attributes that every element may have.
const ANYWHERE: [&str; 2] = ["id", "description"];
/// Attributes that root elements may have.
const TOP: [&str; 8] = [
    "version",
    "name",
    "author",
    "fileversion",
    "copyright",
    "license",
    "generationTool",
    "generationDateAndTime",
];
/// Types of connectors, and elements of parameter values.
pub(super) const TYPES: [&str; 17] = [
    "Real",
    "Float64",
    "Float32",
    "Integer",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Enumeration",
    "Binary",
    "Clock",
];
const TRANSFORMATIONS: [&str; 4] = [
    "LinearTransformation",
    "BooleanMappingTransformation",
    "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
];
/// Elements that many others may have.
const COMMON: [&str; 3] = ["MetaData", "Signature", "Annotations"];
/// Lists that the standard has once, and that are read however often they are there.
const LISTS: [&str; 6] = [
    "Connectors",
    "ParameterBindings",
    "Connections",
    "SignalDictionaries",
    "Units",
    "Enumerations",
];
const ELEMENT: [&str; 3] = ["Connectors", "ElementGeometry", "ParameterBindings"];
const SYSTEM: [&str; 5] =
    ["Elements", "Connections", "SignalDictionaries", "SystemGeometry", "GraphicalElements"];

/// Adds a sentence for each kind of element or attribute below `node` that the standard does not
/// have there, for lists that are repeated, and for signatures, which are not verified.
pub(super) fn check(node: &Node, warnings: &mut Vec<String>) {
    let mut found = BTreeMap::new();
    visit(node, &mut found);
    let mut found: Vec<_> = found.into_iter().collect();
    found.sort_by_key(|(_, (at, _))| (at.line, at.column));
    for (sentence, (at, count)) in found {
        let more = if count > 1 { format!(" ({count} times)") } else { String::new() };
        warnings.push(format!("{at}: {sentence}{more}"));
    }
}

/// Sentences with the place of the first case, and the number of cases.
type Found = BTreeMap<String, (Position, usize)>;

fn visit(node: &Node, found: &mut Found) {
    let name = node.name.as_str();
    let Some((children, attributes)) = content(name) else { return };
    for attribute in node.attribute_names() {
        if !attributes.contains(&attribute) && !ANYWHERE.contains(&attribute) {
            add(
                found,
                format!("<{name}> has the attribute {attribute:?}, which is skipped"),
                node.at,
            );
        }
    }
    let mut lists: Vec<&str> = Vec::new();
    for child in node.own_children() {
        let known = child.name.as_str();
        if !children.iter().any(|list| list.contains(&known)) {
            add(found, format!("<{name}> has the element <{known}>, which is skipped"), child.at);
            continue;
        }
        if lists.contains(&known) {
            add(found, format!("<{name}> has a second element <{known}>: both are read"), child.at);
        }
        lists.extend(LISTS.contains(&known).then_some(known));
        if known == "Signature" {
            add(found, format!("the signature of <{name}> is not verified"), child.at);
        }
        visit(child, found);
    }
}

fn add(found: &mut Found, sentence: String, at: Position) {
    found.entry(sentence).or_insert((at, 0)).1 += 1;
}

/// Lists of names of elements.
type Names = &'static [&'static [&'static str]];

/// The elements and the attributes of an element; none for one whose content does not matter.
fn content(name: &str) -> Option<(Names, &'static [&'static str])> {
    Some(match name {
        "SystemStructureDescription" => {
            (&[&["System", "DefaultExperiment"], &["Enumerations", "Units"], &COMMON], &TOP)
        }
        "System" => (&[&ELEMENT, &SYSTEM, &COMMON], &["name"]),
        "Elements" => (&[&["Component", "System", "SignalDictionaryReference"]], &[]),
        "Component" => (&[&ELEMENT, &COMMON], &["name", "type", "source", "implementation"]),
        "SignalDictionaryReference" => (&[&ELEMENT, &COMMON], &["name", "dictionary"]),
        "Connectors" => (&[&["Connector"]], &[]),
        "Connector" => {
            (&[&TYPES, &["Dimension"], &["ConnectorGeometry"], &COMMON], &["name", "kind"])
        }
        "Dimension" => (&[], &["size", "sizeConnector"]),
        "ParameterBindings" => (&[&["ParameterBinding"]], &[]),
        "ParameterBinding" => (
            &[&["ParameterValues"], &["ParameterMapping"], &COMMON],
            &["type", "source", "sourceBase", "prefix"],
        ),
        "Connections" => (&[&["Connection"]], &[]),
        "Connection" => (
            &[&TRANSFORMATIONS, &["ConnectionGeometry"], &COMMON],
            &[
                "startElement",
                "startConnector",
                "startIndices",
                "endElement",
                "endConnector",
                "endIndices",
                "suppressUnitConversion",
            ],
        ),
        "MappingEntry" => {
            (&[&TRANSFORMATIONS, &COMMON], &["source", "target", "suppressUnitConversion"])
        }
        "ParameterSet" => (&[&["Parameters", "Enumerations", "Units"], &COMMON], &TOP),
        "Parameter" | "DictionaryEntry" => (&[&TYPES, &["Dimension"], &COMMON], &["name"]),
        "Unit" => (&[&["BaseUnit"], &COMMON], &["name"]),
        "Enumeration" => (&[&["Item"], &["Value"], &COMMON], &["name", "value"]),
        "DefaultExperiment" => (&[&COMMON], &["startTime", "stopTime"]),
        "Parameters" => (&[&["Parameter"]], &[]),
        "Units" => (&[&["Unit"]], &[]),
        "Enumerations" => (&[&["Enumeration"]], &[]),
        "SignalDictionaries" => (&[&["SignalDictionary"]], &[]),
        _ => return None,
    })
}
