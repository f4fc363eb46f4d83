//! Rules on `ModelStructure` of FMI 2.0 (section 2.2.8), some of which also apply to FMI 3.0.

use std::collections::{BTreeSet, HashSet};

use super::Problems;
use crate::description::{
    Causality, DependencyKind, Initial, Kind, ModelDescription, ScalarVariable, Unknown,
    Variability, Version,
};

const SECTION: &str = "2.2.8";

impl ModelDescription {
    /// Returns the 1-based indices of the variables for which `holds` is true.
    pub(super) fn indices_of(&self, holds: impl Fn(&ScalarVariable) -> bool) -> BTreeSet<u32> {
        let numbered = (1..).zip(&self.variables);
        numbered.filter(|(_, variable)| holds(variable)).map(|(index, _)| index).collect()
    }

    /// Returns the name of the variable with a 1-based index, or the index as text if there is none.
    pub(super) fn name_of(&self, index: u32) -> String {
        self.at(index).map_or_else(|| format!("number {index}"), |variable| variable.name.clone())
    }
}

/// Checks the lists of `ModelStructure`: members, dependencies and their kinds.
pub(super) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    let structure = &description.structure;
    let states = states(["Derivatives", "attribute derivative"], problems);
    let outputs = description.indices_of(|variable| variable.causality == Causality::Output);
    check_members("Outputs", &structure.outputs, &outputs, problems);
    let unknowns = initial_unknowns(description, &states);
    let rows = &structure.initial_unknowns;
    check_members("InitialUnknowns", rows, &unknowns, problems);
    let ascending = rows.windows(2).all(|pair| pair[0].index <= pair[1].index);
    problems.demand(ascending, SECTION, || "InitialUnknowns are not in ascending order".to_owned());

    let known =
        |index: u32, variable: &ScalarVariable| is_external(variable) || states.contains(&index);
    for (list, rows) in [("Outputs", &structure.outputs), ("Derivatives", &structure.derivatives)] {
        for row in rows {
            check_dependencies(list, row, known, problems);
        }
    }
    check_initial_rows("InitialUnknowns", problems);
}

/// Whether the importer's environment determines the variable: an input, the independent variable or a clock.
pub(super) fn is_external(variable: &ScalarVariable) -> bool {
    matches!(variable.causality, Causality::Input | Causality::Independent)
        || matches!(variable.kind, Kind::Clock(_))
}

/// Whether the variable is a clock or has the attribute `clocks`.
pub(super) fn is_clocked(variable: &ScalarVariable) -> bool {
    !variable.clocks.is_empty() || matches!(variable.kind, Kind::Clock(_))
}

/// Checks the dependencies of the initial unknowns, the rows of `list`: all are known at initialization and of the kind
/// `dependent` or `constant`.
pub(super) fn check_initial_rows(list: &str, problems: &mut Problems<'_>) {
    let description = problems.description;
    let is_known = |_: u32, variable: &ScalarVariable| {
        is_external(variable) || variable.initial_in_force() == Some(Initial::Exact)
    };
    let allowed = [DependencyKind::Dependent, DependencyKind::Constant];
    for row in &description.structure.initial_unknowns {
        check_dependencies(list, row, is_known, problems);
        let holds = row.kinds.iter().flatten().all(|kind| allowed.contains(kind));
        problems.demand(holds, problems.sections.structure, || {
            let name = description.name_of(row.index);
            format!("{list}, {name}: dependenciesKind may be dependent or constant only")
        });
    }
}

/// Whether the variable is of a floating-point type of this version.
pub(super) fn is_real(variable: &ScalarVariable, version: Version) -> bool {
    match variable.kind {
        Kind::Float32(_) => version == Version::V3,
        _ => variable.kind.as_real().is_some(),
    }
}

