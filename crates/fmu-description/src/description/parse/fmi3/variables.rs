//! Reads `ModelVariables` of FMI 3.0: variables, arrays and aliases.

use std::collections::HashMap;

use super::kinds::attributes;
use super::start;
use crate::defect::ParseError;
use crate::description::parse::attributes::{Node, Result};
use crate::description::parse::structure::words;
use crate::description::parse::variables::{
    Types, VARIABLES, by_name, check_names, check_references, declared,
};
use crate::description::{
    Causality, Dimension, Elements, Initial, Kind, ScalarVariable, SimpleType, Variability,
};
use crate::limits::{HELP, exceeds};

/// Maximum size in bytes of the texts and lists that aliases copy from their variables.
const ALIASES: usize = 128 << 20;

pub(super) const A_REFERENCE: &str = "the value reference of a variable";

/// Maps a value reference to the 1-based index of its variable, the first one that is no alias.
pub(super) type References = HashMap<u32, u32>;

/// Returns the variables, each followed by its aliases, and the indices of value references.
pub(super) fn read(
    list: Node<'_>,
    types: &[SimpleType],
) -> Result<(Vec<ScalarVariable>, References)> {
    let types = by_name(types);
    let (mut elements, mut variables) = (Vec::new(), Vec::new());
    // An alias of a few bytes in the file copies the texts and lists of its variable, which may be long.
    let mut inherited = 0;
    for element in list.children() {
        let Some(kind) = Kind::blank(element.element.name) else { continue };
        let variable = variable(element, kind, &types)?;
        let position = variables.len();
        elements.push(element);
        variables.push(variable);
        for element in element.children_named("Alias") {
            let alias = alias(element, &variables[position])?;
            inherited += copied_bytes(&alias);
            if exceeds(inherited, ALIASES) {
                let (at, limit) = (element.element.at, ALIASES);
                return Err(ParseError::Limit { at, what: "bytes of aliases", limit, help: HELP });
            }
            elements.push(element);
            variables.push(alias);
        }
        if exceeds(variables.len(), VARIABLES) {
            let at = list.element.at;
            return Err(ParseError::Limit { at, what: "variables", limit: VARIABLES, help: HELP });
        }
    }
    check_names(&elements, &variables)?;
    check_references(&elements, &variables)?;
    let references = references(&elements, &variables);
    check_dimensions(&elements, &mut variables, &references)?;
    for (element, variable) in elements.iter().zip(&mut variables) {
        resolve(*element, variable, &references)?;
    }
    Ok((variables, references))
}

