//! The schema of FMI 1.0 for co-simulation.

use super::{Shape, branch, leaf, list, names};

const ROOT: Shape = branch(
    names! {
        fmiVersion modelName modelIdentifier guid description author version generationTool
        generationDateAndTime variableNamingConvention numberOfContinuousStates numberOfEventIndicators
    },
    names! {
        UnitDefinitions TypeDefinitions DefaultExperiment VendorAnnotations ModelVariables Implementation
    },
);
const CAPABILITIES: Shape = leaf(names! {
    canHandleVariableCommunicationStepSize canHandleEvents canRejectSteps canInterpolateInputs
    maxOutputDerivativeOrder canRunAsynchronuously canSignalEvents canBeInstantiatedOnlyOncePerProcess
    canNotUseMemoryManagementFunctions
});
/// Attributes of a Real, as a type and as a variable.
const REAL: &[&str] =
    &["quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal"];
/// Attributes of an Integer or Enumeration, as a type and as a variable.
const INTEGER: &[&str] = &["quantity", "min", "max"];

/// The shape of the element `name` in `parent`; `None` if the schema does not define its content.
pub(super) fn shape(parent: &str, name: &str) -> Option<Shape> {
    Some(match (parent, name) {
        (_, "fmiModelDescription") => ROOT,
        (_, "UnitDefinitions") => list(&["BaseUnit"]),
        (_, "BaseUnit") => branch(&["unit"], &["DisplayUnitDefinition"]),
        (_, "DisplayUnitDefinition") => leaf(&["displayUnit", "gain", "offset"]),
        (_, "TypeDefinitions") => list(&["Type"]),
        (_, "Type") => branch(
            &["name", "description"],
            &["RealType", "IntegerType", "BooleanType", "StringType", "EnumerationType"],
        ),
        (_, "RealType") => leaf(REAL),
        (_, "IntegerType") => leaf(INTEGER),
        (_, "EnumerationType") => branch(INTEGER, &["Item"]),
        (_, "Item") => leaf(&["name", "description"]),
        (_, "DefaultExperiment") => leaf(&["startTime", "stopTime", "tolerance"]),
        (_, "ModelVariables") => branch(&[], &["ScalarVariable"]),
        (_, "ScalarVariable") => branch(
            &["name", "valueReference", "description", "variability", "causality", "alias"],
            &["Real", "Integer", "Boolean", "String", "Enumeration", "DirectDependency"],
        ),
        (_, "Real") => leaf(&["declaredType", "start", "fixed"]).with(REAL),
        (_, "Integer" | "Enumeration") => leaf(&["declaredType", "start", "fixed"]).with(INTEGER),
        (_, "Boolean" | "String") => leaf(&["declaredType", "start", "fixed"]),
        (_, "DirectDependency") => branch(&[], &["Name"]),
        (_, "Implementation") => branch(&[], &["CoSimulation_StandAlone", "CoSimulation_Tool"]),
        (_, "CoSimulation_StandAlone") => branch(&[], &["Capabilities"]),
        (_, "CoSimulation_Tool") => branch(&[], &["Capabilities", "Model"]),
        (_, "Capabilities") => CAPABILITIES,
        _ => return None,
    })
}
