//! Reads a model description of FMI 2.0.

use super::attributes::{Node, Result};
use super::definitions::common;
use super::{schema, structure, variables};
use crate::description::{CoSimulation, ModelDescription, ModelExchange, Version};

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
    let flag = |name| element.flag(name);
    Ok(ModelExchange {
        model_identifier: element.model_identifier()?,
        needs_execution_tool: flag("needsExecutionTool"),
        completed_integrator_step_not_needed: flag("completedIntegratorStepNotNeeded"),
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUstate"),
        can_serialize_fmu_state: flag("canSerializeFMUstate"),
        provides_directional_derivative: flag("providesDirectionalDerivative"),
        source_files: source_files(element)?,
        ..ModelExchange::default()
    })
}

fn co_simulation(element: Node<'_>) -> Result<CoSimulation> {
    let flag = |name| element.flag(name);
    Ok(CoSimulation {
        model_identifier: element.model_identifier()?,
        needs_execution_tool: flag("needsExecutionTool"),
        can_handle_variable_communication_step_size: flag("canHandleVariableCommunicationStepSize"),
        can_interpolate_inputs: flag("canInterpolateInputs"),
        max_output_derivative_order: element
            .optional_unsigned("maxOutputDerivativeOrder")
            .unwrap_or(0),
        can_run_asynchronuously: flag("canRunAsynchronuously"),
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUstate"),
        can_serialize_fmu_state: flag("canSerializeFMUstate"),
        provides_directional_derivative: flag("providesDirectionalDerivative"),
        source_files: source_files(element)?,
        ..CoSimulation::default()
    })
}
