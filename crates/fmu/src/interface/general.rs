//! The general part of a model description.

use crate::model::{About, Model};
use fmu_description::unit::Unit;
use fmu_description::{CoSimulation, LogCategory, ModelDescription, ModelExchange};

/// Log categories of every exported FMU, with the standardised names of section 2.2.4.
const CATEGORIES: [(&str, &str); 4] = [
    ("logEvents", "Events of the model, such as one at which it wants the simulation to end"),
    ("logStatusDiscard", "Calls that were refused without harm"),
    ("logStatusError", "Calls that failed; the instance has to be reset or restored"),
    ("logStatusFatal", "Calls after which the instance is lost"),
];

/// The category of the warnings of a model.
pub(crate) const WARNING: &str = "logStatusWarning";

/// Returns the log categories of an FMU: the categories of every FMU, the category of warnings if the model `logs`, and
/// the model's own categories, `of_model`.
pub(super) fn categories(logs: bool, of_model: &[(&str, &str)]) -> Vec<LogCategory> {
    let warning = logs.then_some((WARNING, "Calls that succeeded, with a warning of the model"));
    let category = |(name, description): (&str, &str)| LogCategory {
        name: name.to_owned(),
        description: Some(description.to_owned()),
    };
    CATEGORIES.into_iter().chain(warning).chain(of_model.iter().copied()).map(category).collect()
}

/// Returns the general part of the description of FMI 2.0 of a model.
pub(super) fn general<M: Model>(model: &M) -> ModelDescription {
    let indicators = model.model_exchange().map(|interface| interface.event_indicators);
    description(M::IDENTIFIER, model.about(), indicators, M::PROVIDES_DIRECTIONAL_DERIVATIVE)
}

/// Returns the general part of a model description. `indicators` is the number of event indicators; `None` if the
/// model has no model exchange.
fn description(
    identifier: &str,
    about: About,
    indicators: Option<usize>,
    provides_directional_derivative: bool,
) -> ModelDescription {
    let text = |text: String| (!text.is_empty()).then_some(text);
    ModelDescription {
        fmi_version: "2.0".to_owned(),
        model_name: identifier.to_owned(),
        description: text(about.description),
        author: text(about.author),
        version: text(about.version),
        license: text(about.license),
        generation_tool: Some(concat!("aso-ftc ", env!("CARGO_PKG_VERSION")).to_owned()),
        structured_names: true,
        number_of_event_indicators: indicators
            .map(|count| u32::try_from(count).unwrap_or(u32::MAX)),
        model_exchange: indicators.map(|_| ModelExchange {
            model_identifier: identifier.to_owned(),
            completed_integrator_step_not_needed: true,
            can_not_use_memory_management_functions: true,
            can_get_and_set_fmu_state: true,
            can_serialize_fmu_state: true,
            provides_directional_derivative,
            ..ModelExchange::default()
        }),
        co_simulation: Some(CoSimulation {
            model_identifier: identifier.to_owned(),
            can_handle_variable_communication_step_size: true,
            can_not_use_memory_management_functions: true,
            can_get_and_set_fmu_state: true,
            can_serialize_fmu_state: true,
            provides_directional_derivative,
            ..CoSimulation::default()
        }),
        units: Unit::parse("s").into_iter().collect(),
        default_experiment: Some(about.default_experiment),
        ..ModelDescription::default()
    }
}