/// Maps value references to indices, without aliases. If several variables share one, warns and takes the first
/// variable.
fn references(elements: &[Node<'_>], variables: &[ScalarVariable]) -> References {
    let mut references = HashMap::with_capacity(variables.len());
    for ((index, variable), element) in (1..).zip(variables).zip(elements) {
        if variable.alias_of.is_some() {
            continue;
        }
        if let Some(first) = references.get(&variable.value_reference) {
            let expected = format!("one that no other variable has, variable {first} has it");
            let actual = variable.value_reference.to_string();
            let assumed = "references to it are read as the first variable";
            element.warn_text("valueReference", &expected, &actual, assumed);
        } else {
            references.insert(variable.value_reference, index);
        }
    }
    references
}

fn variable(element: Node<'_>, mut kind: Kind, types: &Types<'_>) -> Result<ScalarVariable> {
    let causality = element.word("causality", Causality::WORDS).unwrap_or(Causality::Local);
    attributes(element, &mut kind, declared(element, types))?;
    if let Some(real) = kind.as_real_mut() {
        real.derivative = reference(element, "derivative")?;
        real.reinit = element.flag("reinit");
    }
    let start_elements = start::read(element, &mut kind)?;
    Ok(ScalarVariable {
        name: element.required("name")?.to_owned(),
        value_reference: element.unsigned("valueReference")?,
        description: element.text("description"),
        causality,
        variability: variability(element, causality, &kind),
        initial: element.word("initial", Initial::WORDS),
        kind,
        dimensions: element.children_named("Dimension").map(dimension).collect::<Result<_, _>>()?,
        start_elements,
        can_handle_multiple_set_per_time_instant: element
            .optional_flag("canHandleMultipleSetPerTimeInstant"),
        intermediate_update: element.flag("intermediateUpdate"),
        previous: reference(element, "previous")?,
        clocks: clocks(element)?,
        ..ScalarVariable::default()
    })
}

/// Reads an `Alias` of `variable`: another variable with its value and attributes, but without start value.
fn alias(element: Node<'_>, variable: &ScalarVariable) -> Result<ScalarVariable> {
    let mut kind = variable.kind.clone();
    kind.clear_start();
    let mut alias = ScalarVariable {
        name: element.required("name")?.to_owned(),
        value_reference: variable.value_reference,
        description: element.text("description").or_else(|| variable.description.clone()),
        causality: variable.causality,
        variability: variable.variability,
        initial: variable.initial,
        kind,
        dimensions: variable.dimensions.clone(),
        start_elements: None,
        can_handle_multiple_set_per_time_instant: variable.can_handle_multiple_set_per_time_instant,
        intermediate_update: variable.intermediate_update,
        previous: variable.previous,
        clocks: variable.clocks.clone(),
        alias_of: Some(variable.name.clone()),
        negated: false,
    };
    if let (Some(unit), Some(real)) = (element.text("displayUnit"), alias.kind.as_real_mut()) {
        real.display_unit = Some(unit);
    }
    Ok(alias)
}

/// Returns the approximate size in bytes of the texts and lists of an alias, mostly copies from its variable.
fn copied_bytes(alias: &ScalarVariable) -> usize {
    let text = |attribute: &Option<String>| attribute.as_ref().map_or(0, String::len);
    let kind = match &alias.kind {
        Kind::Binary(binary) => text(&binary.mime_type),
        other => {
            let real = other.as_real();
            real.map_or(0, |real| {
                text(&real.quantity) + text(&real.unit) + text(&real.display_unit)
            }) + other.as_integer().map_or(0, |integer| text(&integer.quantity))
        }
    };
    let declared = alias.kind.declared_type().map_or(0, str::len);
    let lists = 16 * alias.dimensions.len() + 4 * alias.clocks.len();
    text(&alias.description) + text(&alias.alias_of) + kind + declared + lists
}

/// Reads `variability`, or returns its default (section 2.4.7.4).
fn variability(element: Node<'_>, causality: Causality, kind: &Kind) -> Variability {
    use Causality::{CalculatedParameter, Parameter, StructuralParameter};
    let continuous = kind.as_real().is_some();
    let default = match causality {
        Parameter | CalculatedParameter | StructuralParameter => Variability::Fixed,
        _ if continuous => Variability::Continuous,
        _ => Variability::Discrete,
    };
    let stated = element.word("variability", Variability::WORDS).unwrap_or(default);
    if stated == Variability::Continuous && !continuous {
        let expected = format!("another one than continuous for {}", element.element.name);
        let assumed = format!("read as {}", default.as_str());
        element.warn_text("variability", &expected, stated.as_str(), &assumed);
        return default;
    }
    stated
}

/// Reads a `Dimension`; with both `start` and `valueReference`, `start` counts; without both, returns an error.
fn dimension(element: Node<'_>) -> Result<Dimension> {
    let start = element.optional_counter("start").map(Dimension::Fixed);
    let reference = reference(element, "valueReference")?.map(Dimension::Variable);
    if start.is_some() && reference.is_some() {
        let place = "<Dimension>".to_owned();
        let expected = "start or valueReference";
        element.warn_of(false, place, expected, "both".to_owned(), "read with its start");
    }
    let missing = || element.child_error("start or valueReference", "neither".to_owned());
    start.or(reference).ok_or_else(missing)
}

fn reference(element: Node<'_>, name: &'static str) -> Result<Option<u32>> {
    if element.has(name) { element.unsigned(name).map(Some) } else { Ok(None) }
}

/// Reads the attribute `clocks` as value references.
fn clocks(element: Node<'_>) -> Result<Vec<u32>> {
    let text = element.attribute("clocks").unwrap_or_default();
    let wrong = |word| element.wrong("clocks", "value references of clocks", word);
    words(text).map(|word| word.parse().map_err(|_| wrong(word))).collect()
}

/// Removes, with a warning, each list of start values whose length is not the number of elements.
///
/// # Errors
///
/// A dimension whose value reference belongs to no integer with a start value from 0.
fn check_dimensions(
    elements: &[Node<'_>],
    variables: &mut [ScalarVariable],
    references: &References,
) -> Result<()> {
    let extent = |reference: u32, variables: &[ScalarVariable]| {
        let index = usize::try_from(*references.get(&reference)?).ok()?;
        let start = variables.get(index.checked_sub(1)?)?.kind.as_integer()?.start?;
        u64::try_from(start).ok()
    };
    for position in 0..variables.len() {
        let (element, variable) = (elements[position], &variables[position]);
        let mut size = 1_u64;
        for dimension in &variable.dimensions {
            let extent = match *dimension {
                Dimension::Fixed(extent) => extent,
                Dimension::Variable(reference) => {
                    extent(reference, variables).ok_or_else(|| {
                        let expected = "the value reference of an integer with a start value";
                        element.wrong("valueReference", expected, &reference.to_string())
                    })?
                }
            };
            size = size.saturating_mul(extent);
        }
        let count = variable.start_elements.as_ref().map(Elements::len);
        let fits = count.is_none_or(|count| u64::try_from(count) == Ok(size));
        if !fits {
            let actual = format!("{} values", count.unwrap_or_default());
            let expected = format!("one value or {size}");
            let place = element.place("start");
            element.warn_of(false, place, &expected, actual, "read without start values");
            variables[position].start_elements = None;
        }
    }
    Ok(())
}

/// Replaces value references by indices. A value reference that belongs to no variable is an error; in `previous` such
/// a reference gives a warning and counts as missing.
fn resolve(
    element: Node<'_>,
    variable: &mut ScalarVariable,
    references: &References,
) -> Result<()> {
    let index = |name, reference: u32| {
        let position = references.get(&reference).copied();
        position.ok_or_else(|| element.wrong(name, A_REFERENCE, &reference.to_string()))
    };
    if let Some(real) = variable.kind.as_real_mut() {
        real.derivative =
            real.derivative.map(|reference| index("derivative", reference)).transpose()?;
    }
    if let Some(reference) = variable.previous {
        variable.previous = references.get(&reference).copied();
        if variable.previous.is_none() {
            let assumed = "read as if it were not there";
            element.warn_text("previous", A_REFERENCE, &reference.to_string(), assumed);
        }
    }
    for clock in &mut variable.clocks {
        *clock = index("clocks", *clock)?;
    }
    Ok(())
}
