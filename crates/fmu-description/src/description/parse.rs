//! Parses XML into a model description.

mod attributes;
mod encoding;
mod schema;
mod structure;
mod variables;
mod warning;
mod xml;

use std::fmt;

use super::{CoSimulation, DefaultExperiment, LogCategory, ModelDescription, ModelExchange};
use crate::unit::{BaseUnit, DisplayUnit, Unit};
use attributes::{Node, WHITE_SPACE};
pub use warning::Warning;
use warning::Warnings;

/// The root element of an XML file, read with the limits for a model description.
pub(crate) fn read_xml(bytes: &[u8]) -> Result<crate::xml::Element, ParseError> {
    if bytes.len() > ModelDescription::MOST_BYTES {
        return Err(ParseError::Length { limit: ModelDescription::MOST_BYTES });
    }
    let (text, _) = encoding::decode(bytes)?;
    Ok(xml::read_but(&text, |_| false)?.into_owned())
}

/// A position in an XML file; both numbers count from 1, columns in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// The line.
    pub line: u32,
    /// The column.
    pub column: u32,
}

impl Position {
    const START: Position = Position { line: 1, column: 1 };
}

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "line {}, column {}", self.line, self.column)
    }
}

/// The error of parsing a text that is not the model description of an FMI 2.0 FMU.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ParseError {
    /// The file is not text that the reader can decode.
    #[error("expected XML in UTF-8, or in the encoding that it declares, found {found}")]
    Encoding {
        /// The encoding, or the position of the first invalid byte.
        found: String,
    },
    /// The file is too long.
    #[error("expected at most {limit} bytes, found more")]
    Length {
        /// The limit in bytes.
        limit: usize,
    },
    /// The file is not well-formed XML.
    #[error("{at}: expected well-formed XML, found: {found}")]
    Xml {
        /// The position.
        at: Position,
        /// The reason.
        found: String,
    },
    /// The file has a document type declaration, which FMI does not use and which could define
    /// entities.
    #[error("{at}: expected no document type declaration, found <!DOCTYPE")]
    Doctype {
        /// The position.
        at: Position,
    },
    /// The file has more nesting or more attributes than the limit.
    #[error("{at}: expected at most {limit} {what}, found more")]
    Limit {
        /// The position.
        at: Position,
        /// The limited quantity.
        what: &'static str,
        /// The limit.
        limit: usize,
    },
    /// The file is of another version of the standard.
    #[error("{at}: expected fmiVersion 2.0, found {found:?}: this is not an FMI 2.0 FMU")]
    Version {
        /// The position.
        at: Position,
        /// The version in the file.
        found: String,
    },
    /// An element is missing, or there is one too many.
    #[error("{at}: in <{element}>: expected {expected}, found {found}")]
    Element {
        /// The position of the parent element.
        at: Position,
        /// The parent element.
        element: String,
        /// The expected content.
        expected: String,
        /// The actual content.
        found: String,
    },
    /// An attribute is missing or has an invalid value.
    #[error("{at}: <{element}>, attribute {attribute}: expected {expected}, found {found}")]
    Attribute {
        /// The position of the element.
        at: Position,
        /// The element.
        element: String,
        /// The attribute.
        attribute: &'static str,
        /// The expected value.
        expected: String,
        /// The actual value.
        found: String,
    },
}

impl ModelDescription {
    /// Maximum size in bytes of a file that is read.
    pub const MOST_BYTES: usize = 128 << 20;

    /// Reads `modelDescription.xml` of FMI 2.0 as [`ModelDescription::read`] does, without warnings.
    ///
    /// # Errors
    ///
    /// Same as [`ModelDescription::read`].
    ///
    /// ```
    /// use fmu_description::ModelDescription;
    /// let error = ModelDescription::parse(r#"<fmiModelDescription fmiVersion="3.0"/>"#);
    /// assert_eq!(
    ///     error.expect_err("another version").to_string(),
    ///     "line 1, column 1: expected fmiVersion 2.0, found \"3.0\": this is not an FMI 2.0 FMU"
    /// );
    /// ```
    pub fn parse(xml: impl AsRef<[u8]>) -> Result<ModelDescription, ParseError> {
        Self::read(xml).map(|(description, _)| description)
    }

