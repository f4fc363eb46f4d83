//! Reads a model description of FMI 1.0.

mod variables;

use super::attributes::{Attribute, Node, Result, read_attributes};
use super::definitions::{experiment, general};
use super::schema;
use super::variables::kind_of_type;
use crate::description::{CoSimulation, ModelDescription, ModelExchange, SimpleType, Version};
use crate::unit::{DisplayUnit, Unit};

pub(super) fn root(root: Node<'_>) -> Result<ModelDescription> {
    schema::check(root, Version::V1);
    let identifier = root.model_identifier()?;
    let types = root.list("TypeDefinitions", "Type", simple_type)?;
    let variables = root.optional("ModelVariables", |list| variables::read(list, &types))?;
    let (variables, structure) = variables.unwrap_or_default();
    let co_simulation =
        root.optional("Implementation", |element| co_simulation(element, identifier.clone()))?;
    let model_exchange = co_simulation.is_none().then(|| ModelExchange {
        model_identifier: identifier.clone(),
        number_of_continuous_states: root
            .optional_unsigned("numberOfContinuousStates")
            .unwrap_or(0),
        ..ModelExchange::default()
    });
    // Read before the units, because only the first warnings are kept.
    let general = general(root, identifier);
    Ok(ModelDescription {
        guid: root.required("guid")?.to_owned(),
        model_exchange,
        co_simulation,
        units: root.list("UnitDefinitions", "BaseUnit", unit)?,
        types,
        default_experiment: root.optional("DefaultExperiment", experiment)?,
        variables,
        structure,
        ..general
    })
}

/// Reads a `BaseUnit`, which in FMI 1.0 has display units but no conversion to SI base units.
fn unit(element: Node<'_>) -> Result<Unit> {
    let display_units = element.children_named("DisplayUnitDefinition").map(|display| {
        Ok(DisplayUnit {
            name: display.required("displayUnit")?.to_owned(),
            factor: display.finite("gain", 1.0)?,
            offset: display.finite("offset", 0.0)?,
            inverse: false,
        })
    });
    Ok(Unit {
        name: element.required("unit")?.to_owned(),
        display_units: display_units.collect::<Result<_>>()?,
        base: None,
    })
}

fn simple_type(element: Node<'_>) -> Result<SimpleType> {
    let mut kinds = element.children().filter(|child| child.element.name.ends_with("Type"));
    let Some(element_of_kind) = kinds.next() else {
        let expected = "RealType, IntegerType, BooleanType, StringType or EnumerationType";
        return Err(element.child_error(expected, "none".to_owned()));
    };
    let name = element_of_kind.element.name.strip_suffix("Type").unwrap_or_default();
    // The items of an enumeration are numbered from 1.
    let items = (1..).zip(element_of_kind.children_named("Item"));
    let items = items.map(|(value, item)| Ok((item.required("name")?.to_owned(), value)));
    Ok(SimpleType {
        name: element.required("name")?.to_owned(),
        description: element.text("description"),
        kind: kind_of_type(element_of_kind, name)?,
        items: items.collect::<Result<_>>()?,
    })
}

/// Reads `Implementation`: `CoSimulation_StandAlone`, or `CoSimulation_Tool`, which needs an execution tool.
fn co_simulation(implementation: Node<'_>, model_identifier: String) -> Result<CoSimulation> {
    let stand_alone = implementation.optional_child("CoSimulation_StandAlone")?;
    let tool = implementation.optional_child("CoSimulation_Tool")?;
    let Some(interface) = stand_alone.or(tool) else {
        let expected = "CoSimulation_StandAlone or CoSimulation_Tool";
        return Err(implementation.child_error(expected, "neither".to_owned()));
    };
    let mut flags = CoSimulation {
        model_identifier,
        needs_execution_tool: stand_alone.is_none(),
        ..CoSimulation::default()
    };
    let Some(capabilities) = interface.optional_child("Capabilities")? else {
        let place = format!("<{}>", interface.element.name);
        let (expected, assumed) = ("an element Capabilities", "read without capabilities");
        interface.warn_of(true, place, expected, "none".to_owned(), assumed);
        return Ok(flags);
    };
    read_attributes! { (capabilities, flags)
        "canHandleVariableCommunicationStepSize" can_handle_variable_communication_step_size,
        "canInterpolateInputs" can_interpolate_inputs,
        "maxOutputDerivativeOrder" max_output_derivative_order,
        "canRunAsynchronuously" can_run_asynchronuously,
        "canBeInstantiatedOnlyOncePerProcess" can_be_instantiated_only_once_per_process,
        "canNotUseMemoryManagementFunctions" can_not_use_memory_management_functions,
        "canRejectSteps" can_reject_steps,
        "canHandleEvents" can_handle_events,
    }
    Ok(flags)
}
