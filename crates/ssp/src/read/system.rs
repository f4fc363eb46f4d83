//! Parses systems and their content (section 5).

use super::definitions::{conversion, value_type};
use super::{parameter_mapping, parameter_set, signal_dictionary};
use crate::error::SspError;
use crate::structure::{
    Component, Connection, Connector, ConnectorKind, Content, DefaultExperiment,
    DictionaryReference, DictionarySource, Element, ElementBase, End, Implementation,
    ParameterBinding, Place, Source, System,
};
use crate::xml::Node;

/// `type` of libcosim's annotations, which Ecos reads too.
const OPEN_SIMULATION_PLATFORM: &str = "com.opensimulationplatform";

pub(super) fn system(node: &Node) -> Result<System, SspError> {
    let mut elements = Vec::new();
    for child in node.child("Elements")?.into_iter().flat_map(Node::ssp_children) {
        elements.push(match child.name.as_str() {
            "Component" => Element::Component(component(child)?),
            "System" => Element::System(system(child)?),
            "SignalDictionaryReference" => Element::Dictionary(dictionary_reference(child)?),
            other => {
                let expected = "Component, System and SignalDictionaryReference";
                return Err(node.wrong(expected, format!("{other} at {}", child.at)));
            }
        });
    }
    node.unique("elements", elements.iter().map(|element| element.base().name.as_str()))?;
    let dictionaries = node.list("SignalDictionaries", "SignalDictionary", dictionary)?;
    node.unique(
        "signal dictionaries",
        dictionaries.iter().map(|dictionary| dictionary.name.as_str()),
    )?;
    Ok(System {
        base: base(node)?,
        elements,
        connections: node.list("Connections", "Connection", connection)?,
        dictionaries,
    })
}

fn base(node: &Node) -> Result<ElementBase, SspError> {
    let name = node.required("name")?.to_owned();
    if name.is_empty() {
        return Err(node.wrong("a name", "an empty one"));
    }
    let connectors = node.list("Connectors", "Connector", connector)?;
    node.unique("connectors", connectors.iter().map(|connector| connector.name.as_str()))?;
    Ok(ElementBase {
        name,
        id: node.text("id"),
        connectors,
        bindings: node.list("ParameterBindings", "ParameterBinding", binding)?,
        at: Place(node.at),
    })
}

fn component(node: &Node) -> Result<Component, SspError> {
    let content = match node.attribute("type") {
        None => Some(Content::Fmu),
        // A component without a source has only connectors, so that any type is accepted.
        Some(stated) => {
            Content::named(stated).or(node.attribute("source").is_none().then_some(Content::Fmu))
        }
    };
    let content = content.ok_or_else(|| {
        let expected = "the type application/x-fmu-sharedlibrary, application/x-ssp-definition \
             or application/x-ssp-package";
        node.wrong(expected, format!("{:?}", node.attribute("type").unwrap_or_default()))
    })?;
    let implementation = node.attribute("implementation").unwrap_or("any");
    let implementation = Implementation::named(implementation).ok_or_else(|| {
        let expected = "the implementation any, CoSimulation, ModelExchange or ScheduledExecution";
        node.wrong(expected, format!("{implementation:?}"))
    })?;
    let hint = annotation(node)?.and_then(|content| content.any_child("StepSizeHint"));
    let step_size = hint.map(|hint| hint.number("value")).transpose()?.flatten();
    Ok(Component {
        base: base(node)?,
        content,
        source: source_of(node)?,
        implementation,
        step_size: step_size.filter(|size| *size > 0.0),
    })
}

/// Returns the source of a component; empty if the attribute is absent. An empty attribute is an error.
fn source_of(node: &Node) -> Result<String, SspError> {
    match node.attribute("source") {
        Some("") => Err(node.wrong("the path of a file in the attribute source", "nothing")),
        source => Ok(source.unwrap_or_default().to_owned()),
    }
}

fn dictionary_reference(node: &Node) -> Result<DictionaryReference, SspError> {
    let dictionary = node.required("dictionary")?.to_owned();
    Ok(DictionaryReference { base: base(node)?, dictionary })
}

fn connector(node: &Node) -> Result<Connector, SspError> {
    let stated = node.required("kind")?;
    let kind = ConnectorKind::named(stated).ok_or_else(|| {
        let names = ConnectorKind::ALL.map(ConnectorKind::as_str).join(", ");
        node.wrong(format!("one of the kinds {names}"), format!("{stated:?}"))
    })?;
    let name = node.required("name")?.to_owned();
    Ok(Connector { name, kind, kind_of_value: value_type(node)? })
}

