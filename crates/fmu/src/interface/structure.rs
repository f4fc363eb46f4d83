//! `ModelStructure` of a model, from the declared dependencies of its variables.

use std::collections::HashMap;

use crate::model::Failure;
use crate::variable::{Base, Declaration};
use fmu_description::{Causality, DependencyKind, Initial, ModelStructure, Unknown};

/// The variables of a model in the order of its description, found by their names.
pub(super) struct Variables<'a> {
    pub(super) declarations: &'a [Declaration],
    positions: HashMap<&'a str, usize>,
}

impl<'a> Variables<'a> {
    pub(super) fn new(declarations: &'a [Declaration]) -> Self {
        let names = declarations.iter().map(|variable| variable.name.as_str());
        let positions = names.enumerate().map(|(position, name)| (name, position)).collect();
        Self { declarations, positions }
    }

    /// Returns the position of the variable called `name`, to which the variable `of` refers; an error, which names
    /// both variables, if `name` does not exist.
    pub(super) fn find(&self, of: &str, name: &str) -> Result<usize, Failure> {
        self.positions.get(name).copied().ok_or_else(|| {
            Failure::Error(format!("{of} refers to {name}, which is no variable (section 2.2.7)"))
        })
    }
}

/// Returns the 1-based index in the description of the variable at `position`. Index 1 is `time`.
pub(super) fn index(position: usize) -> u32 {
    u32::try_from(position + 2).unwrap_or(u32::MAX)
}

/// Returns the positions of each continuous state and its derivative, in the order of the derivatives.
pub(super) fn states(variables: &Variables) -> Result<Vec<(usize, usize)>, Failure> {
    let mut states = Vec::new();
    for (derivative, variable) in variables.declarations.iter().enumerate() {
        if let Some(state) = &variable.derivative_of {
            states.push((variables.find(&variable.name, state)?, derivative));
        }
    }
    Ok(states)
}

/// Returns `ModelStructure`. `InitialUnknowns` are the outputs, derivatives, states and calculated
/// parameters that have `initial = calculated` or `approx`, and output clocks.
pub(super) fn structure(variables: &Variables) -> Result<ModelStructure, Failure> {
    let mut structure = ModelStructure::default();
    let states = states(variables)?;
    let is_state = |position| states.iter().any(|(state, _)| *state == position);
    for (position, variable) in variables.declarations.iter().enumerate() {
        let is_output = variable.causality == Causality::Output;
        let is_derivative = variable.derivative_of.is_some();
        if is_output || is_derivative {
            let own_state = resolve_alias(variables, position)?.filter(|state| is_state(*state));
            let row = dependency_row(variables, position, own_state)?;
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
        // An output clock may be listed (section 2.4.8); FMPy demands it.
        let is_clock = matches!(variable.base, Base::Clock);
        let computed = matches!(variable.initial, Some(Initial::Calculated | Initial::Approx));
        if exposed && (computed || is_clock) {
            structure.initial_unknowns.push(initial_row(variables, position)?);
        }
    }
    Ok(structure)
}

/// Returns `position` if a Real is there, and the position of the target if an alias is there; `None` for other
/// types.
fn resolve_alias(variables: &Variables, position: usize) -> Result<Option<usize>, Failure> {
    let variable = &variables.declarations[position];
    match &variable.base {
        Base::Real => Ok(Some(position)),
        Base::Alias(of) => variables.find(&variable.name, of).map(Some),
        _ => Ok(None),
    }
}

/// Returns the row of an output or derivative. A variable that is a state, or an alias of one, depends on this state,
/// `own_state`; a clocked variable depends on those of its clocks that are inputs (FMI 3.0.2, section 2.4.8). The first
/// of several dependencies on one known counts.
fn dependency_row(
    variables: &Variables,
    position: usize,
    own_state: Option<usize>,
) -> Result<Unknown, Failure> {
    let variable = &variables.declarations[position];
    let mut row = Vec::with_capacity(variable.direct.len() + 1);
    row.extend(own_state.map(|state| (index(state), DependencyKind::Constant)));
    for (name, kind) in &variable.direct {
        row.push((known(variables, variable, name)?, *kind));
    }
    for name in &variable.clocks {
        if let Some(&clock) = variables.positions.get(name.as_str())
            && variables.declarations[clock].causality == Causality::Input
        {
            row.push((index(clock), DependencyKind::Dependent));
        }
    }
    row.sort_by_key(|(known, _)| *known);
    row.dedup_by_key(|(known, _)| *known);
    Ok(self::row(index(position), row))
}

/// Returns the row of the variable with this index and these dependencies; the row states no kinds if all kinds are
/// [`DependencyKind::Dependent`].
pub(super) fn row(index: u32, dependencies: Vec<(u32, DependencyKind)>) -> Unknown {
    let (dependencies, kinds): (Vec<_>, Vec<_>) = dependencies.into_iter().unzip();
    let plain = kinds.iter().all(|kind| *kind == DependencyKind::Dependent);
    Unknown { index, dependencies: Some(dependencies), kinds: (!plain).then_some(kinds) }
}

/// Returns the index of the known called `name` of `variable`.
fn known(variables: &Variables, variable: &Declaration, name: &str) -> Result<u32, Failure> {
    Ok(if name == "time" { 1 } else { index(variables.find(&variable.name, name)?) })
}

fn initial_row(variables: &Variables, position: usize) -> Result<Unknown, Failure> {
    let variable = &variables.declarations[position];
    let Some(names) = &variable.initially else {
        return Ok(Unknown { index: index(position), dependencies: None, kinds: None });
    };
    let mut row = Vec::with_capacity(names.len());
    for name in names {
        row.push(known(variables, variable, name)?);
    }
    row.sort_unstable();
    row.dedup();
    Ok(Unknown { index: index(position), dependencies: Some(row), kinds: None })
}