    /// Reads `modelDescription.xml` of FMI 2.0; returns warnings for content that the standard does
    /// not allow.
    ///
    /// Fills in the defaults of the standard: `causality` local, `variability` continuous, and for
    /// a variable with `declaredType` the attributes of that type which it does not state itself.
    /// Skips annotations.
    ///
    /// Content that breaks the standard gives a [`Warning`], which states the assumption made, if
    /// the meaning for a simulation is clear or other importers accept it: other encodings,
    /// `fmiVersion` 2.0.x, unknown elements and attributes, wrong order, words in another case,
    /// unknown words, flags, types and dependencies, numbers that are infinite or empty. Content
    /// that would mislead a simulation is an error: missing required attributes, numbers that are
    /// malformed or too large, value references that two inputs or parameters share, names of two
    /// outputs, types that refer to types. [`ModelDescription::problems`] checks further rules.
    ///
    /// Limits: 128 MiB, 3,000,000 elements, 12,000,000 attributes, 1,000,000 variables. Cost:
    /// linear in the length of the file. At most 1000 warnings are kept.
    ///
    /// # Errors
    ///
    /// [`ParseError`] with line and column, expected and actual content.
    pub fn read(xml: impl AsRef<[u8]>) -> Result<(ModelDescription, Vec<Warning>), ParseError> {
        let bytes = xml.as_ref();
        if bytes.len() > Self::MOST_BYTES {
            return Err(ParseError::Length { limit: Self::MOST_BYTES });
        }
        let (text, not_utf8) = encoding::decode(bytes)?;
        let element = xml::read(&text)?;
        let warnings = Warnings::default();
        let description = root(Node { element: &element, warnings: &warnings })?;
        let mut warnings = warnings.finish();
        warnings.splice(0..0, not_utf8);
        Ok((description, warnings))
    }
}