fn connection(node: &Node) -> Result<Connection, SspError> {
    if let Some(name) =
        ["startIndices", "endIndices"].into_iter().find(|name| node.attribute(name).is_some())
    {
        let expected = "a connection of scalars, as FMI 2.0 has no arrays";
        return Err(node.wrong(expected, format!("the attribute {name}")));
    }
    let end = |element: &str, connector: &str| {
        let connector = node.required(connector)?.to_owned();
        // Some tools write an empty element name for the system itself.
        Ok::<_, SspError>(End { element: node.stated(element), connector })
    };
    Ok(Connection {
        start: end("startElement", "startConnector")?,
        end: end("endElement", "endConnector")?,
        conversion: conversion(node)?,
        at: Place(node.at),
    })
}

fn binding(node: &Node) -> Result<ParameterBinding, SspError> {
    media_type(node, "application/x-ssp-parameter-set")?;
    let inline = node.child("ParameterValues")?;
    let mapping = node.child("ParameterMapping")?;
    Ok(ParameterBinding {
        prefix: node.text("prefix").unwrap_or_default(),
        values: source(node, inline, "ParameterSet", parameter_set)?,
        mapping: mapping
            .map(|mapping| {
                media_type(mapping, "application/x-ssp-parameter-mapping")?;
                source(mapping, Some(mapping), "ParameterMapping", parameter_mapping)
            })
            .transpose()?,
        at: Place(node.at),
    })
}

fn dictionary(node: &Node) -> Result<DictionarySource, SspError> {
    media_type(node, "application/x-ssp-signal-dictionary")?;
    Ok(DictionarySource {
        name: node.required("name")?.to_owned(),
        content: source(node, Some(node), "SignalDictionary", signal_dictionary)?,
        at: Place(node.at),
    })
}

fn media_type(node: &Node, known: &str) -> Result<(), SspError> {
    match node.attribute("type") {
        Some(other) if other != known => {
            Err(node.wrong(format!("the type {known}"), format!("{other:?}")))
        }
        _ => Ok(()),
    }
}

/// Reads the URI in the attribute `source` of `node`, or the element `content` of `inline`. Returns an error if
/// both or neither are stated.
fn source<T>(
    node: &Node,
    inline: Option<&Node>,
    content: &str,
    read: impl Fn(&Node) -> Result<T, SspError>,
) -> Result<Source<T>, SspError> {
    let in_component = match node.attribute("sourceBase") {
        None | Some("SSD") => false,
        Some("component") => true,
        Some(other) => {
            return Err(node.wrong("the sourceBase SSD or component", format!("{other:?}")));
        }
    };
    let inline = inline.map(|inline| inline.child(content)).transpose()?.flatten();
    match (node.attribute("source").filter(|uri| !uri.is_empty()), inline) {
        (Some(uri), None) => Ok(Source::File { uri: uri.to_owned(), in_component }),
        (None, Some(inline)) => Ok(Source::Inline(read(inline)?)),
        (Some(_), Some(_)) => Err(node.wrong("a source or content", "both")),
        (None, None) => Err(node.wrong(format!("a source or an element {content}"), "neither")),
    }
}

pub(super) fn experiment(node: &Node) -> Result<DefaultExperiment, SspError> {
    let algorithm = annotation(node)?.and_then(|content| content.any_child("Algorithm"));
    let fixed = algorithm.and_then(|algorithm| algorithm.any_child("FixedStepAlgorithm"));
    let step_size = fixed.map(|fixed| fixed.number("baseStepSize")).transpose()?.flatten();
    let experiment = DefaultExperiment {
        start_time: node.number("startTime")?,
        stop_time: node.number("stopTime")?,
        step_size: step_size.filter(|size| *size > 0.0),
    };
    if let (Some(start), Some(stop)) = (experiment.start_time, experiment.stop_time)
        && stop < start
    {
        return Err(node.wrong(format!("a stopTime of at least {start}"), stop.to_string()));
    }
    Ok(experiment)
}

/// Returns the first annotation of the Open Simulation Platform, if there is one.
fn annotation(node: &Node) -> Result<Option<&Node>, SspError> {
    let list = node.child("Annotations")?.into_iter().flat_map(Node::ssp_children);
    let is_osp =
        |annotation: &&Node| annotation.attribute("type") == Some(OPEN_SIMULATION_PLATFORM);
    Ok(list.into_iter().find(is_osp))
}
