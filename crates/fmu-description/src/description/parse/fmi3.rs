//! Reads a model description of FMI 3.0.

mod kinds;
mod start;
mod structure;
mod variables;

use super::attributes::{Attribute, Node, Result, read_attributes};
use super::definitions::common;
use super::schema;
use crate::description::{
    CoSimulation, ModelDescription, ModelExchange, ScheduledExecution, Version, attributes,
};

pub(super) fn root(root: Node<'_>) -> Result<ModelDescription> {
    schema::check(root, Version::V3);
    let types = kinds::types(root)?;
    let (variables, references) = variables::read(root.child("ModelVariables")?, &types)?;
    let structure = structure::read(root, &variables, &references)?;
    let model_exchange = root.optional("ModelExchange", model_exchange)?;
    let co_simulation = root.optional("CoSimulation", co_simulation)?;
    let scheduled_execution = root.optional("ScheduledExecution", scheduled_execution)?;
    let identifiers = [
        co_simulation.as_ref().map(|flags| &flags.model_identifier),
        model_exchange.as_ref().map(|flags| &flags.model_identifier),
        scheduled_execution.as_ref().map(|flags| &flags.model_identifier),
    ];
    let identifier = identifiers.into_iter().flatten().next().cloned().unwrap_or_default();
    Ok(ModelDescription {
        guid: root.required("instantiationToken")?.to_owned(),
        model_exchange,
        co_simulation,
        types,
        variables,
        structure,
        scheduled_execution,
        ..common(root, identifier)?
    })
}

fn model_exchange(element: Node<'_>) -> Result<ModelExchange> {
    let model_identifier = element.model_identifier()?;
    let mut flags = ModelExchange { model_identifier, ..ModelExchange::default() };
    attributes!(COMMON_3, read_attributes!(element, flags));
    attributes!(MODEL_EXCHANGE_3, read_attributes!(element, flags));
    flags.completed_integrator_step_not_needed = !flags.needs_completed_integrator_step;
    Ok(flags)
}

fn co_simulation(element: Node<'_>) -> Result<CoSimulation> {
    let model_identifier = element.model_identifier()?;
    let mut flags = CoSimulation { model_identifier, ..CoSimulation::default() };
    attributes!(COMMON_3, read_attributes!(element, flags));
    attributes!(CO_SIMULATION_3, read_attributes!(element, flags));
    Ok(flags)
}

fn scheduled_execution(element: Node<'_>) -> Result<ScheduledExecution> {
    let model_identifier = element.model_identifier()?;
    let mut flags = ScheduledExecution { model_identifier, ..ScheduledExecution::default() };
    attributes!(COMMON_3, read_attributes!(element, flags));
    Ok(flags)
}
