//! XML to the plain data of [`super::structure`]. Nothing here opens a file.

mod definitions;
mod system;

use super::error::SspError;
use super::structure::{
    MappingEntry, Parameter, ParameterMapping, ParameterSet, ParameterValue, Place,
    SignalDictionary, SystemStructure,
};
use super::xml::{self, Node};
use definitions::{conversion, definitions, value_type};

/// Reads an SSD file.
///
/// Accepted is what version 1.0 and later minor versions have in common; geometry and annotations
/// are skipped, but for the step sizes of `com.opensimulationplatform`.
///
/// # Errors
///
/// [`SspError`] with line and column, what is expected and what was found.
pub fn read_ssd(bytes: &[u8]) -> Result<SystemStructure, SspError> {
    let root = xml::read(bytes, "SystemStructureDescription", "SystemStructureDescription")?;
    let system = root.child("System")?;
    let system = system.ok_or_else(|| root.wrong("an element System", "none"))?;
    Ok(SystemStructure {
        name: root.required("name")?.to_owned(),
        system: system::system(system)?,
        definitions: definitions(&root)?,
        experiment: root.child("DefaultExperiment")?.map(system::experiment).transpose()?,
    })
}

/// Reads an SSV file.
///
/// # Errors
///
/// As for [`read_ssd`].
pub fn read_ssv(bytes: &[u8]) -> Result<ParameterSet, SspError> {
    parameter_set(&xml::read(bytes, "SystemStructureParameterValues", "ParameterSet")?)
}

/// Reads an SSM file.
///
/// # Errors
///
/// As for [`read_ssd`].
pub fn read_ssm(bytes: &[u8]) -> Result<ParameterMapping, SspError> {
    parameter_mapping(&xml::read(bytes, "SystemStructureParameterMapping", "ParameterMapping")?)
}

/// Reads an SSB file.
///
/// # Errors
///
/// As for [`read_ssd`].
pub fn read_ssb(bytes: &[u8]) -> Result<SignalDictionary, SspError> {
    signal_dictionary(&xml::read(bytes, "SystemStructureSignalDictionary", "SignalDictionary")?)
}

fn parameter_set(node: &Node) -> Result<ParameterSet, SspError> {
    if node.child("Parameters")?.is_none() {
        return Err(node.wrong("an element Parameters", "none"));
    }
    let parameters = node.list("Parameters", "Parameter", parameter)?;
    node.unique("parameters", parameters.iter().map(|each| each.name.as_str()))?;
    let name = node.required("name")?.to_owned();
    Ok(ParameterSet { name, parameters, definitions: definitions(node)? })
}

fn parameter(node: &Node) -> Result<Parameter, SspError> {
    let mut values = node.own_children().filter_map(|child| parameter_value(child).transpose());
    let expected = "one of Real, Integer, Boolean, String, Enumeration and Binary";
    let value = values.next().ok_or_else(|| node.wrong(expected, "none of them"))??;
    if values.next().is_some() {
        return Err(node.wrong(expected, "another one"));
    }
    Ok(Parameter { name: node.required("name")?.to_owned(), value })
}

/// The value that an element is, if it is one.
fn parameter_value(node: &Node) -> Result<Option<ParameterValue>, SspError> {
    let text = || Ok::<_, SspError>(node.required("value")?.to_owned());
    Ok(Some(match node.name.as_str() {
        "Real" => ParameterValue::Real(node.needed("value", Node::number)?, node.text("unit")),
        "Integer" => ParameterValue::Integer(node.needed("value", Node::integer)?),
        "Boolean" => ParameterValue::Boolean(node.needed("value", Node::boolean)?),
        "String" => ParameterValue::String(text()?),
        "Enumeration" => ParameterValue::Enumeration(text()?, node.text("name")),
        "Binary" => ParameterValue::Binary(text()?),
        _ => return Ok(None),
    }))
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
