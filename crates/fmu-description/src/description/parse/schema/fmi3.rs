//! The schema of FMI 3.0.2.

use super::{Shape, branch, leaf, list, names, names_in_table};
use crate::description::attributes;
use crate::unit::BaseUnit;

const ROOT: Shape = branch(
    names! {
        fmiVersion modelName instantiationToken description author version copyright license
        generationTool generationDateAndTime variableNamingConvention
    },
    names! {
        ModelExchange CoSimulation ScheduledExecution UnitDefinitions TypeDefinitions LogCategories
        DefaultExperiment ModelVariables ModelStructure Annotations
    },
);

/// Declares the names of the elements of variables, and those of types, which end in `Type`.
macro_rules! elements {
    ($($name:literal)*) => {
        const VARIABLES: [&str; 15] = [$($name),*];
        const TYPES: [&str; VARIABLES.len()] = [$(concat!($name, "Type")),*];
    };
}

elements! {
    "Float32" "Float64" "Int8" "UInt8" "Int16" "UInt16" "Int32" "UInt32" "Int64" "UInt64"
    "Boolean" "String" "Binary" "Enumeration" "Clock"
}

/// Attributes of all variables.
const VARIABLE: &[&str] = names! {
    name valueReference description causality variability canHandleMultipleSetPerTimeInstant clocks
    declaredType
};
/// Attributes of all types.
const TYPE: &[&str] = &["name", "description"];
/// Attributes of a floating-point number, as a type and as a variable.
const REAL: &[&str] =
    &["quantity", "unit", "displayUnit", "relativeQuantity", "unbounded", "min", "max", "nominal"];
/// Attributes of an integer, as a type and as a variable.
const INTEGER: &[&str] = &["quantity", "min", "max"];
/// Attributes of a clock, as a type and as a variable.
const CLOCK: &[&str] = names! {
    canBeDeactivated priority intervalVariability intervalDecimal shiftDecimal supportsFraction resolution
    intervalCounter shiftCounter
};

/// Returns the shape of an interface: `attributes`, and the attributes that all interfaces have.
const fn interface(attributes: &'static [&'static str]) -> Shape {
    let shape = branch(attributes, ANNOTATED).with(&["modelIdentifier"]);
    shape.with(attributes!(COMMON_3, names_in_table!()))
}

/// The shape of the element `name` in `parent`; `None` if the schema does not define its content.
pub(super) fn shape(parent: &str, name: &str) -> Option<Shape> {
    Some(match (parent, name) {
        (_, "fmiModelDescription") => ROOT,
        (_, "ModelExchange") => interface(attributes!(MODEL_EXCHANGE_3, names_in_table!())),
        (_, "CoSimulation") => interface(attributes!(CO_SIMULATION_3, names_in_table!())),
        (_, "ScheduledExecution") => interface(&[]),
        (_, "UnitDefinitions") => list(&["Unit"]),
        (_, "Unit") => branch(&["name"], &["BaseUnit", "DisplayUnit", "Annotations"]),
        (_, "BaseUnit") => leaf(&["factor", "offset"]).with(&BaseUnit::EXPONENTS),
        (_, "DisplayUnit") => branch(&["name", "factor", "offset", "inverse"], ANNOTATED),
        // Types and variables come in any order.
        (_, "TypeDefinitions") => Shape { unordered: TYPES.len(), ..list(&TYPES) },
        ("TypeDefinitions", name) => of_type(name)?,
        (_, "Item") => branch(&["name", "value", "description"], ANNOTATED),
        (_, "LogCategories") => list(&["Category"]),
        (_, "Category") => branch(&["name", "description"], ANNOTATED),
        (_, "DefaultExperiment") => {
            branch(&["startTime", "stopTime", "tolerance", "stepSize"], ANNOTATED)
        }
        // May be empty: `problems` reports an empty list.
        (_, "ModelVariables") => Shape { unordered: VARIABLES.len(), ..branch(&[], &VARIABLES) },
        ("ModelVariables", name) => of_variable(name)?,
        (_, "Dimension") => leaf(&["start", "valueReference"]),
        (_, "Start") => leaf(&["value"]),
        ("Float32" | "Float64", "Alias") => leaf(&["name", "description", "displayUnit"]),
        (_, "Alias") => leaf(&["name", "description"]),
        (_, "ModelStructure") => branch(&[], &ROWS),
        ("ModelStructure", name) if ROWS.contains(&name) => {
            branch(&["valueReference", "dependencies", "dependenciesKind"], ANNOTATED)
        }
        _ => return None,
    })
}

const ANNOTATED: &[&str] = &["Annotations"];
const ROWS: [&str; 5] =
    ["Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator"];

fn of_type(name: &str) -> Option<Shape> {
    let shape = match name {
        "Float32Type" | "Float64Type" => branch(REAL, ANNOTATED),
        "BooleanType" | "StringType" => branch(&[], ANNOTATED),
        "BinaryType" => branch(&["mimeType", "maxSize"], ANNOTATED),
        "EnumerationType" => branch(INTEGER, &["Annotations", "Item"]),
        "ClockType" => branch(CLOCK, ANNOTATED),
        other if TYPES.contains(&other) => branch(INTEGER, ANNOTATED),
        _ => return None,
    };
    Some(shape.with(TYPE))
}

fn of_variable(name: &str) -> Option<Shape> {
    const CHANGING: &[&str] = &["initial", "intermediateUpdate", "previous"];
    const INITIALIZED: &[&str] = &["Annotations", "Dimension", "Alias"];
    const WITH_STARTS: &[&str] = &["Annotations", "Dimension", "Start", "Alias"];
    let shape = match name {
        "Float32" | "Float64" => {
            branch(&["start", "derivative", "reinit"], INITIALIZED).with(REAL).with(CHANGING)
        }
        "Boolean" => branch(&["start"], INITIALIZED).with(CHANGING),
        "String" => branch(CHANGING, WITH_STARTS),
        "Binary" => branch(&["mimeType", "maxSize"], WITH_STARTS).with(CHANGING),
        "Clock" => branch(CLOCK, &["Annotations", "Alias"]),
        other if VARIABLES.contains(&other) => {
            branch(&["start"], INITIALIZED).with(INTEGER).with(CHANGING)
        }
        _ => return None,
    };
    Some(shape.with(VARIABLE))
}
