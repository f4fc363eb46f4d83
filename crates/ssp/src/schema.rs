//! The elements and attributes that the XSDs of SSP 1.0 and 2.0 allow; any other gives a warning.

use std::collections::BTreeMap;

use fmu_description::Position;

use super::xml::Node;

/// A list of names, without quotes and commas.
macro_rules! names {
    ($($name:ident)*) => { [$(stringify!($name)),*] };
}

/// Attributes that every element may have.
const ANYWHERE: [&str; 2] = ["id", "description"];
/// Attributes that root elements may have besides [`ANYWHERE`].
const TOP: [&str; 8] = names! {
    version name author fileversion copyright license generationTool generationDateAndTime
};
/// Names of type elements of connectors and parameter values.
pub(super) const TYPES: [&str; 17] = names! {
    Real Float64 Float32 Integer Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64
    Boolean String Enumeration Binary Clock
};
const TRANSFORMATIONS: [&str; 4] = names! {
    LinearTransformation BooleanMappingTransformation IntegerMappingTransformation
    EnumerationMappingTransformation
};
/// Elements that most other elements may contain.
const COMMON: [&str; 3] = ["MetaData", "Signature", "Annotations"];
/// Lists that the standard allows once; the reader accepts several.
const LISTS: [&str; 6] =
    names! { Connectors ParameterBindings Connections SignalDictionaries Units Enumerations };
const ELEMENT: [&str; 3] = ["Connectors", "ElementGeometry", "ParameterBindings"];
const SYSTEM: [&str; 5] =
    ["Elements", "Connections", "SignalDictionaries", "SystemGeometry", "GraphicalElements"];

/// Adds a warning for each unknown element or attribute below `node`, for repeated lists, and for
/// signatures, which are not verified.
pub(super) fn check(node: &Node, warnings: &mut Vec<String>) {
    let mut findings = BTreeMap::new();
    visit(node, &mut findings);
    let mut findings: Vec<_> = findings.into_iter().collect();
    findings.sort_by_key(|(_, (at, _))| (at.line, at.column));
    for (sentence, (at, count)) in findings {
        let more = if count > 1 { format!(" ({count} times)") } else { String::new() };
        warnings.push(format!("{at}: {sentence}{more}"));
    }
}

/// Warnings, each with the position of its first occurrence and the number of occurrences.
type Findings = BTreeMap<String, (Position, usize)>;

fn visit(node: &Node, findings: &mut Findings) {
    let name = node.name.as_str();
    let Some((children, attributes)) = content(name) else { return };
    for attribute in node.attribute_names() {
        if !attributes.contains(&attribute) && !ANYWHERE.contains(&attribute) {
            let sentence = format!("<{name}> has the attribute {attribute:?}, which is skipped");
            add(findings, sentence, node.at);
        }
    }
    let mut lists: Vec<&str> = Vec::new();
    for child in node.ssp_children() {
        let known = child.name.as_str();
        if !children.iter().any(|list| list.contains(&known)) {
            let sentence = format!("<{name}> has the element <{known}>, which is skipped");
            add(findings, sentence, child.at);
            continue;
        }
        if lists.contains(&known) {
            let sentence = format!("<{name}> has a second element <{known}>: both are read");
            add(findings, sentence, child.at);
        }
        lists.extend(LISTS.contains(&known).then_some(known));
        if known == "Signature" {
            add(findings, format!("the signature of <{name}> is not verified"), child.at);
        }
        visit(child, findings);
    }
}

fn add(findings: &mut Findings, sentence: String, at: Position) {
    findings.entry(sentence).or_insert((at, 0)).1 += 1;
}

/// Lists of element names.
type Names = &'static [&'static [&'static str]];

/// Returns the allowed children and attributes of an element; `None` if the content is not checked.
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
            &names! {
                startElement startConnector startIndices endElement endConnector endIndices
                suppressUnitConversion
            },
        ),
        "ParameterValues" => (&[&["ParameterSet"], &COMMON], &[]),
        // An element of a system structure, or the root of a file.
        "ParameterMapping" => (
            &[&["ParameterMapping", "MappingEntry"], &COMMON],
            &names! {
                type source sourceBase
                version author fileversion copyright license generationTool generationDateAndTime
            },
        ),
        "SignalDictionary" => (
            &[&["SignalDictionary", "DictionaryEntry", "Enumerations", "Units"], &COMMON],
            &names! {
                name type source sourceBase
                version author fileversion copyright license generationTool generationDateAndTime
            },
        ),
        "MappingEntry" => {
            (&[&TRANSFORMATIONS, &COMMON], &["source", "target", "suppressUnitConversion"])
        }
        "ParameterSet" => (&[&["Parameters", "Enumerations", "Units"], &COMMON], &TOP),
        "Parameter" | "DictionaryEntry" => (&[&TYPES, &["Dimension"], &COMMON], &["name"]),
        "Real" | "Float64" | "Float32" => (&[&COMMON], &["unit", "value"]),
        "LinearTransformation" => (&[&COMMON], &["factor", "offset"]),
        "Unit" => (&[&["BaseUnit"], &COMMON], &["name"]),
        "BaseUnit" => (&[&COMMON], &names! { kg m s A K mol cd rad factor offset }),
        "Enumeration" => (&[&["Item"], &["Value"], &COMMON], &["name", "value"]),
        "DefaultExperiment" => (&[&COMMON], &["startTime", "stopTime"]),
        "Parameters" => (&[&["Parameter"]], &[]),
        "Units" => (&[&["Unit"]], &[]),
        "Enumerations" => (&[&["Enumeration"]], &[]),
        "SignalDictionaries" => (&[&["SignalDictionary"]], &[]),
        _ => return None,
    })
}
