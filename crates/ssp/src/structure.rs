//! The content of SSD, SSV, SSM and SSB files (SSP 1.0.1 and 2.0, sections 4 to 8) as plain data.
//!
//! Geometry, graphical elements and annotations are left out, except step sizes of the Open Simulation Platform.
#![expect(missing_docs, reason = "fields without documentation have the names of the standard")]

mod kinds;

use fmu_description::Position;
use fmu_description::unit::BaseUnit;

pub use kinds::{ConnectorKind, Content, Dimension, Implementation, ParameterValue, Type};

/// `SystemStructureDescription`, the root element of an SSD file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SystemStructure {
    pub name: String,
    /// The root system.
    pub system: System,
    /// `Enumerations` and `Units`.
    pub definitions: Definitions,
    /// `DefaultExperiment`.
    pub experiment: Option<DefaultExperiment>,
    pub generation_tool: Option<String>,
}

/// The definitions of enumerations and units in one file (section 4.4).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Definitions {
    pub enumerations: Vec<Enumeration>,
    pub units: Vec<Unit>,
}

/// `Enumeration`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Enumeration {
    /// `name`, unique in the file.
    pub name: String,
    /// Name and value of each `Item`.
    pub items: Vec<(String, i32)>,
}

/// `Unit`.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// `name`, unique in the file.
    pub name: String,
    /// `BaseUnit`.
    pub base: BaseUnit,
}

/// `DefaultExperiment`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DefaultExperiment {
    /// `startTime` in s.
    pub start_time: Option<f64>,
    /// `stopTime` in s.
    pub stop_time: Option<f64>,
    /// Base step in s, `osp:FixedStepAlgorithm` in an annotation `com.opensimulationplatform`.
    pub step_size: Option<f64>,
}

/// `System` (section 5.3).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct System {
    /// Name, connectors and parameter bindings.
    pub base: ElementBase,
    pub elements: Vec<Element>,
    pub connections: Vec<Connection>,
    /// `SignalDictionaries`.
    pub dictionaries: Vec<DictionarySource>,
}

/// The common content of systems, components and references to signal dictionaries (section 5.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ElementBase {
    /// `name`, unique within the parent system.
    pub name: String,
    /// `id`. The source `#id` of a component refers to the first system with this `id`.
    pub id: Option<String>,
    pub connectors: Vec<Connector>,
    /// `ParameterBindings`; later bindings override earlier ones.
    pub bindings: Vec<ParameterBinding>,
    /// Position in the file.
    pub at: Place,
}

/// A position in a file; line 1, column 1 for data that was not read from a file.
#[derive(Clone, Copy, Debug)]
pub struct Place(pub Position);

impl Default for Place {
    fn default() -> Self {
        Place(Position { line: 1, column: 1 })
    }
}

/// All places are equal, so that the comparison of two structures ignores positions.
impl PartialEq for Place {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// An element of a system.
#[derive(Clone, Debug, PartialEq)]
pub enum Element {
    /// `Component`.
    Component(Component),
    /// `System`, nested.
    System(System),
    /// `SignalDictionaryReference`.
    Dictionary(DictionaryReference),
}

impl Element {
    /// Returns the common content of all elements.
    #[must_use]
    pub fn base(&self) -> &ElementBase {
        match self {
            Element::Component(component) => &component.base,
            Element::System(system) => &system.base,
            Element::Dictionary(reference) => &reference.base,
        }
    }
}

/// `Component` (section 5.4).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Component {
    /// Name, connectors and parameter bindings.
    pub base: ElementBase,
    /// `type`.
    pub content: Content,
    /// `source`, a URI; empty if absent (SSP 2.0): the component then has connectors only.
    pub source: String,
    pub implementation: Implementation,
    /// Step in s, `osp:StepSizeHint` in an annotation `com.opensimulationplatform`.
    pub step_size: Option<f64>,
}

/// `SignalDictionaryReference` (section 5.5).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DictionaryReference {
    /// Name, connectors and parameter bindings.
    pub base: ElementBase,
    /// `dictionary`: name of a dictionary of the parent system or of a system around it.
    pub dictionary: String,
}

