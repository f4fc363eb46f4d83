//! XML to model description.

mod attributes;
mod encoding;
mod variables;
mod xml;

use std::fmt;

use super::{
    CoSimulation, DefaultExperiment, LogCategory, ModelDescription, ModelExchange, ModelStructure,
    Unknown,
};
use crate::unit::{BaseUnit, DisplayUnit, Unit};
pub use xml::Element;

/// The root element of an XML file, with the bounds of a model description.
pub(crate) fn read_xml(bytes: &[u8]) -> Result<Element, ParseError> {
    xml::read(&encoding::decode(bytes)?)
}

/// A place in an XML file; both numbers count from 1, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Line.
    pub line: u32,
    /// Column.
    pub column: u32,
}

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "line {}, column {}", self.line, self.column)
    }
}

/// Why a text is not the model description of an FMI 2.0 FMU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParseError {
    /// Not the XML that the reader can decode.
    #[error("expected XML in UTF-8 or ISO-8859-1, found {found}")]
    Encoding {
        /// The encoding, or the place of the first wrong byte.
        found: String,
    },
    /// Not well-formed.
    #[error("{at}: expected well-formed XML, found: {found}")]
    Xml {
        /// Where.
        at: Position,
        /// What is wrong.
        found: String,
    },
    /// A document type declaration, which FMI does not use and which could define entities.
    #[error("{at}: expected no document type declaration, found <!DOCTYPE")]
    Doctype {
        /// Where.
        at: Position,
    },
    /// More nesting or more attributes than any model description has.
    #[error("{at}: expected at most {limit} {what}, found more")]
    Limit {
        /// Where.
        at: Position,
        /// What there is too much of.
        what: &'static str,
        /// How many are accepted.
        limit: usize,
    },
    /// Another version of the standard.
    #[error("{at}: expected fmiVersion 2.0, found {found:?}: this is not an FMI 2.0 FMU")]
    Version {
        /// Where.
        at: Position,
        /// The version of the file.
        found: String,
    },
    /// An element that is missing, or one too many.
    #[error("{at}: in <{element}>: expected {expected}, found {found}")]
    Element {
        /// Where the element begins.
        at: Position,
        /// The element.
        element: String,
        /// What it must contain.
        expected: String,
        /// What it contains.
        found: String,
    },
    /// An attribute that is missing or has a wrong value.
    #[error("{at}: <{element}>, attribute {attribute}: expected {expected}, found {found}")]
    Attribute {
        /// Where the element begins.
        at: Position,
        /// The element.
        element: String,
        /// The attribute.
        attribute: &'static str,
        /// What it must be.
        expected: String,
        /// What it is.
        found: String,
    },
}

impl ModelDescription {
    /// Reads `modelDescription.xml` of FMI 2.0.
    ///
    /// Defaults of the standard are filled in: `causality` local, `variability` continuous, and
    /// for a variable with `declaredType` the attributes of that type which it does not state
    /// itself. Unknown elements and attributes, annotations and source files are skipped. What
    /// would mislead an importer is an error: missing required attributes, malformed or infinite
    /// numbers, unknown enumeration values, unknown or mismatching declared types, duplicate
    /// variable names, indices that are no variable's. Rules that a simulation can do without are
    /// left to [`ModelDescription::problems`].
    ///
    /// A byte order mark is accepted, and so is ISO-8859-1 where the file declares it.
    ///
    /// # Errors
    ///
    /// [`ParseError`] with line and column, what is expected and what was found.
    ///
    /// ```
    /// use fmi2::description::ModelDescription;
    /// let error = ModelDescription::parse(r#"<fmiModelDescription fmiVersion="3.0"/>"#);
    /// assert_eq!(
    ///     error.expect_err("another version").to_string(),
    ///     "line 1, column 1: expected fmiVersion 2.0, found \"3.0\": this is not an FMI 2.0 FMU"
    /// );
    /// ```
    pub fn parse(xml: impl AsRef<[u8]>) -> Result<ModelDescription, ParseError> {
        let root = read_xml(xml.as_ref())?;
        if root.name != "fmiModelDescription" {
            let found = format!("<{}>", root.name);
            return Err(root.misses("the root element fmiModelDescription", found));
        }
        let version = root.required("fmiVersion")?;
        if version != "2.0" {
            return Err(ParseError::Version { at: root.at, found: version.to_owned() });
        }
        let variables = root.child("ModelVariables")?;
        let structure = root.child("ModelStructure")?;
        let types = variables::types(&root)?;
        let variables = variables::variables(variables, &types)?;
        let structure = model_structure(structure, variables.len())?;
        Ok(ModelDescription {
            fmi_version: version.to_owned(),
            model_name: root.required("modelName")?.to_owned(),
            guid: root.required("guid")?.to_owned(),
            description: root.text("description"),
            author: root.text("author"),
            version: root.text("version"),
            copyright: root.text("copyright"),
            license: root.text("license"),
            generation_tool: root.text("generationTool"),
            generation_date_and_time: root.text("generationDateAndTime"),
            structured_names: structured_names(&root)?,
            number_of_event_indicators: root.unsigned("numberOfEventIndicators")?,
            model_exchange: root
                .optional_child("ModelExchange")?
                .map(model_exchange)
                .transpose()?,
            co_simulation: root.optional_child("CoSimulation")?.map(co_simulation).transpose()?,
            units: root.list("UnitDefinitions", "Unit", unit)?,
            types,
            log_categories: root.list("LogCategories", "Category", category)?,
            default_experiment: root
                .optional_child("DefaultExperiment")?
                .map(experiment)
                .transpose()?,
            variables,
            structure,
        })
    }
}

