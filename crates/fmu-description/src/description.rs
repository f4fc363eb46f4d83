//! The content of `modelDescription.xml` (FMI 2.0.5, section 2.2) as plain data, for exporters and
//! importers.

mod guid;
mod parse;
mod render;
mod rules;
#[cfg(test)]
pub(crate) mod sample;

pub use guid::Guid;
pub(crate) use parse::read_xml;
pub use parse::{ParseError, Position, Warning};
pub use rules::Problem;

use serde::Serialize;

use crate::unit::Unit;

/// `fmiModelDescription`, the root element (section 2.2.1).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ModelDescription {
    /// `fmiVersion`, `"2.0"` for every 2.0.x.
    pub fmi_version: String,
    /// `modelName`.
    pub model_name: String,
    /// `guid`: the string that must be equal in the XML and in the binary. It is a hash of the serialised
    /// description, which therefore does not contain it.
    #[serde(skip)]
    pub guid: String,
    /// `description`.
    pub description: Option<String>,
    /// `author`.
    pub author: Option<String>,
    /// `version` of the model.
    pub version: Option<String>,
    /// `copyright`.
    pub copyright: Option<String>,
    /// `license`.
    pub license: Option<String>,
    /// `generationTool`.
    pub generation_tool: Option<String>,
    /// `generationDateAndTime`, `YYYY-MM-DDThh:mm:ssZ`.
    pub generation_date_and_time: Option<String>,
    /// `variableNamingConvention`: `true` for `structured`, `false` for `flat`.
    pub structured_names: bool,
    /// `numberOfEventIndicators` (model exchange).
    pub number_of_event_indicators: Option<u32>,
    /// `ModelExchange`, if the FMU has this interface.
    pub model_exchange: Option<ModelExchange>,
    /// `CoSimulation`, if the FMU has this interface.
    pub co_simulation: Option<CoSimulation>,
    /// `UnitDefinitions` (section 2.2.2).
    pub units: Vec<Unit>,
    /// `TypeDefinitions` (section 2.2.3).
    pub types: Vec<SimpleType>,
    /// `LogCategories` (section 2.2.4).
    pub log_categories: Vec<LogCategory>,
    /// `DefaultExperiment` (section 2.2.5).
    pub default_experiment: Option<DefaultExperiment>,
    /// `ModelVariables` (section 2.2.7), in order: position + 1 is the index used by `structure`.
    pub variables: Vec<ScalarVariable>,
    /// `ModelStructure` (section 2.2.8).
    pub structure: ModelStructure,
}

impl ModelDescription {
    /// Finds the variable called `name`.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&ScalarVariable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

/// `ModelExchange`: identifier and capability flags (section 3.3.1).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "the flags of the standard, one for one")]
pub struct ModelExchange {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    /// `needsExecutionTool`.
    pub needs_execution_tool: bool,
    /// `completedIntegratorStepNotNeeded`.
    pub completed_integrator_step_not_needed: bool,
    /// `canBeInstantiatedOnlyOncePerProcess`.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `canNotUseMemoryManagementFunctions`.
    pub can_not_use_memory_management_functions: bool,
    /// `canGetAndSetFMUstate`.
    pub can_get_and_set_fmu_state: bool,
    /// `canSerializeFMUstate`.
    pub can_serialize_fmu_state: bool,
    /// `providesDirectionalDerivative`.
    pub provides_directional_derivative: bool,
    /// `SourceFiles`: names of files in `sources`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub source_files: Vec<String>,
}

/// `CoSimulation`: identifier and capability flags (section 4.3.1).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "the flags of the standard, one for one")]
pub struct CoSimulation {
    /// `modelIdentifier`: file name of the library, without extension.
    pub model_identifier: String,
    /// `needsExecutionTool`.
    pub needs_execution_tool: bool,
    /// `canHandleVariableCommunicationStepSize`.
    pub can_handle_variable_communication_step_size: bool,
    /// `canInterpolateInputs`: `fmi2SetRealInputDerivatives` has an effect.
    pub can_interpolate_inputs: bool,
    /// `maxOutputDerivativeOrder`.
    pub max_output_derivative_order: u32,
    /// `canRunAsynchronuously` (spelt as in the standard).
    pub can_run_asynchronuously: bool,
    /// `canBeInstantiatedOnlyOncePerProcess`.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `canNotUseMemoryManagementFunctions`.
    pub can_not_use_memory_management_functions: bool,
    /// `canGetAndSetFMUstate`.
    pub can_get_and_set_fmu_state: bool,
    /// `canSerializeFMUstate`.
    pub can_serialize_fmu_state: bool,
    /// `providesDirectionalDerivative`.
    pub provides_directional_derivative: bool,
    /// `SourceFiles`: names of files in `sources`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub source_files: Vec<String>,
}

/// `SimpleType` of `TypeDefinitions`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimpleType {
    /// `name`, unique, also different from the names of all variables.
    pub name: String,
    /// `description`.
    pub description: Option<String>,
    /// The type itself; `start`, `derivative` and `declared_type` stay empty.
    pub kind: Kind,
    /// Items of an enumeration: name and value.
    pub items: Vec<(String, i32)>,
}

/// `Category` of `LogCategories`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LogCategory {
    /// `name`.
    pub name: String,
    /// `description`.
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
    /// Returns the tolerance if it is valid for `fmi2SetupExperiment`: finite and above 0.
    #[must_use]
    pub fn usable_tolerance(&self) -> Option<f64> {
        self.tolerance.filter(|tolerance| *tolerance > 0.0 && tolerance.is_finite())
    }
}

