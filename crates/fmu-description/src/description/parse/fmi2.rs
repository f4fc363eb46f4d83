//! Reads a model description of FMI 2.0.

use super::attributes::{Attribute, Node, Result, read_attributes};
use super::definitions::common;
use super::{schema, structure, variables};
use crate::description::{CoSimulation, ModelDescription, ModelExchange, Version, attributes};

pub(super) fn root(root: Node<'_>) -> Result<ModelDescription> {
    version(root);
    schema::check(root, Version::V2);
    let types = variables::types(root)?;
    let variables = variables::variables(root.child("ModelVariables")?, &types)?;
    let structure = structure::read(root, &variables)?;
    let model_exchange = root.optional("ModelExchange", model_exchange)?;
    let co_simulation = root.optional("CoSimulation", co_simulation)?;
    let identifier = co_simulation.as_ref().map(|flags| &flags.model_identifier);
    let identifier = identifier.or(model_exchange.as_ref().map(|flags| &flags.model_identifier));
    let identifier = identifier.cloned().unwrap_or_default();
    Ok(ModelDescription {
        guid: root.required("guid")?.to_owned(),
        model_exchange,
        co_simulation,
        types,
        variables,
        structure,
        ..common(root, identifier)?
    })
}

/// Warns of a version other than 2.0, such as 2.0.5, which is read as 2.0.
fn version(root: Node<'_>) {
    if let Some(stated) = root.attribute("fmiVersion").filter(|stated| *stated != "2.0") {
        root.warn("fmiVersion", "2.0 for every 2.0.x", stated, "read as 2.0");
    }
}

fn source_files(element: Node<'_>) -> Result<Vec<String>> {
    element.list("SourceFiles", "File", |file| Ok(file.required("name")?.to_owned()))
}

fn model_exchange(element: Node<'_>) -> Result<ModelExchange> {
    let model_identifier = element.model_identifier()?;
    let mut flags = ModelExchange { model_identifier, ..ModelExchange::default() };
    attributes!(MODEL_EXCHANGE_2, read_attributes!(element, flags));
    attributes!(COMMON_2, read_attributes!(element, flags));
    flags.source_files = source_files(element)?;
    Ok(flags)
}

fn co_simulation(element: Node<'_>) -> Result<CoSimulation> {
    let model_identifier = element.model_identifier()?;
    let mut flags = CoSimulation { model_identifier, ..CoSimulation::default() };
    attributes!(CO_SIMULATION_2, read_attributes!(element, flags));
    attributes!(COMMON_2, read_attributes!(element, flags));
    flags.source_files = source_files(element)?;
    Ok(flags)
}
