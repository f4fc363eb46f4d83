//! Rules on `ModelVariables` (sections 2.4.7.3 to 2.4.7.5).

use std::collections::HashMap;

use super::{arrays, clocks};
use crate::description::rules::Problems;
use crate::description::rules::variables::{
    check_declared_type, check_integer, check_order, check_real, check_start, check_table,
};
use crate::description::{Causality, Elements, Kind, ScalarVariable, Variability, Version};

const ALIASES: &str = "2.4.7.3";
const ATTRIBUTES: &str = "2.4.7.4";
const TYPED: &str = "2.4.7.5";

pub(in crate::description::rules) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    problems.demand(!description.variables.is_empty(), "2.4.7.1", || {
        "ModelVariables has no variable".to_owned()
    });
    let types =
        description.types.iter().map(|declared| (declared.name.as_str(), declared)).collect();
    for variable in &description.variables {
        let text = variable.description.as_deref().unwrap_or_default();
        problems.text(ATTRIBUTES, &format!("description of variable {}", variable.name), text);
        if variable.alias_of.is_none() {
            check_table(variable, problems);
            check_flags(variable, problems);
            check_start(variable, matches!(variable.kind, Kind::Clock(_)), problems);
            check_numbers(variable, problems);
            check_declared_type(variable, &types, problems);
            check_derivative(variable, problems);
        }
    }
    let independent: Vec<&ScalarVariable> = description
        .variables
        .iter()
        .filter(|variable| {
            variable.causality == Causality::Independent && variable.alias_of.is_none()
        })
        .collect();
    problems.demand(independent.len() == 1, ATTRIBUTES, || {
        format!("{} variables are independent, exactly one must be", independent.len())
    });
    for variable in independent {
        let float = variable.kind.as_real().is_some() && variable.dimensions.is_empty();
        problems.demand(float, ATTRIBUTES, || {
            format!("variable {}: the independent variable must be a scalar Float", variable.name)
        });
    }
    check_references(problems);
    arrays::check(problems);
    clocks::check(problems);
}

/// Checks attributes that only some variables may have.
fn check_flags(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    let name = &variable.name;
    let input = variable.causality == Causality::Input;
    let multiple_set = variable.can_handle_multiple_set_per_time_instant.is_some();
    problems.demand(input || !multiple_set, ATTRIBUTES, || {
        format!("variable {name}: only inputs have canHandleMultipleSetPerTimeInstant")
    });
    let continuous = variable.variability == Variability::Continuous;
    problems.demand(continuous || !variable.intermediate_update, ATTRIBUTES, || {
        format!("variable {name}: only continuous variables can have intermediateUpdate")
    });
}

/// Checks limits and start values: their order, the range of the type, characters of texts, `maxSize` of a Binary.
fn check_numbers(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    let who = format!("variable {}", variable.name);
    let kind = &variable.kind;
    if let Some(real) = kind.as_real() {
        check_real(&who, real, problems);
        if let Some(Elements::Real(starts)) = &variable.start_elements {
            let outside = |start: &&f64| !inside(**start, real.min, real.max);
            if let Some(start) = starts.iter().find(outside) {
                check_order(&who, real.min, Some(*start), real.max, problems);
            }
        }
    }
    if let (Some(integer), Some(range)) = (kind.as_integer(), kind.integer_range(Version::V3)) {
        check_integer(&who, integer, problems);
        let starts = match &variable.start_elements {
            Some(Elements::Integer(starts)) => starts.as_slice(),
            _ => &[],
        };
        let outside = |start: &&i128| !inside(**start, integer.min, integer.max);
        if let Some(start) = starts.iter().find(outside) {
            check_order(&who, integer.min, Some(*start), integer.max, problems);
        }
        let mut numbers = [integer.min, integer.max, integer.start]
            .into_iter()
            .flatten()
            .chain(starts.iter().copied());
        if let Some(value) = numbers.find(|value| !range.contains(value)) {
            let kind = kind.element_in(Version::V3);
            let (low, high) = range.into_inner();
            let text = format!("{who}: {value} is no number of type {kind}, {low} to {high}");
            problems.add(TYPED, text);
        }
    }
    match (kind, &variable.start_elements) {
        (Kind::String(Some(start)), None) => {
            problems.text(TYPED, &format!("start of {who}"), start);
        }
        (Kind::String(_), Some(Elements::String(starts))) => {
            for start in starts {
                problems.text(TYPED, &format!("start of {who}"), start);
            }
        }
        (Kind::Binary(binary), starts) => {
            let starts = match starts {
                Some(Elements::Binary(starts)) => starts.as_slice(),
                _ => binary.start.as_slice(),
            };
            let longest = starts.iter().filter_map(|start| u64::try_from(start.len()).ok()).max();
            let fits = longest.zip(binary.max_size).is_none_or(|(length, most)| length <= most);
            problems
                .demand(fits, TYPED, || format!("{who}: the start value is longer than maxSize"));
        }
        _ => {}
    }
}

fn inside<T: Copy + PartialOrd>(value: T, min: Option<T>, max: Option<T>) -> bool {
    min.is_none_or(|min| min <= value) && max.is_none_or(|max| value <= max)
}

/// Checks that `derivative` connects two different continuous floats of equal dimensions.
fn check_derivative(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    let Some(index) = variable.kind.as_real().and_then(|real| real.derivative) else { return };
    let name = &variable.name;
    let Some(state) = problems.description.at(index) else {
        let text = format!("variable {name}: derivative is the reference of no variable");
        return problems.add(TYPED, text);
    };
    let is_continuous = |variable: &ScalarVariable| {
        variable.kind.as_real().is_some() && variable.variability == Variability::Continuous
    };
    let sound = !std::ptr::eq(state, variable) && is_continuous(state) && is_continuous(variable);
    problems.demand(sound && state.dimensions == variable.dimensions, TYPED, || {
        format!(
            "variable {name}: derivative must connect two different continuous floats of equal \
             dimensions, it points at {}",
            state.name
        )
    });
}

/// Checks that only aliases share a value reference, and that each alias names a variable with the value reference and
/// type of the alias.
fn check_references(problems: &mut Problems<'_>) {
    let description = problems.description;
    let mut variables: HashMap<u32, &ScalarVariable> = HashMap::new();
    for variable in description.variables.iter().filter(|variable| variable.alias_of.is_none()) {
        if let Some(first) = variables.insert(variable.value_reference, variable) {
            let text = format!(
                "variables {} and {} have the value reference {}",
                first.name, variable.name, variable.value_reference
            );
            problems.add(ATTRIBUTES, text);
        }
    }
    for alias in &description.variables {
        let Some(of) = &alias.alias_of else { continue };
        let variable =
            variables.get(&alias.value_reference).filter(|variable| variable.name == *of);
        let kind = alias.kind.element();
        problems.demand(
            variable.is_some_and(|variable| variable.kind.element() == kind),
            ALIASES,
            || {
                format!(
                    "alias {}: there is no variable {of} of its type and value reference",
                    alias.name
                )
            },
        );
    }
}
