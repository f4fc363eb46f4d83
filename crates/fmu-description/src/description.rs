//! The content of `modelDescription.xml` as plain data, for exporters and importers: one structure for
//! FMI 1.0, FMI 2.0.5 (section 2.2) and FMI 3.0.2 (section 2.4).

mod guid;
mod interface;
mod kind;
mod model_structure;
mod native_type;
mod parse;
mod render;
mod rules;
#[cfg(test)]
pub(crate) mod sample;
mod variable;
mod version;
mod words;

pub use crate::defect::{ParseError, Position, Warning};
pub use guid::Guid;
pub(crate) use interface::attributes;
pub use interface::{CoSimulation, ModelExchange, ScheduledExecution};
pub use kind::{
    BinaryType, ClockType, IntegerType, IntervalVariability, Kind, RealType, SimpleType,
};
pub use model_structure::{ModelStructure, Unknown};
pub use native_type::NativeType;
pub(crate) use render::{Output, Tag};
pub use rules::{Problem, array_element, is_structured_name, misplaced_elements};
pub use variable::{Dimension, Elements, ScalarVariable};
pub use version::Version;
pub use words::{Causality, DependencyKind, Initial, Variability};

use serde::Serialize;

use crate::hash_form::{is_default, numbered};
use crate::terminal::Terminal;
use crate::unit::Unit;

/// `fmiModelDescription`, the root element.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub struct ModelDescription {
    /// `fmiVersion`: `"1.0"`, `"2.0"` for every 2.0.x, `"3.0"` for every 3.x.
    pub fmi_version: String,
    pub model_name: String,
    /// `guid`, in FMI 3.0 `instantiationToken`: the string that must be equal in the XML and in the
    /// binary. The crate `fmu` sets it to [`Guid::of`] the description, which is why the serialised form
    /// does not contain it.
    #[serde(skip)]
    pub guid: String,
    pub description: Option<String>,
    pub author: Option<String>,
    /// `version` of the model.
    pub version: Option<String>,
    pub copyright: Option<String>,
    pub license: Option<String>,
    pub generation_tool: Option<String>,
    /// `generationDateAndTime`, `YYYY-MM-DDThh:mm:ssZ`.
    pub generation_date_and_time: Option<String>,
    /// `variableNamingConvention`: `true` for `structured`, `false` for `flat`.
    pub structured_names: bool,
    /// `numberOfEventIndicators` (model exchange, FMI 1.0 and 2.0). FMI 3.0 lists the variables in
    /// `structure`.
    pub number_of_event_indicators: Option<u32>,
    /// `ModelExchange`, if the FMU has this interface.
    pub model_exchange: Option<ModelExchange>,
    /// `CoSimulation`, if the FMU has this interface.
    pub co_simulation: Option<CoSimulation>,
    /// `UnitDefinitions`.
    pub units: Vec<Unit>,
    /// `TypeDefinitions`.
    pub types: Vec<SimpleType>,
    pub log_categories: Vec<LogCategory>,
    pub default_experiment: Option<DefaultExperiment>,
    /// `ModelVariables`, in order: position + 1 is the index used by `structure`.
    pub variables: Vec<ScalarVariable>,
    /// `ModelStructure`.
    pub structure: ModelStructure,
    /// `ScheduledExecution` (FMI 3.0), if the FMU has this interface.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<1, _, _>")]
    pub scheduled_execution: Option<ScheduledExecution>,
    /// The terminals of FMI 3.0, from `terminalsAndIcons.xml`.
    #[serde(skip)]
    pub terminals: Vec<Terminal>,
    /// `isBusSimulationFMU` in the manifest of FMI-LS-BUS 1.0: whether the FMU is a bus to which others are connected.
    #[serde(skip)]
    pub is_bus_simulation: bool,
}

impl ModelDescription {
    /// Finds the first variable called `name`.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&ScalarVariable> {
        self.variables.iter().find(|variable| variable.name == name)
    }

    /// Returns the interface for communication steps: `co_simulation` or, without it, the flags of
    /// `scheduled_execution` with variable step size and event mode. `None` if the FMU has neither.
    #[must_use]
    pub fn stepped(&self) -> Option<CoSimulation> {
        let scheduled = || {
            let flags = self.scheduled_execution.as_ref()?;
            Some(CoSimulation {
                model_identifier: flags.model_identifier.clone(),
                needs_execution_tool: flags.needs_execution_tool,
                can_handle_variable_communication_step_size: true,
                can_be_instantiated_only_once_per_process: flags
                    .can_be_instantiated_only_once_per_process,
                can_get_and_set_fmu_state: flags.can_get_and_set_fmu_state,
                can_serialize_fmu_state: flags.can_serialize_fmu_state,
                provides_directional_derivative: flags.provides_directional_derivative,
                has_event_mode: true,
                ..CoSimulation::default()
            })
        };
        self.co_simulation.clone().or_else(scheduled)
    }

    /// Returns the variable with a 1-based index, the form in `structure`, `derivative`, `previous` and `clocks`;
    /// `None` for 0 and beyond the last variable.
    #[must_use]
    pub fn at(&self, index: u32) -> Option<&ScalarVariable> {
        self.variables.get(usize::try_from(index).ok()?.checked_sub(1)?)
    }
}

/// `Category` of `LogCategories`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub struct LogCategory {
    pub name: String,
    pub description: Option<String>,
}

/// `DefaultExperiment`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DefaultExperiment {
    /// `startTime` in s.
    pub start_time: Option<f64>,
    /// `stopTime` in s.
    pub stop_time: Option<f64>,
    /// `tolerance`, relative.
    pub tolerance: Option<f64>,
    /// `stepSize` in s: the preferred communication step.
    pub step_size: Option<f64>,
}

impl DefaultExperiment {
    /// Returns the tolerance if an importer may pass it to the FMU: finite and above 0.
    #[must_use]
    pub fn usable_tolerance(&self) -> Option<f64> {
        self.tolerance.filter(|tolerance| *tolerance > 0.0 && tolerance.is_finite())
    }
}
