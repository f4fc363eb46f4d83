//! The schema of FMI 2.0.5.

use super::{Shape, branch, leaf, list, names, names_in_table};
use crate::description::attributes;
use crate::unit::BaseUnit;

const ROOT: Shape = branch(
    names! {
        fmiVersion modelName guid description author version copyright license generationTool
        generationDateAndTime variableNamingConvention numberOfEventIndicators
    },
    names! {
        ModelExchange CoSimulation UnitDefinitions TypeDefinitions LogCategories DefaultExperiment
        VendorAnnotations ModelVariables ModelStructure
    },
);
const MODEL_EXCHANGE: Shape = interface(attributes!(MODEL_EXCHANGE_2, names_in_table!()));
const CO_SIMULATION: Shape = interface(attributes!(CO_SIMULATION_2, names_in_table!()));
const VARIABLE: Shape = branch(
    names! {
        name valueReference description causality variability initial canHandleMultipleSetPerTimeInstant
    },
    &["Real", "Integer", "Boolean", "String", "Enumeration", "Annotations"],
);
/// Attributes of a Real, as a type and as a variable.
const REAL: &[&str] =
    &["quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal", "unbounded"];
/// Attributes of an Integer or Enumeration, as a type and as a variable.
const INTEGER: &[&str] = &["quantity", "min", "max"];

/// Returns the shape of an interface: `attributes`, and the attributes that both interfaces have.
const fn interface(attributes: &'static [&'static str]) -> Shape {
    let shape = branch(attributes, &["SourceFiles"]).with(&["modelIdentifier"]);
    shape.with(attributes!(COMMON_2, names_in_table!()))
}

/// The shape of the element `name` in `parent`; `None` if the schema does not define its content.
pub(super) fn shape(parent: &str, name: &str) -> Option<Shape> {
    Some(match (parent, name) {
        // The two interfaces may come in either order.
        (_, "fmiModelDescription") => Shape { unordered: 1, ..ROOT },
        (_, "ModelExchange") => MODEL_EXCHANGE,
        (_, "CoSimulation") => CO_SIMULATION,
        (_, "SourceFiles") => list(&["File"]),
        (_, "File") => leaf(&["name"]),
        (_, "UnitDefinitions") => list(&["Unit"]),
        (_, "Unit") => branch(&["name"], &["BaseUnit", "DisplayUnit"]),
        (_, "BaseUnit") => leaf(&["factor", "offset"]).with(&BaseUnit::EXPONENTS),
        (_, "DisplayUnit") => leaf(&["name", "factor", "offset"]),
        (_, "TypeDefinitions") => list(&["SimpleType"]),
        (_, "SimpleType") => branch(
            &["name", "description"],
            &["Real", "Integer", "Boolean", "String", "Enumeration"],
        ),
        ("SimpleType", "Real") => leaf(REAL),
        ("SimpleType", "Integer") => leaf(INTEGER),
        ("SimpleType", "Enumeration") => branch(&["quantity"], &["Item"]),
        (_, "Item") => leaf(&["name", "value", "description"]),
        (_, "LogCategories") => list(&["Category"]),
        (_, "Category") => leaf(&["name", "description"]),
        (_, "DefaultExperiment") => leaf(&["startTime", "stopTime", "tolerance", "stepSize"]),
        // May be empty: `problems` reports an empty list.
        (_, "ModelVariables") => branch(&[], &["ScalarVariable"]),
        (_, "ScalarVariable") => VARIABLE,
        ("ScalarVariable", "Real") => {
            leaf(&["declaredType", "start", "derivative", "reinit"]).with(REAL)
        }
        ("ScalarVariable", "Integer" | "Enumeration") => {
            leaf(&["declaredType", "start"]).with(INTEGER)
        }
        ("ScalarVariable", "Boolean" | "String") => leaf(&["declaredType", "start"]),
        (_, "ModelStructure") => branch(&[], &["Outputs", "Derivatives", "InitialUnknowns"]),
        (_, "Outputs" | "Derivatives" | "InitialUnknowns") => list(&["Unknown"]),
        (_, "Unknown") => leaf(&["index", "dependencies", "dependenciesKind"]),
        _ => return None,
    })
}
