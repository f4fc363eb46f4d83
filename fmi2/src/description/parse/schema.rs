//! Elements and attributes that the schema of FMI 2.0.5 does not have, or has in another order.

use super::attributes::Node;

/// An element of the schema: its attributes and its children in order.
struct Shape {
    attributes: &'static [&'static str],
    children: &'static [&'static str],
    /// The children are one optional list, which must not be empty.
    list: bool,
}

const fn leaf(attributes: &'static [&'static str]) -> Shape {
    Shape { attributes, children: &[], list: false }
}

const fn list(children: &'static [&'static str]) -> Shape {
    Shape { attributes: &[], children, list: true }
}

const fn branch(attributes: &'static [&'static str], children: &'static [&'static str]) -> Shape {
    Shape { attributes, children, list: false }
}

const ROOT: Shape = branch(
    &[
        "fmiVersion",
        "modelName",
        "guid",
        "description",
        "author",
        "version",
        "copyright",
        "license",
        "generationTool",
        "generationDateAndTime",
        "variableNamingConvention",
        "numberOfEventIndicators",
    ],
    &[
        "ModelExchange",
        "CoSimulation",
        "UnitDefinitions",
        "TypeDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "VendorAnnotations",
        "ModelVariables",
        "ModelStructure",
    ],
);
const MODEL_EXCHANGE: Shape = branch(
    &[
        "modelIdentifier",
        "needsExecutionTool",
        "completedIntegratorStepNotNeeded",
        "canBeInstantiatedOnlyOncePerProcess",
        "canNotUseMemoryManagementFunctions",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "providesDirectionalDerivative",
    ],
    &["SourceFiles"],
);
const CO_SIMULATION: Shape = branch(
    &[
        "modelIdentifier",
        "needsExecutionTool",
        "canHandleVariableCommunicationStepSize",
        "canInterpolateInputs",
        "maxOutputDerivativeOrder",
        "canRunAsynchronuously",
        "canBeInstantiatedOnlyOncePerProcess",
        "canNotUseMemoryManagementFunctions",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "providesDirectionalDerivative",
    ],
    &["SourceFiles"],
);
const VARIABLE: Shape = branch(
    &[
        "name",
        "valueReference",
        "description",
        "causality",
        "variability",
        "initial",
        "canHandleMultipleSetPerTimeInstant",
    ],
    &["Real", "Integer", "Boolean", "String", "Enumeration", "Annotations"],
);
const REAL_VARIABLE: Shape = leaf(&[
    "declaredType",
    "quantity",
    "unit",
    "displayUnit",
    "relativeQuantity",
    "min",
    "max",
    "nominal",
    "unbounded",
    "start",
    "derivative",
    "reinit",
]);
const REAL_TYPE: Shape = leaf(&[
    "quantity",
    "unit",
    "displayUnit",
    "relativeQuantity",
    "min",
    "max",
    "nominal",
    "unbounded",
]);
const INTEGER_VARIABLE: Shape = leaf(&["declaredType", "quantity", "min", "max", "start"]);
const BASE_UNIT: Shape = leaf(&["kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset"]);

/// The shape of the element `name` in `parent`; none where the schema does not go on.
fn shape(parent: &str, name: &str) -> Option<Shape> {
    Some(match (parent, name) {
        (_, "fmiModelDescription") => ROOT,
        (_, "ModelExchange") => MODEL_EXCHANGE,
        (_, "CoSimulation") => CO_SIMULATION,
        (_, "SourceFiles") => list(&["File"]),
        (_, "File") => leaf(&["name"]),
        (_, "UnitDefinitions") => list(&["Unit"]),
        (_, "Unit") => branch(&["name"], &["BaseUnit", "DisplayUnit"]),
        (_, "BaseUnit") => BASE_UNIT,
        (_, "DisplayUnit") => leaf(&["name", "factor", "offset"]),
        (_, "TypeDefinitions") => list(&["SimpleType"]),
        (_, "SimpleType") => branch(
            &["name", "description"],
            &["Real", "Integer", "Boolean", "String", "Enumeration"],
        ),
        ("SimpleType", "Real") => REAL_TYPE,
        ("SimpleType", "Integer") => leaf(&["quantity", "min", "max"]),
        ("SimpleType", "Enumeration") => branch(&["quantity"], &["Item"]),
        (_, "Item") => leaf(&["name", "value", "description"]),
        (_, "LogCategories") => list(&["Category"]),
        (_, "Category") => leaf(&["name", "description"]),
        (_, "DefaultExperiment") => leaf(&["startTime", "stopTime", "tolerance", "stepSize"]),
        // That it is empty is for the rules to say.
        (_, "ModelVariables") => branch(&[], &["ScalarVariable"]),
        (_, "ScalarVariable") => VARIABLE,
        ("ScalarVariable", "Real") => REAL_VARIABLE,
        ("ScalarVariable", "Integer" | "Enumeration") => INTEGER_VARIABLE,
        ("ScalarVariable", "Boolean" | "String") => leaf(&["declaredType", "start"]),
        (_, "ModelStructure") => branch(&[], &["Outputs", "Derivatives", "InitialUnknowns"]),
        (_, "Outputs" | "Derivatives" | "InitialUnknowns") => list(&["Unknown"]),
        (_, "Unknown") => leaf(&["index", "dependencies", "dependenciesKind"]),
        _ => return None,
    })
}

/// Warns of everything below `node`, which stands in an element called `parent`.
pub(super) fn check(node: Node<'_>, parent: &str) {
    let element = node.element;
    let Some(shape) = shape(parent, element.name) else { return };
    for (name, value) in &element.attributes {
        // Name spaces are not FMI's.
        let known = shape.attributes.contains(name) || *name == "xmlns" || name.contains(':');
        if !known {
            node.warn(name, "an attribute of the standard", value, "it was skipped");
        }
    }
    if shape.list && element.children.is_empty() {
        let place = format!("<{}>", element.name);
        let said = ("an item, or no such list", "none".to_owned());
        node.warn_of(true, place, said, "read as no list");
    }
    let mut last = 0;
    for child in &element.children {
        let inner = Node { element: child, ..node };
        let position = shape.children.iter().position(|name| *name == child.name);
        let Some(position) = position else {
            let place = format!("<{}> in <{}>", child.name, element.name);
            let said = ("an element of the standard", "another one".to_owned());
            inner.warn_of(true, place, said, "it was skipped");
            continue;
        };
        // The two interfaces may come in either order.
        let position = if element.name == ROOT_NAME { position.max(1) } else { position };
        if position < last {
            let place = format!("<{}>", child.name);
            let expected = format!("the order {}", shape.children.join(", "));
            let found = format!("it after {}", shape.children[last]);
            inner.warn_of(true, place, (&expected, found), "it was read all the same");
        }
        last = last.max(position);
        check(inner, element.name);
    }
}

const ROOT_NAME: &str = "fmiModelDescription";