/// `SignalDictionary` of a system: a name and a content.
#[derive(Clone, Debug, PartialEq)]
pub struct DictionarySource {
    pub name: String,
    /// The dictionary.
    pub content: Source<SignalDictionary>,
    /// Position in the file.
    pub at: Place,
}

/// `SignalDictionary`, the root element of an SSB file (section 8).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignalDictionary {
    /// Name and type of each `DictionaryEntry`.
    pub entries: Vec<(String, Type)>,
    /// `Enumerations` and `Units`.
    pub definitions: Definitions,
}

/// `Connector` (section 5.2.1).
#[derive(Clone, Debug, PartialEq)]
pub struct Connector {
    /// `name`; for a component, the name of the FMU's variable.
    pub name: String,
    pub kind: ConnectorKind,
    /// Type, if stated.
    pub kind_of_value: Option<Type>,
}

/// `Connection` (section 5.3.2). The kinds of the connectors determine which end is the source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connection {
    /// `startElement` and `startConnector`.
    pub start: End,
    /// `endElement` and `endConnector`.
    pub end: End,
    /// Unit conversion and transformation of the value.
    pub conversion: Conversion,
    /// Position in the file.
    pub at: Place,
}

/// One end of a connection.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct End {
    /// Name of the element; `None` for the system itself.
    pub element: Option<String>,
    /// Name of the connector.
    pub connector: String,
}

impl std::fmt::Display for End {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.element {
            Some(element) => write!(formatter, "{element}.{}", self.connector),
            None => write!(formatter, "{}", self.connector),
        }
    }
}

/// The conversion of a value on a connection or in a mapping: first unit conversion, then the
/// transformation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conversion {
    /// The transformation of the value, if stated.
    pub transformation: Option<Transformation>,
    /// `suppressUnitConversion`.
    pub suppress_units: bool,
}

/// A transformation in the form of the file (section 4.5.2).
#[derive(Clone, Debug, PartialEq)]
pub enum Transformation {
    /// `LinearTransformation`: `target = factor source + offset`.
    Linear { factor: f64, offset: f64 },
    /// `BooleanMappingTransformation`: source and target of each entry.
    Boolean(Vec<(bool, bool)>),
    /// `IntegerMappingTransformation`: source and target of each entry.
    Integer(Vec<(i32, i32)>),
    /// `EnumerationMappingTransformation`: item names of source and target of each entry.
    Enumeration(Vec<(String, String)>),
}

/// `ParameterBinding` (section 5.2.3).
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterBinding {
    /// `prefix` of all parameter names in the source.
    pub prefix: String,
    /// The parameter values.
    pub values: Source<ParameterSet>,
    /// `ParameterMapping`; if present, only mapped parameters are applied.
    pub mapping: Option<Source<ParameterMapping>>,
    /// Position in the file.
    pub at: Place,
}

/// Content in the same file or in another file.
#[derive(Clone, Debug, PartialEq)]
pub enum Source<T> {
    /// Content in this file.
    Inline(T),
    /// Reference to another file with the content.
    File {
        /// `source`, a URI.
        uri: String,
        /// Whether `sourceBase` is `component`: the URI is relative to the component, not to the SSD. Ignored for
        /// signal dictionaries.
        in_component: bool,
    },
}

/// `ParameterSet`, the root element of an SSV file (section 6).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterSet {
    pub name: String,
    pub parameters: Vec<Parameter>,
    /// `Enumerations` and `Units`.
    pub definitions: Definitions,
}

/// `Parameter`.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// `name`. Of several parameters with the same name, the last one applies.
    pub name: String,
    /// The value.
    pub value: ParameterValue,
}

/// `ParameterMapping`, the root element of an SSM file (section 7).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterMapping {
    /// The `MappingEntry` elements.
    pub entries: Vec<MappingEntry>,
}

/// `MappingEntry`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MappingEntry {
    /// `source`: name of a parameter, with the prefix of the binding.
    pub source: String,
    /// `target`: name in the system or component.
    pub target: String,
    /// Unit conversion and transformation of the value.
    pub conversion: Conversion,
    /// Position in the file.
    pub at: Place,
}
