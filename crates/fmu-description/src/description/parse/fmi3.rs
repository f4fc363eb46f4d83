//! Reads a model description of FMI 3.0.

mod kinds;
mod start;
mod structure;
mod variables;

use super::attributes::{Node, Result};
use super::definitions::common;
use super::schema;
use crate::description::{
    CoSimulation, ModelDescription, ModelExchange, ScheduledExecution, Version,
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
    let flag = |name| element.flag(name);
    let completed = flag("needsCompletedIntegratorStep");
    Ok(ModelExchange {
        model_identifier: element.model_identifier()?,
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

fn co_simulation(element: Node<'_>) -> Result<CoSimulation> {
    let flag = |name| element.flag(name);
    Ok(CoSimulation {
        model_identifier: element.model_identifier()?,
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

fn scheduled_execution(element: Node<'_>) -> Result<ScheduledExecution> {
    let flag = |name| element.flag(name);
    Ok(ScheduledExecution {
        model_identifier: element.model_identifier()?,
        needs_execution_tool: flag("needsExecutionTool"),
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUState"),
        can_serialize_fmu_state: flag("canSerializeFMUState"),
        provides_directional_derivative: flag("providesDirectionalDerivatives"),
        provides_adjoint_derivatives: flag("providesAdjointDerivatives"),
        provides_per_element_dependencies: flag("providesPerElementDependencies"),
    })
}