fn root(root: Node<'_>) -> Result<ModelDescription, ParseError> {
    if root.element.name != "fmiModelDescription" {
        let found = format!("<{}>", root.element.name);
        return Err(root.misses("the root element fmiModelDescription", found));
    }
    version(root)?;
    schema::check(root, "");
    let types = variables::types(root)?;
    let variables = variables::variables(root.child("ModelVariables")?, &types)?;
    let structure = structure::read(root, &variables)?;
    let model_exchange = root.optional_child("ModelExchange")?.map(model_exchange).transpose()?;
    let co_simulation = root.optional_child("CoSimulation")?.map(co_simulation).transpose()?;
    let model_name = root.text("modelName").unwrap_or_else(|| {
        let own = co_simulation.as_ref().map(|own| &own.model_identifier);
        let own = own.or(model_exchange.as_ref().map(|own| &own.model_identifier));
        let own = own.cloned().unwrap_or_default();
        let said = ("a value", "no such attribute".to_owned());
        root.warn_of(true, root.place("modelName"), said, &format!("read as {own:?}"));
        own
    });
    Ok(ModelDescription {
        fmi_version: "2.0".to_owned(),
        model_name,
        guid: root.required("guid")?.to_owned(),
        description: root.text("description"),
        author: root.text("author"),
        version: root.text("version"),
        copyright: root.text("copyright"),
        license: root.text("license"),
        generation_tool: root.text("generationTool"),
        generation_date_and_time: root.text("generationDateAndTime"),
        structured_names: structured_names(root),
        number_of_event_indicators: root.optional_unsigned("numberOfEventIndicators"),
        model_exchange,
        co_simulation,
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

/// Checks that `fmiVersion` is 2.0; 2.0.1 to 2.0.5, versions of the standard's text, are read as
/// 2.0.
fn version(root: Node<'_>) -> Result<(), ParseError> {
    let found = root.required("fmiVersion")?;
    if found == "2.0" {
        return Ok(());
    }
    let patch = found.trim_matches(WHITE_SPACE).strip_prefix("2.0");
    let patch = patch.map(|rest| rest.strip_prefix('.').unwrap_or(rest));
    if patch.is_none_or(|patch| patch.len() > 3 || !patch.bytes().all(|own| own.is_ascii_digit())) {
        return Err(ParseError::Version { at: root.element.at, found: found.to_owned() });
    }
    root.warn("fmiVersion", "2.0 for every 2.0.x", found, "read as 2.0");
    Ok(())
}

fn structured_names(root: Node<'_>) -> bool {
    const NAME: &str = "variableNamingConvention";
    match root.attribute(NAME) {
        None | Some("flat") => false,
        Some("structured") => true,
        Some(other) => {
            root.warn(NAME, "flat or structured", other, "read as flat");
            false
        }
    }
}

fn identifier(element: Node<'_>) -> Result<String, ParseError> {
    Ok(element.required("modelIdentifier")?.to_owned())
}

fn source_files(element: Node<'_>) -> Result<Vec<String>, ParseError> {
    element.list("SourceFiles", "File", |file| Ok(file.required("name")?.to_owned()))
}

fn model_exchange(element: Node<'_>) -> Result<ModelExchange, ParseError> {
    let flag = |name| element.flag(name);
    Ok(ModelExchange {
        model_identifier: identifier(element)?,
        needs_execution_tool: flag("needsExecutionTool"),
        completed_integrator_step_not_needed: flag("completedIntegratorStepNotNeeded"),
        can_be_instantiated_only_once_per_process: flag("canBeInstantiatedOnlyOncePerProcess"),
        can_not_use_memory_management_functions: flag("canNotUseMemoryManagementFunctions"),
        can_get_and_set_fmu_state: flag("canGetAndSetFMUstate"),
        can_serialize_fmu_state: flag("canSerializeFMUstate"),
        provides_directional_derivative: flag("providesDirectionalDerivative"),
        source_files: source_files(element)?,
    })
}

fn co_simulation(element: Node<'_>) -> Result<CoSimulation, ParseError> {
    let flag = |name| element.flag(name);
    Ok(CoSimulation {
        model_identifier: identifier(element)?,
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
    })
}

fn unit(element: Node<'_>) -> Result<Unit, ParseError> {
    let display_units = element.children_named("DisplayUnit").map(|display| {
        Ok(DisplayUnit {
            name: display.required("name")?.to_owned(),
            factor: display.finite("factor", 1.0)?,
            offset: display.finite("offset", 0.0)?,
        })
    });
    Ok(Unit {
        name: element.required("name")?.to_owned(),
        display_units: display_units.collect::<Result<_, ParseError>>()?,
        base: element.optional_child("BaseUnit")?.map(base_unit).transpose()?,
    })
}

fn base_unit(element: Node<'_>) -> Result<BaseUnit, ParseError> {
    let mut exponents = [0; 8];
    for (exponent, name) in exponents.iter_mut().zip(BaseUnit::EXPONENTS) {
        *exponent = element.integer(name)?.unwrap_or(0);
    }
    let (factor, offset) = (element.finite("factor", 1.0)?, element.finite("offset", 0.0)?);
    Ok(BaseUnit::from_exponents(exponents, factor, offset))
}

fn category(element: Node<'_>) -> Result<LogCategory, ParseError> {
    let name = element.required("name")?.to_owned();
    Ok(LogCategory { name, description: element.text("description") })
}

fn experiment(element: Node<'_>) -> Result<DefaultExperiment, ParseError> {
    Ok(DefaultExperiment {
        start_time: element.number("startTime")?,
        stop_time: element.number("stopTime")?,
        tolerance: element.number("tolerance")?,
        step_size: element.number("stepSize")?,
    })
}

#[cfg(test)]
mod tests;