/// Returns the indices of the continuous states. Their derivatives are the rows of `list`; a row without `needed`,
/// the attribute that names its state, is a problem.
pub(super) fn states([list, needed]: [&str; 2], problems: &mut Problems<'_>) -> HashSet<u32> {
    let (description, version) = (problems.description, problems.version);
    let section = problems.sections.structure;
    let mut states = HashSet::new();
    for row in &description.structure.derivatives {
        let name = description.name_of(row.index);
        let variable = description.at(row.index).filter(|variable| is_real(variable, version));
        let derivative = variable.and_then(|variable| variable.kind.as_real()?.derivative);
        let Some(state) = derivative else {
            problems.add(section, format!("{list}, {name}: it has no {needed}"));
            continue;
        };
        problems.demand(states.insert(state), section, || {
            format!("{list}, {name}: its state has another derivative in the list")
        });
        let is_state = |variable: &ScalarVariable| {
            matches!(variable.causality, Causality::Local | Causality::Output)
                && variable.variability == Variability::Continuous
        };
        problems.demand(description.at(state).is_some_and(is_state), section, || {
            let state = description.name_of(state);
            format!("{list}, {name}: its state {state} is not a continuous local or output")
        });
    }
    states
}

/// Returns the indices that the initial unknowns must have, without clocks and clocked variables.
pub(super) fn initial_unknowns(
    description: &ModelDescription,
    states: &HashSet<u32>,
) -> BTreeSet<u32> {
    let derivatives = description.structure.derivatives.iter().map(|row| row.index);
    let exposed = states.iter().copied().chain(derivatives);
    let computed = |variable: &ScalarVariable| {
        matches!(variable.initial_in_force(), Some(Initial::Approx | Initial::Calculated))
    };
    let mut indices = description.indices_of(|variable| {
        variable.alias_of.is_none()
            && match variable.causality {
                Causality::CalculatedParameter => true,
                Causality::Output => !is_clocked(variable) && computed(variable),
                _ => false,
            }
    });
    indices.extend(exposed.filter(|index| description.at(*index).is_some_and(computed)));
    indices
}

/// Checks that the rows of `list` are exactly the variables in `required`, each once.
pub(super) fn check_members(
    list: &str,
    rows: &[Unknown],
    required: &BTreeSet<u32>,
    problems: &mut Problems<'_>,
) {
    let (description, section) = (problems.description, problems.sections.structure);
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

/// Checks that dependencies are unique (in FMI 2.0 also ascending) and known, with one kind each; kinds other than
/// `dependent` only for floating-point variables.
pub(super) fn check_dependencies(
    list: &str,
    row: &Unknown,
    is_known: impl Fn(u32, &ScalarVariable) -> bool,
    problems: &mut Problems<'_>,
) {
    let (description, version) = (problems.description, problems.version);
    let section = problems.sections.structure;
    let third = version == Version::V3;
    let name = description.name_of(row.index);
    let dependencies = row.dependencies.as_deref().unwrap_or_default();
    if third {
        let unique: HashSet<&u32> = dependencies.iter().collect();
        problems.demand(unique.len() == dependencies.len(), section, || {
            format!("{list}, {name}: a dependency is there twice")
        });
    } else {
        problems.demand(dependencies.windows(2).all(|pair| pair[0] < pair[1]), section, || {
            format!("{list}, {name}: dependencies are not ascending and unique")
        });
    }
    for index in dependencies {
        let known = description.at(*index).is_some_and(|variable| is_known(*index, variable));
        problems.demand(known, section, || {
            let other = description.name_of(*index);
            format!("{list}, {name}: a dependency on {other} cannot be stated, it is no known")
        });
    }
    let Some(kinds) = &row.kinds else { return };
    let paired = row.dependencies.is_some() && kinds.len() == dependencies.len();
    problems.demand(paired, section, || {
        format!("{list}, {name}: dependenciesKind is not as long as dependencies")
    });
    let real = description.at(row.index).is_some_and(|variable| is_real(variable, version));
    let plain = kinds.iter().all(|kind| *kind == DependencyKind::Dependent);
    problems.demand(real || plain, section, || {
        let kind = if third { "float" } else { "Real" };
        format!("{list}, {name}: only for a {kind} may dependenciesKind be other than dependent")
    });
}
