//! Reads `ModelStructure` of FMI 2.0; some functions are also for FMI 3.0.

use std::collections::HashSet;

use super::attributes::{Node, Result, WHITE_SPACE};
use crate::description::{Causality, DependencyKind, ModelStructure, ScalarVariable, Unknown};

pub(super) const ANYTHING: &str = "read as depending on anything";

/// Reads `ModelStructure` of `root` for `variables`.
///
/// If a list has an index that belongs to no variable, all of its rows are read as depending on all knowns, and a row
/// with such an index of its own is skipped; in `Derivatives` such a row is an error. Outputs that are missing from
/// `Outputs` are read as depending on all knowns.
pub(super) fn read(root: Node<'_>, variables: &[ScalarVariable]) -> Result<ModelStructure> {
    let Some(element) = model_structure(root)? else {
        let missing = missing_outputs(&[], variables).map(|(row, _)| row);
        return Ok(ModelStructure { outputs: missing.collect(), ..ModelStructure::default() });
    };
    let mut outputs = list(element, "Outputs", variables.len())?;
    let missing = missing_outputs(&outputs, variables).collect();
    add_outputs(element, &mut outputs, missing, ["every output in Outputs", "no row for"]);
    Ok(ModelStructure {
        outputs,
        derivatives: derivatives(element, variables.len())?,
        initial_unknowns: list(element, "InitialUnknowns", variables.len())?,
        ..ModelStructure::default()
    })
}

/// Returns the element `ModelStructure`, or warns that there is none.
pub(super) fn model_structure(root: Node<'_>) -> Result<Option<Node<'_>>> {
    let element = root.optional_child("ModelStructure")?;
    if element.is_none() {
        let place = "<fmiModelDescription>".to_owned();
        let expected = "an element ModelStructure";
        root.warn_of(true, place, expected, "none".to_owned(), ANYTHING);
    }
    Ok(element)
}

/// Adds the rows in `missing`, each with the name of its output, to `outputs`. A warning states the `expected`
/// content and, after the words `none_for`, the names.
pub(super) fn add_outputs(
    element: Node<'_>,
    outputs: &mut Vec<Unknown>,
    missing: Vec<(Unknown, &str)>,
    [expected, none_for]: [&str; 2],
) {
    if missing.is_empty() {
        return;
    }
    let names: Vec<_> = missing.iter().take(5).map(|(_, name)| *name).collect();
    let more = if missing.len() > 5 { ", and others" } else { "" };
    let actual = format!("{none_for} {}{more}", names.join(", "));
    element.warn_of(false, "<ModelStructure>".to_owned(), expected, actual, ANYTHING);
    outputs.extend(missing.into_iter().map(|(row, _)| row));
}

/// Returns rows for the outputs that are no aliases and have no row, with their names.
pub(super) fn missing_outputs<'a>(
    rows: &[Unknown],
    variables: &'a [ScalarVariable],
) -> impl Iterator<Item = (Unknown, &'a str)> {
    let listed: HashSet<u32> = rows.iter().map(|row| row.index).collect();
    (1..).zip(variables).filter_map(move |(index, variable)| {
        let missing = variable.causality == Causality::Output
            && variable.alias_of.is_none()
            && !listed.contains(&index);
        missing.then(|| (Unknown { index, ..Unknown::default() }, variable.name.as_str()))
    })
}

/// Reads the list called `name` in `ModelStructure`, for `count` variables; empty if there is none.
fn list(element: Node<'_>, name: &'static str, count: usize) -> Result<Vec<Unknown>> {
    let Some(list) = element.optional_child(name)? else { return Ok(Vec::new()) };
    let mut trusted = true;
    let mut rows = Vec::new();
    for row in list.children_named("Unknown") {
        let text = row.required("index")?;
        let Some(index) = index(text, count) else {
            row.warn_text("index", &indices(count), text, "the row was skipped");
            trusted = false;
            continue;
        };
        let Ok(dependencies) = dependencies(row, count) else {
            trusted = false;
            rows.push(Unknown { index, ..Unknown::default() });
            continue;
        };
        let kinds = kinds(row, dependencies.as_deref());
        rows.push(Unknown { index, dependencies, kinds });
    }
    if !trusted {
        let place = format!("<{name}>");
        list.warn_of(false, place, &indices(count), "others".to_owned(), ANYTHING);
        for row in &mut rows {
            (row.dependencies, row.kinds) = (None, None);
        }
    }
    Ok(rows)
}

/// Reads `Derivatives`. Its rows determine the states, so an index in them that belongs to no variable is an error.
fn derivatives(element: Node<'_>, count: usize) -> Result<Vec<Unknown>> {
    if let Some(list) = element.optional_child("Derivatives")? {
        for row in list.children_named("Unknown") {
            let text = row.required("index")?;
            index(text, count).ok_or_else(|| row.wrong("index", &indices(count), text))?;
        }
    }
    list(element, "Derivatives", count)
}

/// Reads the 1-based index of one of `count` variables; `None` for any other text.
pub(super) fn index(text: &str, count: usize) -> Option<u32> {
    let index = text.trim_matches(WHITE_SPACE).parse::<u32>().ok()?;
    (index > 0 && usize::try_from(index).is_ok_and(|position| position <= count)).then_some(index)
}

/// Returns the text for the expected index in a message.
pub(super) fn indices(count: usize) -> String {
    format!("the index of a variable, 1 to {count}")
}

/// Returns the parts of `text` between white space.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(WHITE_SPACE).filter(|word| !word.is_empty())
}

/// The error for an index that belongs to no variable.
struct InvalidIndex;

/// Reads the attribute `dependencies`; `None` if it is absent. Warns of an index that belongs to no variable.
fn dependencies(row: Node<'_>, count: usize) -> Result<Option<Vec<u32>>, InvalidIndex> {
    let Some(text) = row.attribute("dependencies") else { return Ok(None) };
    let mut listed = Vec::new();
    for word in words(text) {
        let Some(index) = index(word, count) else {
            row.warn_text("dependencies", &indices(count), word, ANYTHING);
            return Err(InvalidIndex);
        };
        listed.push(index);
    }
    Ok(Some(listed))
}

/// Reads the attribute `dependenciesKind`; `None` if it is absent or, with a warning, if it has an unknown word or
/// another number of words than `dependencies`.
pub(super) fn kinds(row: Node<'_>, dependencies: Option<&[u32]>) -> Option<Vec<DependencyKind>> {
    const NAME: &str = "dependenciesKind";
    let text = row.attribute(NAME)?;
    let expected = match dependencies {
        None => "no such attribute without dependencies".to_owned(),
        Some(indices) => format!(
            "{} of dependent, constant, fixed, tunable or discrete, as many as dependencies",
            indices.len()
        ),
    };
    let kinds: Option<Vec<DependencyKind>> = words(text).map(|word| word.parse().ok()).collect();
    let kinds =
        kinds.filter(|kinds| dependencies.is_some_and(|indices| indices.len() == kinds.len()));
    if kinds.is_none() {
        row.warn_text(NAME, &expected, text, "read as dependent");
    }
    kinds
}