impl Element {
    fn identifier(&self) -> Result<String, ParseError> {
        Ok(self.required("modelIdentifier")?.to_owned())
    }
}

fn structured_names(root: &Element) -> Result<bool, ParseError> {
    match root.attribute("variableNamingConvention") {
        None | Some("flat") => Ok(false),
        Some("structured") => Ok(true),
        Some(other) => Err(root.wrong("variableNamingConvention", "flat or structured", other)),
    }
}

fn model_exchange(element: &Element) -> Result<ModelExchange, ParseError> {
    let flag = |name| Ok(element.boolean(name)?.unwrap_or(false));
    Ok(ModelExchange {
        model_identifier: element.identifier()?,
        needs_execution_tool: flag("needsExecutionTool")?,
        completed_integrator_step_not_needed: flag("completedIntegratorStepNotNeeded")?,
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess")?,
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions")?,
        can_get_and_set_fmu_state: flag("canGetAndSetFMUstate")?,
        can_serialize_fmu_state: flag("canSerializeFMUstate")?,
        provides_directional_derivative: flag("providesDirectionalDerivative")?,
    })
}

fn co_simulation(element: &Element) -> Result<CoSimulation, ParseError> {
    let flag = |name| Ok(element.boolean(name)?.unwrap_or(false));
    Ok(CoSimulation {
        model_identifier: element.identifier()?,
        needs_execution_tool: flag("needsExecutionTool")?,
        can_handle_variable_communication_step_size: flag(
            "canHandleVariableCommunicationStepSize",
        )?,
        can_interpolate_inputs: flag("canInterpolateInputs")?,
        max_output_derivative_order: element.unsigned("maxOutputDerivativeOrder")?.unwrap_or(0),
        can_run_asynchronuously: flag("canRunAsynchronuously")?,
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess")?,
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions")?,
        can_get_and_set_fmu_state: flag("canGetAndSetFMUstate")?,
        can_serialize_fmu_state: flag("canSerializeFMUstate")?,
        provides_directional_derivative: flag("providesDirectionalDerivative")?,
    })
}

fn unit(element: &Element) -> Result<Unit, ParseError> {
    let display_units = element.children_named("DisplayUnit").map(|display| {
        Ok(DisplayUnit {
            name: display.required("name")?.to_owned(),
            factor: display.number("factor")?.unwrap_or(1.0),
            offset: display.number("offset")?.unwrap_or(0.0),
        })
    });
    Ok(Unit {
        name: element.required("name")?.to_owned(),
        display_units: display_units.collect::<Result<_, ParseError>>()?,
        base: element.optional_child("BaseUnit")?.map(base_unit).transpose()?,
    })
}

fn base_unit(element: &Element) -> Result<BaseUnit, ParseError> {
    let exponent = |name| Ok(element.integer(name)?.unwrap_or(0));
    Ok(BaseUnit {
        kg: exponent("kg")?,
        m: exponent("m")?,
        s: exponent("s")?,
        a: exponent("A")?,
        k: exponent("K")?,
        mol: exponent("mol")?,
        cd: exponent("cd")?,
        rad: exponent("rad")?,
        factor: element.number("factor")?.unwrap_or(1.0),
        offset: element.number("offset")?.unwrap_or(0.0),
    })
}

fn category(element: &Element) -> Result<LogCategory, ParseError> {
    let name = element.required("name")?.to_owned();
    Ok(LogCategory { name, description: element.text("description") })
}

fn experiment(element: &Element) -> Result<DefaultExperiment, ParseError> {
    Ok(DefaultExperiment {
        start_time: element.number("startTime")?,
        stop_time: element.number("stopTime")?,
        tolerance: element.number("tolerance")?,
        step_size: element.number("stepSize")?,
    })
}

fn model_structure(element: &Element, variables: usize) -> Result<ModelStructure, ParseError> {
    let list = |name| element.list(name, "Unknown", |row| unknown(row, variables));
    Ok(ModelStructure {
        outputs: list("Outputs")?,
        derivatives: list("Derivatives")?,
        initial_unknowns: list("InitialUnknowns")?,
    })
}

fn unknown(element: &Element, variables: usize) -> Result<Unknown, ParseError> {
    let index = element.index("index", element.required("index")?, variables)?;
    let dependencies =
        element.items("dependencies", |text| element.index("dependencies", text, variables))?;
    let kinds = element.items("dependenciesKind", |text| {
        let expected = "dependent, constant, fixed, tunable or discrete";
        text.parse().map_err(|()| element.wrong("dependenciesKind", expected, text))
    })?;
    if let Some(kinds) = &kinds {
        let count = dependencies.as_ref().map_or(0, Vec::len);
        if dependencies.is_none() || count != kinds.len() {
            let expected = format!("as many entries as dependencies has, {count}");
            return Err(element.wrong("dependenciesKind", &expected, &kinds.len().to_string()));
        }
    }
    Ok(Unknown { index, dependencies, kinds })
}

#[cfg(test)]
mod tests;
