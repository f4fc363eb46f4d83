//! Rules on `ModelStructure` (section 2.4.8).

use std::collections::{BTreeSet, HashSet};

use crate::description::rules::Problems;
use crate::description::rules::structure::{
    check_dependencies, check_initial_rows, check_members, initial_unknowns, is_clocked,
    is_external, states,
};
use crate::description::{Causality, ScalarVariable, Variability};

const SECTION: &str = "2.4.8";

pub(in crate::description::rules) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    let structure = &description.structure;
    let states = states(["ContinuousStateDerivative", "derivative"], problems);
    check_reinit(&states, problems);
    let outputs = description.indices_of(|variable| {
        variable.causality == Causality::Output && variable.alias_of.is_none()
    });
    check_members("Output", &structure.outputs, &outputs, problems);
    check_initial_unknowns(&states, problems);
    check_indicators(problems);
    let clocked = description
        .indices_of(|variable| variable.previous.is_some() && variable.alias_of.is_none());
    check_members("ClockedState", &structure.clocked_states, &clocked, problems);

    let known = |index: u32, variable: &ScalarVariable| {
        is_external(variable)
            || variable.causality == Causality::Parameter
            || variable.causality == Causality::StructuralParameter
            || variable.variability == Variability::Constant
            || states.contains(&index)
            // May be a discrete-time state: the standard marks only the clocked ones.
            || variable.variability == Variability::Discrete
    };
    for (list, rows) in [
        ("Output", &structure.outputs),
        ("ContinuousStateDerivative", &structure.derivatives),
        ("ClockedState", &structure.clocked_states),
        ("EventIndicator", &structure.event_indicators),
    ] {
        for row in rows {
            check_dependencies(list, row, known, problems);
        }
    }
    check_initial_rows("InitialUnknown", problems);
}

/// Checks that only continuous states have `reinit`.
fn check_reinit(states: &HashSet<u32>, problems: &mut Problems<'_>) {
    for (index, variable) in (1..).zip(&problems.description.variables) {
        let reinit = variable.kind.as_real().is_some_and(|real| real.reinit);
        let reinit = reinit && variable.alias_of.is_none();
        problems.demand(!reinit || states.contains(&index), "2.4.7.5", || {
            format!("variable {}: only a continuous-time state can have reinit", variable.name)
        });
    }
}

/// Checks that `InitialUnknown` has all required variables and no others, except clocks and clocked variables.
fn check_initial_unknowns(states: &HashSet<u32>, problems: &mut Problems<'_>) {
    let description = problems.description;
    let required = initial_unknowns(description, states);
    let rows = &description.structure.initial_unknowns;
    let listed: BTreeSet<u32> = rows.iter().map(|row| row.index).collect();
    let optional = listed.iter().filter(|index| description.at(**index).is_some_and(is_clocked));
    let allowed: BTreeSet<u32> = required.iter().chain(optional).copied().collect();
    check_members("InitialUnknown", rows, &allowed, problems);
}

/// Checks that event indicators are continuous local or output floats, each once.
fn check_indicators(problems: &mut Problems<'_>) {
    let description = problems.description;
    let mut earlier = HashSet::new();
    for row in &description.structure.event_indicators {
        let name = description.name_of(row.index);
        let fits = description.at(row.index).is_some_and(|variable| {
            variable.kind.as_real().is_some()
                && variable.variability == Variability::Continuous
                && matches!(variable.causality, Causality::Local | Causality::Output)
        });
        problems.demand(fits, SECTION, || {
            format!("EventIndicator, {name}: it is not a continuous local or output float")
        });
        problems.demand(earlier.insert(row.index), SECTION, || {
            format!("EventIndicator has variable {name} twice")
        });
    }
}
