//! Parses XML into the plain data of [`super::structure`]. Nothing here opens a file.

mod definitions;
mod system;

use super::error::SspError;
use super::schema;
use super::structure::{
    MappingEntry, Parameter, ParameterMapping, ParameterSet, ParameterValue, Place,
    SignalDictionary, SystemStructure,
};
use super::xml::{self, Node};
use definitions::{conversion, definitions, value_type};

/// The parsed content, and warnings with positions about undeclared prefixes and unknown content.
type Read<T> = Result<(T, Vec<String>), SspError>;

/// Parses the XML of a file, checks it against the schema and reads its root element; also returns warnings.
fn read<T>(
    bytes: &[u8],
    space: &str,
    root: &str,
    content: impl Fn(&Node) -> Result<T, SspError>,
) -> Read<T> {
    let (node, mut warnings) = xml::read(bytes, space, root)?;
    schema::check(&node, &mut warnings);
    Ok((content(&node)?, warnings))
}

/// Parses an SSD file; also returns warnings with positions.
///
/// Versions 1.x and 2.x are accepted. Geometry, metadata and annotations are skipped, except the
/// step sizes of `com.opensimulationplatform`.
///
/// # Errors
///
/// [`SspError`] with line and column if the file is not well-formed or has content that SSP does not allow; also if the
/// file exceeds a limit.
pub fn read_ssd(bytes: &[u8]) -> Read<SystemStructure> {
    let name = "SystemStructureDescription";
    read(bytes, name, name, |root| {
        let system = root.child("System")?;
        let system = system.ok_or_else(|| root.wrong("an element System", "none"))?;
        Ok(SystemStructure {
            name: root.required("name")?.to_owned(),
            system: system::system(system)?,
            definitions: definitions(root)?,
            experiment: root.child("DefaultExperiment")?.map(system::experiment).transpose()?,
            generation_tool: root.text("generationTool"),
        })
    })
}

/// Parses an SSV file; also returns warnings with positions.
///
/// # Errors
///
/// Same as [`read_ssd`].
pub fn read_ssv(bytes: &[u8]) -> Read<ParameterSet> {
    read(bytes, "SystemStructureParameterValues", "ParameterSet", parameter_set)
}

/// Parses an SSM file; also returns warnings with positions.
///
/// # Errors
///
/// Same as [`read_ssd`].
pub fn read_ssm(bytes: &[u8]) -> Read<ParameterMapping> {
    read(bytes, "SystemStructureParameterMapping", "ParameterMapping", parameter_mapping)
}

/// Parses an SSB file; also returns warnings with positions.
///
/// # Errors
///
/// Same as [`read_ssd`].
pub fn read_ssb(bytes: &[u8]) -> Read<SignalDictionary> {
    read(bytes, "SystemStructureSignalDictionary", "SignalDictionary", signal_dictionary)
}

fn parameter_set(node: &Node) -> Result<ParameterSet, SspError> {
    if node.child("Parameters")?.is_none() {
        return Err(node.wrong("an element Parameters", "none"));
    }
    let parameters = node.list("Parameters", "Parameter", parameter)?;
    let name = node.required("name")?.to_owned();
    Ok(ParameterSet { name, parameters, definitions: definitions(node)? })
}

fn parameter(node: &Node) -> Result<Parameter, SspError> {
    let mut values = node.ssp_children().filter_map(|child| parameter_value(child).transpose());
    let expected = "one of Real, Integer, Boolean, String, Enumeration and Binary";
    let value = values.next().ok_or_else(|| node.wrong(expected, "none of them"))??;
    if values.next().is_some() {
        return Err(node.wrong(expected, "another one"));
    }
    Ok(Parameter { name: node.required("name")?.to_owned(), value })
}

/// Reads the value that an element states; `None` if the element is not a value.
fn parameter_value(node: &Node) -> Result<Option<ParameterValue>, SspError> {
    if let Some(values) = array(node)? {
        return Ok(Some(ParameterValue::Array(node.name.clone(), values)));
    }
    // SSP 2.0 also states a text in an element `Value`.
    let only = node.child("Value")?;
    let text = || Ok::<_, SspError>(only.unwrap_or(node).required("value")?.to_owned());
    Ok(Some(match node.name.as_str() {
        "Real" | "Float64" | "Float32" => {
            ParameterValue::Real(node.needed("value", Node::number)?, node.stated("unit"))
        }
        "Integer" => ParameterValue::Integer(node.needed("value", Node::integer)?),
        "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64" | "UInt64" => {
            let value = node.needed("value", Node::long)?;
            i32::try_from(value).map_or(ParameterValue::Long(value), ParameterValue::Integer)
        }
        "Boolean" => ParameterValue::Boolean(node.needed("value", Node::boolean)?),
        "String" => ParameterValue::String(text()?),
        "Enumeration" => ParameterValue::Enumeration(text()?, node.text("name")),
        "Binary" => ParameterValue::Binary(text()?),
        _ => return Ok(None),
    }))
}

/// Reads an array of SSP 2.0: several values in one attribute, or texts in elements `Value`; `None` for a single value.
fn array(node: &Node) -> Result<Option<Vec<String>>, SspError> {
    if matches!(node.name.as_str(), "String" | "Enumeration" | "Binary") {
        let values = node.children_named("Value").map(|value| value.required("value"));
        let values: Vec<String> =
            values.map(|value| value.map(str::to_owned)).collect::<Result<_, SspError>>()?;
        return Ok(Some(values).filter(|values| values.len() > 1));
    }
    let is_type = schema::TYPES.contains(&node.name.as_str());
    let values = node.words("value").map(str::to_owned).collect::<Vec<_>>();
    Ok(Some(values).filter(|values| is_type && values.len() > 1))
}

fn parameter_mapping(node: &Node) -> Result<ParameterMapping, SspError> {
    let entries = node.children_named("MappingEntry").map(|entry| {
        Ok(MappingEntry {
            source: entry.required("source")?.to_owned(),
            target: entry.required("target")?.to_owned(),
            conversion: conversion(entry)?,
            at: Place(entry.at),
        })
    });
    let entries = entries.collect::<Result<Vec<_>, SspError>>()?;
    node.unique("targets", entries.iter().map(|entry| entry.target.as_str()))?;
    Ok(ParameterMapping { entries })
}

fn signal_dictionary(node: &Node) -> Result<SignalDictionary, SspError> {
    let entries = node.children_named("DictionaryEntry").map(|entry| {
        let kind = value_type(entry)?;
        let kind = kind.ok_or_else(|| entry.wrong("the type of the signal", "none"))?;
        Ok((entry.required("name")?.to_owned(), kind))
    });
    let entries = entries.collect::<Result<Vec<_>, SspError>>()?;
    node.unique("signals", entries.iter().map(|(name, _)| name.as_str()))?;
    Ok(SignalDictionary { entries, definitions: definitions(node)? })
}
