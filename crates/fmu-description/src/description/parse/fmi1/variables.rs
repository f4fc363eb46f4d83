//! Reads `ModelVariables` of FMI 1.0, and the dependencies of the outputs.

use std::collections::HashMap;

use crate::description::parse::attributes::{Node, Result};
use crate::description::parse::structure::ANYTHING;
use crate::description::parse::variables::{
    Types, check_names, check_references, kind, scalar_variables, typed,
};
use crate::description::{
    Causality, Initial, ModelStructure, ScalarVariable, SimpleType, Unknown, Variability,
};

const VARIABILITIES: [&str; 4] = ["constant", "parameter", "discrete", "continuous"];
const CAUSALITIES: [&str; 4] = ["input", "output", "internal", "none"];

/// Reads the variables, and the outputs with the inputs on which they depend.
pub(super) fn read(
    list: Node<'_>,
    types: &[SimpleType],
) -> Result<(Vec<ScalarVariable>, ModelStructure)> {
    let (elements, mut variables) = scalar_variables(list, types, variable)?;
    set_aliases(&elements, &mut variables);
    check_names(&elements, &variables)?;
    check_references(&elements, &variables)?;
    let outputs = outputs(&elements, &variables)?;
    Ok((variables, ModelStructure { outputs, ..ModelStructure::default() }))
}

fn variable(element: Node<'_>, types: &Types<'_>, count: usize) -> Result<ScalarVariable> {
    let value = typed(element)?;
    let kind = kind(value, types, count)?;
    let stated = element.one_of("variability", &VARIABILITIES);
    let continuous = kind.as_real().is_some();
    let (causality, variability) = match (element.one_of("causality", &CAUSALITIES), stated) {
        // Stays an output, because it may be connected, although its value does not change after the initialization.
        (Some("output"), Some("parameter")) => (Causality::Output, Variability::Discrete),
        (_, Some("parameter")) if kind.has_start() => (Causality::Parameter, Variability::Fixed),
        (_, Some("parameter")) => (Causality::CalculatedParameter, Variability::Fixed),
        (causality, variability) => {
            let causality = match causality {
                Some("input") => Causality::Input,
                Some("output") => Causality::Output,
                _ => Causality::Local,
            };
            let variability = match variability {
                Some("constant") => Variability::Constant,
                // Continuous is the default for every type, although only a Real can be continuous.
                Some("continuous") | None if continuous => Variability::Continuous,
                _ => Variability::Discrete,
            };
            (causality, variability)
        }
    };
    let has_initial = matches!(causality, Causality::Output | Causality::Local) && kind.has_start();
    let initial = has_initial.then(|| match value.boolean("fixed") {
        Ok(Some(false)) => Initial::Approx,
        _ => Initial::Exact,
    });
    Ok(ScalarVariable {
        name: element.required("name")?.to_owned(),
        value_reference: element.unsigned("valueReference")?,
        description: element.text("description"),
        causality,
        variability,
        initial,
        kind,
        ..ScalarVariable::default()
    })
}

/// Sets `alias_of` and `negated` by the attribute `alias`. Warns of an alias whose value reference no other variable of
/// its base type has, and ignores the attribute `alias`.
fn set_aliases(elements: &[Node<'_>], variables: &mut [ScalarVariable]) {
    const NAME: &str = "alias";
    let stated: Vec<_> = elements
        .iter()
        .map(|element| element.one_of(NAME, &["noAlias", "alias", "negatedAlias"]))
        .collect();
    let is_alias = |stated: Option<&str>| matches!(stated, Some("alias" | "negatedAlias"));
    let mut bases: HashMap<(&str, u32), String> = HashMap::new();
    for (variable, stated) in variables.iter().zip(&stated) {
        if !is_alias(*stated) {
            let key = (variable.kind.base(), variable.value_reference);
            bases.entry(key).or_insert_with(|| variable.name.clone());
        }
    }
    for ((element, variable), stated) in elements.iter().zip(variables).zip(stated) {
        if !is_alias(stated) {
            continue;
        }
        let base_name = bases.get(&(variable.kind.base(), variable.value_reference));
        if base_name.is_none() {
            let expected = "the value reference of a variable with alias=\"noAlias\"";
            let actual = variable.value_reference.to_string();
            element.warn_text(NAME, expected, &actual, "read as if it were not there");
        }
        variable.alias_of = base_name.cloned();
        variable.negated = base_name.is_some() && stated == Some("negatedAlias");
    }
}

/// Returns the outputs with their `DirectDependency`. Without this element, or with a name in it that no input
/// has, an output depends on all inputs.
fn outputs(elements: &[Node<'_>], variables: &[ScalarVariable]) -> Result<Vec<Unknown>> {
    let inputs =
        (1..).zip(variables).filter(|(_, variable)| variable.causality == Causality::Input);
    let inputs: HashMap<&str, u32> =
        inputs.map(|(index, variable)| (variable.name.as_str(), index)).collect();
    let mut rows = Vec::new();
    for ((index, variable), element) in (1..).zip(variables).zip(elements) {
        if variable.causality == Causality::Output {
            let direct = element.optional_child("DirectDependency")?;
            let dependencies = direct.and_then(|list| dependencies(list, &inputs));
            rows.push(Unknown { index, dependencies, kinds: None });
        }
    }
    Ok(rows)
}

/// Returns the sorted indices of the inputs in `DirectDependency`; `None`, with a warning, if one is no input.
fn dependencies(element: Node<'_>, inputs: &HashMap<&str, u32>) -> Option<Vec<u32>> {
    let mut indices = Vec::new();
    for name in element.children_named("Name") {
        let text = name.content_text();
        let Some(index) = inputs.get(text.as_str()) else {
            let place = "<Name> in <DirectDependency>".to_owned();
            name.warn_of(false, place, "the name of an input", format!("{text:?}"), ANYTHING);
            return None;
        };
        indices.push(*index);
    }
    indices.sort_unstable();
    indices.dedup();
    Some(indices)
}