/// `ScalarVariable`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScalarVariable {
    /// `name`, unique.
    pub name: String,
    /// `valueReference`, unique per base type except for aliases.
    pub value_reference: u32,
    /// `description`.
    pub description: Option<String>,
    /// `causality`; `local` if absent.
    pub causality: Causality,
    /// `variability`; `continuous` if absent, for every type.
    pub variability: Variability,
    /// `initial`; if absent, the default of the table in section 2.2.7 applies.
    pub initial: Option<Initial>,
    /// Type, with its attributes and start value.
    pub kind: Kind,
}

impl ScalarVariable {
    /// Returns the effective value of `initial`: the attribute, or the default of the table in section
    /// 2.2.7.
    #[must_use]
    pub fn initial_in_force(&self) -> Option<Initial> {
        use Causality::{Independent, Input, Parameter};
        self.initial.or(match (self.causality, self.variability) {
            (Input | Independent, _) => None,
            (Parameter, _) | (_, Variability::Constant) => Some(Initial::Exact),
            _ => Some(Initial::Calculated),
        })
    }
}

/// The type of a variable with the attributes that depend on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Kind {
    /// `Real`.
    Real(RealType),
    /// `Integer`.
    Integer(IntegerType),
    /// `Boolean` with its `start`.
    Boolean(Option<bool>),
    /// `String` with its `start`.
    String(Option<String>),
    /// `Enumeration` as an integer; the type `declared_type` has the names of its items.
    Enumeration(IntegerType),
}

impl Kind {
    /// Returns the name of the XML element.
    #[must_use]
    pub fn element(&self) -> &'static str {
        match self {
            Kind::Real(_) => "Real",
            Kind::Integer(_) => "Integer",
            Kind::Boolean(_) => "Boolean",
            Kind::String(_) => "String",
            Kind::Enumeration(_) => "Enumeration",
        }
    }
}

/// Attributes of a `Real`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RealType {
    /// `declaredType`.
    pub declared_type: Option<String>,
    /// `quantity`.
    pub quantity: Option<String>,
    /// `unit`.
    pub unit: Option<String>,
    /// `displayUnit`.
    pub display_unit: Option<String>,
    /// `min`.
    pub min: Option<f64>,
    /// `max`.
    pub max: Option<f64>,
    /// `nominal`.
    pub nominal: Option<f64>,
    /// `start`.
    pub start: Option<f64>,
    /// `derivative`: 1-based index of the state of which this variable is the derivative.
    pub derivative: Option<u32>,
    /// `reinit`: an event may change this continuous state.
    pub reinit: bool,
}

/// Attributes of an `Integer` or an `Enumeration`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct IntegerType {
    /// `declaredType`.
    pub declared_type: Option<String>,
    /// `quantity`.
    pub quantity: Option<String>,
    /// `min`.
    pub min: Option<i32>,
    /// `max`.
    pub max: Option<i32>,
    /// `start`.
    pub start: Option<i32>,
}

/// Declares an enumeration with the spelling of its values in the XML.
macro_rules! spelt {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
        pub enum $name { $($(#[$doc])* $variant,)* }

        impl $name {
            /// Returns the spelling of the standard.
            #[must_use]
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::str::FromStr for $name {
            type Err = ();

            fn from_str(text: &str) -> Result<Self, ()> {
                match text { $($text => Ok(Self::$variant),)* _ => Err(()) }
            }
        }
    };
}

spelt! {
    /// `causality` (section 2.2.7).
    Causality {
        /// Independent parameter.
        Parameter = "parameter",
        /// Computed from parameters.
        CalculatedParameter = "calculatedParameter",
        /// Set by the importer's environment.
        Input = "input",
        /// Read by the importer's environment.
        Output = "output",
        /// Internal.
        Local = "local",
        /// The independent variable, usually time.
        Independent = "independent",
    }
}

spelt! {
    /// `variability` (section 2.2.7).
    Variability {
        /// Never changes.
        Constant = "constant",
        /// Fixed after initialization.
        Fixed = "fixed",
        /// May change between communication points.
        Tunable = "tunable",
        /// Changes at events or communication points only.
        Discrete = "discrete",
        /// Changes at any time; only for a Real.
        Continuous = "continuous",
    }
}

spelt! {
    /// `initial` (section 2.2.7).
    Initial {
        /// Initialised with its start value.
        Exact = "exact",
        /// Start value is a guess.
        Approx = "approx",
        /// Computed; has no start value.
        Calculated = "calculated",
    }
}

spelt! {
    /// `dependenciesKind` (section 2.2.8).
    DependencyKind {
        /// No particular structure.
        Dependent = "dependent",
        /// Linear with a constant factor.
        Constant = "constant",
        /// Linear with a factor fixed after initialization.
        Fixed = "fixed",
        /// Linear with a tunable factor.
        Tunable = "tunable",
        /// Linear with a discrete factor.
        Discrete = "discrete",
    }
}

/// `ModelStructure`: indices are 1-based positions in `ModelDescription::variables`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ModelStructure {
    /// `Outputs`.
    pub outputs: Vec<Unknown>,
    /// `Derivatives`.
    pub derivatives: Vec<Unknown>,
    /// `InitialUnknowns`.
    pub initial_unknowns: Vec<Unknown>,
}

/// `Unknown`: one row of `ModelStructure`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Unknown {
    /// `index`, 1-based.
    pub index: u32,
    /// `dependencies`: `None` (absent) means a dependency on all knowns, an empty list on none.
    pub dependencies: Option<Vec<u32>>,
    /// `dependenciesKind`, with one entry for each of `dependencies`.
    pub kinds: Option<Vec<DependencyKind>>,
}
