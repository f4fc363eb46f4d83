//! The schema of FMI 3.0.2.

use super::{Shape, branch, leaf, list};
use crate::unit::BaseUnit;

const ROOT: Shape = branch(
    &[
        "fmiVersion",
        "modelName",
        "instantiationToken",
        "description",
        "author",
        "version",
        "copyright",
        "license",
        "generationTool",
        "generationDateAndTime",
        "variableNamingConvention",
    ],
    &[
        "ModelExchange",
        "CoSimulation",
        "ScheduledExecution",
        "UnitDefinitions",
        "TypeDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "ModelVariables",
        "ModelStructure",
        "Annotations",
    ],
);
/// Attributes of all interfaces.
const INTERFACE: &[&str] = &[
    "modelIdentifier",
    "needsExecutionTool",
    "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUState",
    "canSerializeFMUState",
    "providesDirectionalDerivatives",
    "providesAdjointDerivatives",
    "providesPerElementDependencies",
];
const CO_SIMULATION: Shape = branch(
    &[
        "canHandleVariableCommunicationStepSize",
        "fixedInternalStepSize",
        "maxOutputDerivativeOrder",
        "recommendedIntermediateInputSmoothness",
        "providesIntermediateUpdate",
        "mightReturnEarlyFromDoStep",
        "canReturnEarlyAfterIntermediateUpdate",
        "hasEventMode",
        "providesEvaluateDiscreteStates",
    ],
    &["Annotations"],
)
.with(INTERFACE);
const TYPES: [&str; 15] = [
    "Float32Type",
    "Float64Type",
    "Int8Type",
    "UInt8Type",
    "Int16Type",
    "UInt16Type",
    "Int32Type",
    "UInt32Type",
    "Int64Type",
    "UInt64Type",
    "BooleanType",
    "StringType",
    "BinaryType",
    "EnumerationType",
    "ClockType",
];
const VARIABLES: [&str; 15] = [
    "Float32",
    "Float64",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Binary",
    "Enumeration",
    "Clock",
];
/// Attributes of all variables.
const VARIABLE: &[&str] = &[
    "name",
    "valueReference",
    "description",
    "causality",
    "variability",
    "canHandleMultipleSetPerTimeInstant",
    "clocks",
    "declaredType",
];
/// Attributes of a clock, as a type and as a variable.
const CLOCK: &[&str] = &[
    "canBeDeactivated",
    "priority",
    "intervalVariability",
    "intervalDecimal",
    "shiftDecimal",
    "supportsFraction",
    "resolution",
    "intervalCounter",
    "shiftCounter",
];

/// The shape of the element `name` in `parent`; `None` if the schema does not define its content.
pub(super) fn shape(parent: &str, name: &str) -> Option<Shape> {
    Some(match (parent, name) {
        (_, "fmiModelDescription") => ROOT,
        (_, "ModelExchange") => {
            branch(&["needsCompletedIntegratorStep", "providesEvaluateDiscreteStates"], ANNOTATED)
                .with(INTERFACE)
        }
        (_, "CoSimulation") => CO_SIMULATION,
        (_, "ScheduledExecution") => branch(&[], ANNOTATED).with(INTERFACE),
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
        // The rules report an empty list, not the schema.
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
    Some(match name {
        "Float32Type" | "Float64Type" => branch(
            &[
                "name",
                "description",
                "quantity",
                "unit",
                "displayUnit",
                "relativeQuantity",
                "unbounded",
                "min",
                "max",
                "nominal",
            ],
            ANNOTATED,
        ),
        "BooleanType" | "StringType" => branch(&["name", "description"], ANNOTATED),
        "BinaryType" => branch(&["name", "description", "mimeType", "maxSize"], ANNOTATED),
        "EnumerationType" => Shape {
            unordered: 1,
            ..branch(&["name", "description", "quantity", "min", "max"], &["Annotations", "Item"])
        },
        "ClockType" => branch(&["name", "description"], ANNOTATED).with(CLOCK),
        other if TYPES.contains(&other) => {
            branch(&["name", "description", "quantity", "min", "max"], ANNOTATED)
        }
        _ => return None,
    })
}

fn of_variable(name: &str) -> Option<Shape> {
    const INITIALIZED: &[&str] = &["Annotations", "Dimension", "Alias"];
    const WITH_STARTS: &[&str] = &["Annotations", "Dimension", "Start", "Alias"];
    let shape = match name {
        "Float32" | "Float64" => branch(
            &[
                "initial",
                "intermediateUpdate",
                "previous",
                "quantity",
                "unit",
                "displayUnit",
                "relativeQuantity",
                "unbounded",
                "min",
                "max",
                "nominal",
                "start",
                "derivative",
                "reinit",
            ],
            INITIALIZED,
        ),
        "Boolean" => branch(&["initial", "intermediateUpdate", "previous", "start"], INITIALIZED),
        "String" => branch(&["initial", "intermediateUpdate", "previous"], WITH_STARTS),
        "Binary" => branch(
            &["initial", "intermediateUpdate", "previous", "mimeType", "maxSize"],
            WITH_STARTS,
        ),
        "Clock" => branch(CLOCK, &["Annotations", "Alias"]),
        other if VARIABLES.contains(&other) => branch(
            &["initial", "intermediateUpdate", "previous", "quantity", "min", "max", "start"],
            INITIALIZED,
        ),
        _ => return None,
    };
    Some(shape.with(VARIABLE))
}
