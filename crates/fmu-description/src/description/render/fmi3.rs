//! Renders a model description in the schema of FMI 3.0.2.

mod variables;

use super::tag::Tag;
use super::{Output, integer_limits};
use crate::description::{
    CoSimulation, Kind, ModelDescription, ModelExchange, RealType, ScheduledExecution, SimpleType,
    Unknown, Version,
};

impl Output {
    pub(super) fn root_3(&mut self, description: &ModelDescription) {
        let naming = description.structured_names.then_some("structured");
        let date = description.generation_date_and_time.as_ref();
        let tag = Tag::new("fmiModelDescription")
            .with("fmiVersion", &description.fmi_version)
            .with("modelName", &description.model_name)
            .with("instantiationToken", &description.guid)
            .maybe("description", description.description.as_ref())
            .maybe("author", description.author.as_ref())
            .maybe("version", description.version.as_ref())
            .maybe("copyright", description.copyright.as_ref())
            .maybe("license", description.license.as_ref())
            .maybe("generationTool", description.generation_tool.as_ref())
            .maybe("generationDateAndTime", date)
            .maybe("variableNamingConvention", naming);
        self.around(tag, |output| {
            if let Some(flags) = &description.model_exchange {
                output.empty(model_exchange(flags));
            }
            if let Some(flags) = &description.co_simulation {
                output.empty(co_simulation(flags));
            }
            if let Some(flags) = &description.scheduled_execution {
                output.empty(scheduled_execution(flags));
            }
            output.list("UnitDefinitions", &description.units, Self::unit);
            output.list("TypeDefinitions", &description.types, Self::type_definition);
            output.list("LogCategories", &description.log_categories, Self::category);
            if let Some(experiment) = &description.default_experiment {
                output.experiment(experiment);
            }
            output.around(Tag::new("ModelVariables"), |output| output.variables_3(description));
            output.structure_3(description);
        });
    }

    fn type_definition(&mut self, declared: &SimpleType) {
        let element = format!("{}Type", declared.kind.element_in(Version::V3));
        let tag = Tag::new(&element)
            .with("name", &declared.name)
            .maybe("description", declared.description.as_ref());
        let tag = attributes(tag, &declared.kind);
        if declared.items.is_empty() {
            return self.empty(tag);
        }
        self.around(tag, |output| {
            for (name, value) in &declared.items {
                output.empty(Tag::new("Item").with("name", name).with("value", value));
            }
        });
    }

    fn structure_3(&mut self, description: &ModelDescription) {
        let structure = &description.structure;
        let rows = [
            ("Output", &structure.outputs),
            ("ContinuousStateDerivative", &structure.derivatives),
            ("ClockedState", &structure.clocked_states),
            ("InitialUnknown", &structure.initial_unknowns),
            ("EventIndicator", &structure.event_indicators),
        ];
        if rows.iter().all(|(_, rows)| rows.is_empty()) {
            return self.empty(Tag::new("ModelStructure"));
        }
        self.around(Tag::new("ModelStructure"), |output| {
            for (name, rows) in rows {
                for row in rows {
                    output.empty(unknown(name, row, description));
                }
            }
        });
    }
}

/// Returns the value reference of the variable with a 1-based index, 0 if there is none.
fn reference(description: &ModelDescription, index: u32) -> u32 {
    description.at(index).map(|variable| variable.value_reference).unwrap_or_default()
}

fn references(description: &ModelDescription, indices: &[u32]) -> String {
    let words = indices.iter().map(|index| reference(description, *index).to_string());
    words.collect::<Vec<_>>().join(" ")
}

fn unknown<'a>(name: &'a str, row: &Unknown, description: &ModelDescription) -> Tag<'a> {
    let dependencies = row.dependencies.as_ref().map(|indices| references(description, indices));
    let kinds = row
        .kinds
        .as_ref()
        .map(|kinds| kinds.iter().map(|kind| kind.as_str()).collect::<Vec<_>>().join(" "));
    Tag::new(name)
        .with("valueReference", &reference(description, row.index))
        .maybe("dependencies", dependencies.as_ref())
        .maybe("dependenciesKind", kinds.as_ref())
}

/// Adds the attributes that a type and a variable have in common.
fn attributes<'a>(tag: Tag<'a>, kind: &Kind) -> Tag<'a> {
    match kind {
        Kind::Real(real) => real_limits(tag, real, |value| format!("{value:?}")),
        Kind::Float32(real) => real_limits(tag, real, single),
        Kind::Boolean(_) | Kind::String(_) => tag,
        Kind::Binary(binary) => tag
            .maybe("mimeType", binary.mime_type.as_ref())
            .maybe("maxSize", binary.max_size.as_ref()),
        Kind::Clock(clock) => tag
            .unless_default("canBeDeactivated", &clock.can_be_deactivated)
            .maybe("priority", clock.priority.as_ref())
            .with("intervalVariability", clock.interval_variability.as_str())
            .maybe("intervalDecimal", clock.interval_decimal.as_ref())
            .maybe("shiftDecimal", clock.shift_decimal.as_ref())
            .unless_default("supportsFraction", &clock.supports_fraction)
            .maybe("resolution", clock.resolution.as_ref())
            .maybe("intervalCounter", clock.interval_counter.as_ref())
            .maybe("shiftCounter", clock.shift_counter.as_ref()),
        other => match other.as_integer() {
            Some(integer) => integer_limits(tag, integer),
            None => tag,
        },
    }
}

