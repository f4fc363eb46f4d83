//! Reads a model description of FMI 3.0.

mod kinds;
mod start;
mod structure;
mod variables;

use super::attributes::Node;
use super::definitions::{category, experiment, structured_names, unit};
use super::schema;
use crate::defect::ParseError;
use crate::description::{
    CoSimulation, ModelDescription, ModelExchange, ScheduledExecution, Version,
};

pub(super) fn root(root: Node<'_>) -> Result<ModelDescription, ParseError> {
    schema::check(root, Version::V3);
    let types = kinds::types(root)?;
    let (variables, references) = variables::read(root.child("ModelVariables")?, &types)?;
    let structure = structure::read(root, &variables, &references)?;
    let optional = |name| root.optional_child(name);
    let model_exchange = optional("ModelExchange")?.map(model_exchange).transpose()?;
    let co_simulation = optional("CoSimulation")?.map(co_simulation).transpose()?;
    let scheduled = optional("ScheduledExecution")?.map(scheduled_execution).transpose()?;
    let identifiers = [
        co_simulation.as_ref().map(|flags| &flags.model_identifier),
        model_exchange.as_ref().map(|flags| &flags.model_identifier),
        scheduled.as_ref().map(|flags| &flags.model_identifier),
    ];
    let identifier = identifiers.into_iter().flatten().next().cloned();
    Ok(ModelDescription {
        fmi_version: Version::V3.as_str().to_owned(),
        model_name: root.text_or("modelName", identifier.unwrap_or_default()),
        guid: root.required("instantiationToken")?.to_owned(),
        description: root.text("description"),
        author: root.text("author"),
        version: root.text("version"),
        copyright: root.text("copyright"),
        license: root.text("license"),
        generation_tool: root.text("generationTool"),
        generation_date_and_time: root.text("generationDateAndTime"),
        structured_names: structured_names(root),
        number_of_event_indicators: None,
        model_exchange,
        co_simulation,
        units: root.list("UnitDefinitions", "Unit", unit)?,
        types,
        log_categories: root.list("LogCategories", "Category", category)?,
        default_experiment: optional("DefaultExperiment")?.map(experiment).transpose()?,
        variables,
        structure,
        scheduled_execution: scheduled,
        terminals: Vec::new(),
        is_bus_simulation: false,
    })
}

fn identifier(element: Node<'_>) -> Result<String, ParseError> {
    Ok(element.required("modelIdentifier")?.to_owned())
}

fn model_exchange(element: Node<'_>) -> Result<ModelExchange, ParseError> {
    let flag = |name| element.flag(name);
    let completed = flag("needsCompletedIntegratorStep");
    Ok(ModelExchange {
        model_identifier: identifier(element)?,
        needs_execution_tool: flag("needsExecutionTool"),
        completed_integrator_step_not_needed: !completed,
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUState"),
        can_serialize_fmu_state: flag("canSerializeFMUState"),
        provides_directional_derivative: flag("providesDirectionalDerivatives"),
        needs_completed_integrator_step: completed,
        provides_evaluate_discrete_states: flag("providesEvaluateDiscreteStates"),
        provides_adjoint_derivatives: flag("providesAdjointDerivatives"),
        provides_per_element_dependencies: flag("providesPerElementDependencies"),
        ..ModelExchange::default()
    })
}

fn co_simulation(element: Node<'_>) -> Result<CoSimulation, ParseError> {
    let flag = |name| element.flag(name);
    Ok(CoSimulation {
        model_identifier: identifier(element)?,
        needs_execution_tool: flag("needsExecutionTool"),
        can_handle_variable_communication_step_size: flag("canHandleVariableCommunicationStepSize"),
        max_output_derivative_order: element
            .optional_unsigned("maxOutputDerivativeOrder")
            .unwrap_or(0),
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUState"),
        can_serialize_fmu_state: flag("canSerializeFMUState"),
        provides_directional_derivative: flag("providesDirectionalDerivatives"),
        has_event_mode: flag("hasEventMode"),
        might_return_early_from_do_step: flag("mightReturnEarlyFromDoStep"),
        can_return_early_after_intermediate_update: flag("canReturnEarlyAfterIntermediateUpdate"),
        provides_intermediate_update: flag("providesIntermediateUpdate"),
        fixed_internal_step_size: element.number("fixedInternalStepSize")?,
        recommended_intermediate_input_smoothness: element
            .integer("recommendedIntermediateInputSmoothness")?
            .unwrap_or(0),
        provides_evaluate_discrete_states: flag("providesEvaluateDiscreteStates"),
        provides_adjoint_derivatives: flag("providesAdjointDerivatives"),
        provides_per_element_dependencies: flag("providesPerElementDependencies"),
        ..CoSimulation::default()
    })
}

fn scheduled_execution(element: Node<'_>) -> Result<ScheduledExecution, ParseError> {
    let flag = |name| element.flag(name);
    Ok(ScheduledExecution {
        model_identifier: identifier(element)?,
        needs_execution_tool: flag("needsExecutionTool"),
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUState"),
        can_serialize_fmu_state: flag("canSerializeFMUState"),
        provides_directional_derivative: flag("providesDirectionalDerivatives"),
        provides_adjoint_derivatives: flag("providesAdjointDerivatives"),
        provides_per_element_dependencies: flag("providesPerElementDependencies"),
    })
}
