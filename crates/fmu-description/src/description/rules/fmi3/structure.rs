//! Rules on `ModelStructure` (section 2.4.8).

use std::collections::{BTreeSet, HashSet};

use crate::description::rules::Problems;
use crate::description::rules::structure::{List, check_members};
use crate::description::{
    Causality, DependencyKind, Initial, Kind, ModelDescription, ScalarVariable, Unknown,
    Variability,
};

const SECTION: &str = "2.4.8";

pub(in crate::description::rules) fn check(
    description: &ModelDescription,
    problems: &mut Problems,
) {
    let structure = &description.structure;
    let states = states(description, problems);
    let outputs = description.indices_of(|variable| {
        variable.causality == Causality::Output && variable.alias_of.is_none()
    });
    let list = List { name: "Output", section: SECTION, rows: &structure.outputs };
    check_members(&list, &outputs, description, problems);
    check_initial_unknowns(description, &states, problems);
    check_indicators(description, problems);
    let clocked = description
        .indices_of(|variable| variable.previous.is_some() && variable.alias_of.is_none());
    let rows = &structure.clocked_states;
    let list = List { name: "ClockedState", section: SECTION, rows };
    check_members(&list, &clocked, description, problems);

    let known = |index: u32, variable: &ScalarVariable| {
        is_given(variable)
            || variable.causality == Causality::Parameter
            || variable.causality == Causality::StructuralParameter
            || variable.variability == Variability::Constant
            || states.contains(&index)
            // The standard marks only clocked ones of the discrete-time states.
            || variable.variability == Variability::Discrete
    };
    for (list, rows) in [
        ("Output", &structure.outputs),
        ("ContinuousStateDerivative", &structure.derivatives),
        ("ClockedState", &structure.clocked_states),
        ("EventIndicator", &structure.event_indicators),
    ] {
        for row in rows {
            check_dependencies(list, row, description, known, problems);
        }
    }
    let known_at_start = |_: u32, variable: &ScalarVariable| {
        is_given(variable) || variable.initial_in_force() == Some(Initial::Exact)
    };
    for row in &structure.initial_unknowns {
        check_dependencies("InitialUnknown", row, description, known_at_start, problems);
        let allowed = [DependencyKind::Dependent, DependencyKind::Constant];
        let holds = row.kinds.iter().flatten().all(|kind| allowed.contains(kind));
        problems.demand(holds, SECTION, || {
            let name = description.name_of(row.index);
            format!("InitialUnknown, {name}: dependenciesKind may be dependent or constant only")
        });
    }
}

fn is_given(variable: &ScalarVariable) -> bool {
    matches!(variable.causality, Causality::Input | Causality::Independent)
        || matches!(variable.kind, Kind::Clock(_))
}

/// Returns the continuous states, whose derivatives are the rows of `ContinuousStateDerivative`.
fn states(description: &ModelDescription, problems: &mut Problems) -> HashSet<u32> {
    let mut states = HashSet::new();
    for row in &description.structure.derivatives {
        let name = description.name_of(row.index);
        let derivative =
            description.at(row.index).and_then(|variable| variable.kind.as_real()?.derivative);
        let Some(state) = derivative else {
            let text = format!("ContinuousStateDerivative, {name}: it has no derivative");
            problems.add(SECTION, text);
            continue;
        };
        problems.demand(states.insert(state), SECTION, || {
            format!(
                "ContinuousStateDerivative, {name}: its state has another derivative in the list"
            )
        });
        let is_state = |variable: &ScalarVariable| {
            matches!(variable.causality, Causality::Local | Causality::Output)
                && variable.variability == Variability::Continuous
        };
        problems.demand(description.at(state).is_some_and(is_state), SECTION, || {
            let state = description.name_of(state);
            format!(
                "ContinuousStateDerivative, {name}: its state {state} is not a continuous local or \
                 output"
            )
        });
    }
    for (index, variable) in (1..).zip(&description.variables) {
        let reinit = variable.kind.as_real().is_some_and(|real| real.reinit);
        let reinit = reinit && variable.alias_of.is_none();
        problems.demand(!reinit || states.contains(&index), "2.4.7.5", || {
            format!("variable {}: only a continuous-time state can have reinit", variable.name)
        });
    }
    states
}

/// Checks that `InitialUnknown` has all that it must have, and nothing else but clocked variables.
fn check_initial_unknowns(
    description: &ModelDescription,
    states: &HashSet<u32>,
    problems: &mut Problems,
) {
    let derivatives = description.structure.derivatives.iter().map(|row| row.index);
    let exposed: HashSet<u32> = states.iter().copied().chain(derivatives).collect();
    let computed = |variable: &ScalarVariable| {
        matches!(variable.initial_in_force(), Some(Initial::Approx | Initial::Calculated))
    };
    let mut required = description.indices_of(|variable| {
        let clocked = !variable.clocks.is_empty() || matches!(variable.kind, Kind::Clock(_));
        variable.alias_of.is_none()
            && match variable.causality {
                Causality::CalculatedParameter => true,
                Causality::Output => !clocked && computed(variable),
                _ => false,
            }
    });
    required.extend(exposed.iter().filter(|index| description.at(**index).is_some_and(computed)));
    let rows = &description.structure.initial_unknowns;
    let listed: BTreeSet<u32> = rows.iter().map(|row| row.index).collect();
    let optional = listed.iter().filter(|index| {
        description.at(**index).is_some_and(|variable| {
            !variable.clocks.is_empty() || matches!(variable.kind, Kind::Clock(_))
        })
    });
    let allowed: BTreeSet<u32> = required.iter().chain(optional).copied().collect();
    let list = List { name: "InitialUnknown", section: SECTION, rows };
    check_members(&list, &allowed, description, problems);
}

fn check_indicators(description: &ModelDescription, problems: &mut Problems) {
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

/// Checks that dependencies are unique known quantities with one allowed kind each.
fn check_dependencies(
    list: &str,
    row: &Unknown,
    description: &ModelDescription,
    is_known: impl Fn(u32, &ScalarVariable) -> bool,
    problems: &mut Problems,
) {
    let name = description.name_of(row.index);
    let dependencies = row.dependencies.as_deref().unwrap_or_default();
    let unique: HashSet<&u32> = dependencies.iter().collect();
    problems.demand(unique.len() == dependencies.len(), SECTION, || {
        format!("{list}, {name}: a dependency is there twice")
    });
    for index in dependencies {
        let known = description.at(*index).is_some_and(|variable| is_known(*index, variable));
        problems.demand(known, SECTION, || {
            let other = description.name_of(*index);
            format!("{list}, {name}: a dependency on {other} cannot be stated, it is no known")
        });
    }
    let Some(kinds) = &row.kinds else { return };
    let paired = row.dependencies.is_some() && kinds.len() == dependencies.len();
    problems.demand(paired, SECTION, || {
        format!("{list}, {name}: dependenciesKind is not as long as dependencies")
    });
    let float = description.at(row.index).is_some_and(|variable| variable.kind.as_real().is_some());
    let plain = kinds.iter().all(|kind| *kind == DependencyKind::Dependent);
    problems.demand(float || plain, SECTION, || {
        format!("{list}, {name}: only for a float may dependenciesKind be other than dependent")
    });
}