fn real_limits<'a>(tag: Tag<'a>, real: &RealType, text: fn(f64) -> String) -> Tag<'a> {
    tag.maybe("quantity", real.quantity.as_ref())
        .maybe("unit", real.unit.as_ref())
        .maybe("displayUnit", real.display_unit.as_ref())
        .maybe("min", real.min.map(text).as_ref())
        .maybe("max", real.max.map(text).as_ref())
        .maybe("nominal", real.nominal.map(text).as_ref())
}

/// The shortest text of a Float32 that reads back to the same bits.
#[expect(clippy::cast_possible_truncation, reason = "the numbers of a Float32 are those of an f32")]
fn single(value: f64) -> String {
    format!("{:?}", value as f32)
}

fn model_exchange(flags: &ModelExchange) -> Tag<'_> {
    let only_once = &flags.can_be_instantiated_only_once_per_process;
    let elements = &flags.provides_per_element_dependencies;
    Tag::new("ModelExchange")
        .with("modelIdentifier", &flags.model_identifier)
        .unless_default("needsExecutionTool", &flags.needs_execution_tool)
        .unless_default("canBeInstantiatedOnlyOncePerProcess", only_once)
        .unless_default("canGetAndSetFMUState", &flags.can_get_and_set_fmu_state)
        .unless_default("canSerializeFMUState", &flags.can_serialize_fmu_state)
        .unless_default("providesDirectionalDerivatives", &flags.provides_directional_derivative)
        .unless_default("providesAdjointDerivatives", &flags.provides_adjoint_derivatives)
        .unless_default("providesPerElementDependencies", elements)
        .unless_default("needsCompletedIntegratorStep", &flags.needs_completed_integrator_step)
        .unless_default("providesEvaluateDiscreteStates", &flags.provides_evaluate_discrete_states)
}

fn co_simulation(flags: &CoSimulation) -> Tag<'_> {
    let only_once = &flags.can_be_instantiated_only_once_per_process;
    let elements = &flags.provides_per_element_dependencies;
    let variable_step = &flags.can_handle_variable_communication_step_size;
    let smoothness = &flags.recommended_intermediate_input_smoothness;
    let after_update = &flags.can_return_early_after_intermediate_update;
    Tag::new("CoSimulation")
        .with("modelIdentifier", &flags.model_identifier)
        .unless_default("needsExecutionTool", &flags.needs_execution_tool)
        .unless_default("canBeInstantiatedOnlyOncePerProcess", only_once)
        .unless_default("canGetAndSetFMUState", &flags.can_get_and_set_fmu_state)
        .unless_default("canSerializeFMUState", &flags.can_serialize_fmu_state)
        .unless_default("providesDirectionalDerivatives", &flags.provides_directional_derivative)
        .unless_default("providesAdjointDerivatives", &flags.provides_adjoint_derivatives)
        .unless_default("providesPerElementDependencies", elements)
        .unless_default("canHandleVariableCommunicationStepSize", variable_step)
        .maybe("fixedInternalStepSize", flags.fixed_internal_step_size.as_ref())
        .unless_default("maxOutputDerivativeOrder", &flags.max_output_derivative_order)
        .unless_default("recommendedIntermediateInputSmoothness", smoothness)
        .unless_default("providesIntermediateUpdate", &flags.provides_intermediate_update)
        .unless_default("mightReturnEarlyFromDoStep", &flags.might_return_early_from_do_step)
        .unless_default("canReturnEarlyAfterIntermediateUpdate", after_update)
        .unless_default("hasEventMode", &flags.has_event_mode)
        .unless_default("providesEvaluateDiscreteStates", &flags.provides_evaluate_discrete_states)
}

fn scheduled_execution(flags: &ScheduledExecution) -> Tag<'_> {
    let only_once = &flags.can_be_instantiated_only_once_per_process;
    let elements = &flags.provides_per_element_dependencies;
    Tag::new("ScheduledExecution")
        .with("modelIdentifier", &flags.model_identifier)
        .unless_default("needsExecutionTool", &flags.needs_execution_tool)
        .unless_default("canBeInstantiatedOnlyOncePerProcess", only_once)
        .unless_default("canGetAndSetFMUState", &flags.can_get_and_set_fmu_state)
        .unless_default("canSerializeFMUState", &flags.can_serialize_fmu_state)
        .unless_default("providesDirectionalDerivatives", &flags.provides_directional_derivative)
        .unless_default("providesAdjointDerivatives", &flags.provides_adjoint_derivatives)
        .unless_default("providesPerElementDependencies", elements)
}
