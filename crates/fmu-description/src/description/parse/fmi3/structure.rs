//! Reads `ModelStructure` of FMI 3.0, which refers to variables by value reference.

use std::collections::HashSet;

use super::variables::{A_REFERENCE, References};
use crate::description::parse::attributes::{Node, Result};
use crate::description::parse::structure::{
    ANYTHING, add_outputs, kinds, missing_outputs, model_structure, words,
};
use crate::description::{ModelStructure, ScalarVariable, Unknown};

/// Reads `ModelStructure` of `root` for `variables`.
///
/// A row whose `dependencies` refer to no variable is read as depending on all knowns, as is each output without a row.
/// A row whose own value reference belongs to no variable is skipped; in `ContinuousStateDerivative` such a row is an
/// error, because the rows of this list determine the states.
pub(super) fn read(
    root: Node<'_>,
    variables: &[ScalarVariable],
    references: &References,
) -> Result<ModelStructure> {
    let Some(element) = model_structure(root)? else {
        let missing = missing(&[], variables, references).map(|(row, _)| row);
        return Ok(ModelStructure { outputs: missing.collect(), ..ModelStructure::default() });
    };
    let mut outputs = list(element, "Output", references)?;
    let missing = missing(&outputs, variables, references).collect();
    add_outputs(element, &mut outputs, missing, ["an Output for every output", "none for"]);
    for row in element.children_named("ContinuousStateDerivative") {
        if index(row, references)?.is_none() {
            let stated = row.attribute("valueReference").unwrap_or_default();
            return Err(row.wrong("valueReference", A_REFERENCE, stated));
        }
    }
    Ok(ModelStructure {
        outputs,
        derivatives: list(element, "ContinuousStateDerivative", references)?,
        initial_unknowns: list(element, "InitialUnknown", references)?,
        clocked_states: list(element, "ClockedState", references)?,
        event_indicators: list(element, "EventIndicator", references)?,
    })
}

/// Returns rows for the outputs without a row, with their names. An output with the value reference of an earlier
/// variable gets no row, because the value reference stands for the earlier variable.
fn missing<'a>(
    rows: &[Unknown],
    variables: &'a [ScalarVariable],
    references: &References,
) -> impl Iterator<Item = (Unknown, &'a str)> {
    let meant: HashSet<u32> = references.values().copied().collect();
    missing_outputs(rows, variables).filter(move |(row, _)| meant.contains(&row.index))
}

/// Returns the index of the variable of a row; `None` if the value reference belongs to no variable.
fn index(row: Node<'_>, references: &References) -> Result<Option<u32>> {
    Ok(references.get(&row.unsigned("valueReference")?).copied())
}

fn list(element: Node<'_>, name: &'static str, references: &References) -> Result<Vec<Unknown>> {
    let mut rows = Vec::new();
    for row in element.children_named(name) {
        let Some(index) = index(row, references)? else {
            let stated = row.attribute("valueReference").unwrap_or_default();
            row.warn_text("valueReference", A_REFERENCE, stated, "the row was skipped");
            continue;
        };
        let dependencies = dependencies(row, references);
        let is_invalid = dependencies.is_none() && row.attribute("dependencies").is_some();
        let kinds = if is_invalid { None } else { kinds(row, dependencies.as_deref()) };
        rows.push(Unknown { index, dependencies, kinds });
    }
    Ok(rows)
}

/// Reads the attribute `dependencies` as indices; `None` if it is absent or, with a warning, refers to no variable.
fn dependencies(row: Node<'_>, references: &References) -> Option<Vec<u32>> {
    let text = row.attribute("dependencies")?;
    let mut indices = Vec::new();
    for word in words(text) {
        let index = word.parse().ok().and_then(|reference: u32| references.get(&reference));
        let Some(index) = index else {
            row.warn_text("dependencies", A_REFERENCE, word, ANYTHING);
            return None;
        };
        indices.push(*index);
    }
    Some(indices)
}
