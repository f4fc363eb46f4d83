//! Warns of elements and attributes that the schema of FMI 2.0.5 does not have, or has in another
//! order.

use super::attributes::Node;
use crate::unit::BaseUnit;

/// An element of the schema: its attributes and its children in order.
struct Shape {
    attributes: &'static [&'static str],
    /// Attributes that this element shares with other elements.
    shared: &'static [&'static str],
    children: &'static [&'static str],
    /// The children are one optional list, which must not be empty.
    list: bool,
}

impl Shape {
    const fn with(self, shared: &'static [&'static str]) -> Shape {
        Shape { shared, ..self }
    }
}

const fn leaf(attributes: &'static [&'static str]) -> Shape {
    branch(attributes, &[])
}

const fn list(children: &'static [&'static str]) -> Shape {
    Shape { list: true, ..branch(&[], children) }
}

const fn branch(attributes: &'static [&'static str], children: &'static [&'static str]) -> Shape {
    Shape { attributes, shared: &[], children, list: false }
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
/// Attributes of both interfaces.
const INTERFACE: &[&str] = &[
    "modelIdentifier",
    "needsExecutionTool",
    "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "providesDirectionalDerivative",
];
const MODEL_EXCHANGE: Shape =
    branch(&["completedIntegratorStepNotNeeded"], &["SourceFiles"]).with(INTERFACE);
const CO_SIMULATION: Shape = branch(
    &[
        "canHandleVariableCommunicationStepSize",
        "canInterpolateInputs",
        "maxOutputDerivativeOrder",
        "canRunAsynchronuously",
    ],
    &["SourceFiles"],
)
.with(INTERFACE);
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
/// Attributes of Real and of Integer, as a type and as a variable.
const REAL: &[&str] =
    &["quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal", "unbounded"];
const INTEGER: &[&str] = &["quantity", "min", "max"];

/// The shape of the element `name` in `parent`; `None` if the schema does not define its content.
fn shape(parent: &str, name: &str) -> Option<Shape> {
    Some(match (parent, name) {
        (_, "fmiModelDescription") => ROOT,
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
        // The rules report an empty list, not the schema.
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

/// Warns of everything below `node`, a child of the element `parent`.
pub(super) fn check(node: Node<'_>, parent: &str) {
    let element = node.element;
    let Some(shape) = shape(parent, element.name) else { return };
    for (name, value) in &element.attributes {
        // FMI defines no namespaces.
        let own = shape.attributes.contains(name) || shape.shared.contains(name);
        let known = own || *name == "xmlns" || name.contains(':');
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
