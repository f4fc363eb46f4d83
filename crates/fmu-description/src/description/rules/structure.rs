//! Rules on `ModelStructure` of FMI 2.0 (section 2.2.8).

use std::collections::{BTreeSet, HashSet};

use super::Problems;
use crate::description::{
    Causality, DependencyKind, Initial, Kind, ModelDescription, RealType, ScalarVariable, Unknown,
    Variability,
};

const SECTION: &str = "2.2.8";

impl ModelDescription {
    /// Returns the 1-based indices of the variables that `chosen` accepts.
    pub(super) fn indices_of(&self, chosen: impl Fn(&ScalarVariable) -> bool) -> BTreeSet<u32> {
        let numbered = (1..).zip(&self.variables);
        numbered.filter(|(_, variable)| chosen(variable)).map(|(index, _)| index).collect()
    }

    pub(super) fn name_of(&self, index: u32) -> String {
        self.at(index).map_or_else(|| format!("number {index}"), |variable| variable.name.clone())
    }
}

pub(super) fn check(description: &ModelDescription, problems: &mut Problems) {
    let structure = &description.structure;
    let states = states(description, problems);
    let outputs = description.indices_of(|variable| variable.causality == Causality::Output);
    let list = List { name: "Outputs", section: SECTION, rows: &structure.outputs };
    check_members(&list, &outputs, description, problems);
    let unknowns = initial_unknowns(description, &states);
    let rows = &structure.initial_unknowns;
    let list = List { name: "InitialUnknowns", section: SECTION, rows };
    check_members(&list, &unknowns, description, problems);
    let ascending = rows.windows(2).all(|pair| pair[0].index <= pair[1].index);
    problems.demand(ascending, SECTION, || "InitialUnknowns are not in ascending order".to_owned());

    let is_given = |variable: &ScalarVariable| {
        matches!(variable.causality, Causality::Input | Causality::Independent)
    };
    let known =
        |index: u32, variable: &ScalarVariable| is_given(variable) || states.contains(&index);
    for (list, rows) in [("Outputs", &structure.outputs), ("Derivatives", &structure.derivatives)] {
        for row in rows {
            check_dependencies(list, row, description, known, problems);
        }
    }
    let known_at_start = |_: u32, variable: &ScalarVariable| {
        is_given(variable) || variable.initial_in_force() == Some(Initial::Exact)
    };
    for row in rows {
        check_dependencies("InitialUnknowns", row, description, known_at_start, problems);
        check_initial_kinds(row, description, problems);
    }
}

/// Checks that a dependency at initialization is general or has a constant factor.
fn check_initial_kinds(row: &Unknown, description: &ModelDescription, problems: &mut Problems) {
    let allowed = [DependencyKind::Dependent, DependencyKind::Constant];
    let holds = row.kinds.iter().flatten().all(|kind| allowed.contains(kind));
    problems.demand(holds, SECTION, || {
        let name = description.name_of(row.index);
        format!("InitialUnknowns, {name}: dependenciesKind may be dependent or constant only")
    });
}

/// Returns the continuous states, whose derivatives are the rows of `Derivatives`.
fn states(description: &ModelDescription, problems: &mut Problems) -> HashSet<u32> {
    let mut states = HashSet::new();
    for row in &description.structure.derivatives {
        let name = description.name_of(row.index);
        let derivative = description.at(row.index).and_then(|variable| match variable.kind {
            Kind::Real(RealType { derivative, .. }) => derivative,
            _ => None,
        });
        let Some(state) = derivative else {
            problems.add(SECTION, format!("Derivatives, {name}: it has no attribute derivative"));
            continue;
        };
        problems.demand(states.insert(state), SECTION, || {
            format!("Derivatives, {name}: its state has another derivative in the list")
        });
        let is_state = |variable: &ScalarVariable| {
            matches!(variable.causality, Causality::Local | Causality::Output)
                && variable.variability == Variability::Continuous
        };
        problems.demand(description.at(state).is_some_and(is_state), SECTION, || {
            let state = description.name_of(state);
            format!("Derivatives, {name}: its state {state} is not a continuous local or output")
        });
    }
    states
}

/// Returns the indices that `InitialUnknowns` must have.
fn initial_unknowns(description: &ModelDescription, states: &HashSet<u32>) -> BTreeSet<u32> {
    let derivatives = description.structure.derivatives.iter().map(|row| row.index);
    let exposed: HashSet<u32> = states.iter().copied().chain(derivatives).collect();
    let computed = |variable: &ScalarVariable| {
        matches!(variable.initial_in_force(), Some(Initial::Approx | Initial::Calculated))
    };
    let mut indices = description.indices_of(|variable| match variable.causality {
        Causality::CalculatedParameter => true,
        Causality::Output => computed(variable),
        _ => false,
    });
    indices.extend(exposed.iter().filter(|index| description.at(**index).is_some_and(computed)));
    indices
}

/// A list of `ModelStructure`, with the section of the standard that says what belongs there.
pub(super) struct List<'a> {
    pub(super) name: &'static str,
    pub(super) section: &'static str,
    pub(super) rows: &'a [Unknown],
}

/// Checks that a list has exactly the required members, each once.
pub(super) fn check_members(
    list: &List<'_>,
    required: &BTreeSet<u32>,
    description: &ModelDescription,
    problems: &mut Problems,
) {
    let List { name: list, section, rows } = *list;
    let mut members = BTreeSet::new();
    for row in rows {
        problems.demand(members.insert(row.index), section, || {
            format!("{list} has variable {} twice", description.name_of(row.index))
        });
    }
    for index in required.difference(&members) {
        problems.add(section, format!("{list} lacks variable {}", description.name_of(*index)));
    }
    for index in members.difference(required) {
        let name = description.name_of(*index);
        problems.add(section, format!("{list} has variable {name}, which does not belong there"));
    }
}

/// Checks that dependencies ascend, are known quantities, and have one allowed kind each.
fn check_dependencies(
    list: &str,
    row: &Unknown,
    description: &ModelDescription,
    is_known: impl Fn(u32, &ScalarVariable) -> bool,
    problems: &mut Problems,
) {
    let name = description.name_of(row.index);
    let dependencies = row.dependencies.as_deref().unwrap_or_default();
    problems.demand(dependencies.windows(2).all(|pair| pair[0] < pair[1]), SECTION, || {
        format!("{list}, {name}: dependencies are not ascending and unique")
    });
    for index in dependencies {
        let known = description.at(*index).is_some_and(|variable| is_known(*index, variable));
        problems.demand(known, SECTION, || {
            let other = description.name_of(*index);
            format!("{list}, {name}: a dependency on {other} cannot be stated, it is no known")
        });
    }
    let Some(kinds) = &row.kinds else { return };
    problems.demand(
        row.dependencies.is_some() && kinds.len() == dependencies.len(),
        SECTION,
        || format!("{list}, {name}: dependenciesKind is not as long as dependencies"),
    );
    let real =
        description.at(row.index).is_some_and(|variable| matches!(variable.kind, Kind::Real(_)));
    let plain = kinds.iter().all(|kind| *kind == DependencyKind::Dependent);
    problems.demand(real || plain, SECTION, || {
        format!("{list}, {name}: only for a Real may dependenciesKind be other than dependent")
    });
}
