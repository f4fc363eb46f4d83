//! `ModelStructure` of a model, from the dependencies that its variables state.

use crate::model::Failure;
use crate::variable::{Access, Variable};
use fmu_description::{Causality, DependencyKind, Initial, ModelStructure, Unknown};

/// The 1-based index of the variable at `position`: `time` is the first.
pub(super) fn index(position: usize) -> u32 {
    u32::try_from(position + 2).unwrap_or(u32::MAX)
}

/// The position of the variable called `name`, which `of` refers to.
pub(super) fn find<M>(variables: &[Variable<M>], of: &str, name: &str) -> Result<usize, Failure> {
    let found = variables.iter().position(|variable| variable.name == name);
    found.ok_or_else(|| Failure::Error(format!("{of} refers to {name}, which is no variable")))
}

/// Positions of the continuous states and of their derivatives, in the order of the derivatives.
pub(super) fn states<M>(variables: &[Variable<M>]) -> Result<Vec<(usize, usize)>, Failure> {
    let mut states = Vec::new();
    for (derivative, variable) in variables.iter().enumerate() {
        if let Some(state) = &variable.derivative_of {
            states.push((find(variables, &variable.name, state)?, derivative));
        }
    }
    Ok(states)
}

/// `Outputs`, `Derivatives`, and as `InitialUnknowns` those of them, of the states and of the
/// calculated parameters that are not given by a start value.
pub(super) fn structure<M>(variables: &[Variable<M>]) -> Result<ModelStructure, Failure> {
    let mut structure = ModelStructure::default();
    let states = states(variables)?;
    let is_state = |position| states.iter().any(|(state, _)| *state == position);
    for (position, variable) in variables.iter().enumerate() {
        let is_output = variable.causality == Causality::Output;
        let is_derivative = variable.derivative_of.is_some();
        if is_output || is_derivative {
            let own_state = state_behind(variables, position)?.filter(|state| is_state(*state));
            let row = at_a_point(variables, position, own_state)?;
            if is_output {
                structure.outputs.push(row.clone());
            }
            if is_derivative {
                structure.derivatives.push(row);
            }
        }
        let exposed = is_output
            || is_derivative
            || is_state(position)
            || variable.causality == Causality::CalculatedParameter;
        if exposed && matches!(variable.initial, Some(Initial::Calculated | Initial::Approx)) {
            structure.initial_unknowns.push(at_the_start(variables, position)?);
        }
    }
    Ok(structure)
}

/// The variable itself, or the one that it is an alias of.
fn state_behind<M>(variables: &[Variable<M>], position: usize) -> Result<Option<usize>, Failure> {
    let variable = &variables[position];
    match &variable.access {
        Access::Real(_) => Ok(Some(position)),
        Access::Alias(of) => find(variables, &variable.name, of).map(Some),
        _ => Ok(None),
    }
}

/// The row of an output or derivative. One that is a state, perhaps by another name, depends on
/// that state.
fn at_a_point<M>(
    variables: &[Variable<M>],
    position: usize,
    own_state: Option<usize>,
) -> Result<Unknown, Failure> {
    let variable = &variables[position];
    let mut found = Vec::with_capacity(variable.direct.len() + 1);
    found.extend(own_state.map(|state| (index(state), DependencyKind::Constant)));
    for (name, kind) in &variable.direct {
        let known = if name == "time" { 1 } else { index(find(variables, &variable.name, name)?) };
        found.push((known, *kind));
    }
    found.sort_by_key(|(known, _)| *known);
    found.dedup_by_key(|(known, _)| *known);
    let (dependencies, kinds): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let plain = kinds.iter().all(|kind| *kind == DependencyKind::Dependent);
    Ok(Unknown {
        index: index(position),
        dependencies: Some(dependencies),
        kinds: (!plain).then_some(kinds),
    })
}

/// The row of an initial value.
fn at_the_start<M>(variables: &[Variable<M>], position: usize) -> Result<Unknown, Failure> {
    let variable = &variables[position];
    let Some(names) = &variable.initially else {
        return Ok(Unknown { index: index(position), dependencies: None, kinds: None });
    };
    let mut found = Vec::with_capacity(names.len());
    for name in names {
        found.push(if name == "time" { 1 } else { index(find(variables, &variable.name, name)?) });
    }
    found.sort_unstable();
    found.dedup();
    Ok(Unknown { index: index(position), dependencies: Some(found), kinds: None })
}
