//! Rules on `ModelVariables` of FMI 2.0 (section 2.2.7), and on limits in both versions.

use std::collections::{BTreeMap, HashMap};

use super::Problems;
use crate::description::{
    Causality, Initial, IntegerType, Kind, ModelDescription, RealType, ScalarVariable, SimpleType,
    Variability,
};

const SECTION: &str = "2.2.7";

pub(super) fn check(description: &ModelDescription, problems: &mut Problems) {
    problems.demand(!description.variables.is_empty(), SECTION, || {
        "ModelVariables has no variable".to_owned()
    });
    let types =
        description.types.iter().map(|declared| (declared.name.as_str(), declared)).collect();
    for variable in &description.variables {
        check_table(variable, problems);
        check_start(variable, false, problems);
        check_declared_type(variable, &types, problems);
        check_derivative(variable, description, problems);
        let who = format!("variable {}", variable.name);
        let text = variable.description.as_deref().unwrap_or_default();
        problems.text(SECTION, &format!("description of {who}"), text);
        match &variable.kind {
            Kind::Real(real) => check_real(&who, real, problems),
            Kind::Integer(integer) | Kind::Enumeration(integer) => {
                check_integer(&who, integer, problems);
            }
            Kind::String(start) => {
                let start = start.as_deref().unwrap_or_default();
                problems.text(SECTION, &format!("start of {who}"), start);
            }
            Kind::Boolean(_) => {}
            other => problems.add(
                SECTION,
                format!("{who} is of type {}, which FMI 2.0 does not have", other.element()),
            ),
        }
        problems.demand(variable.dimensions.is_empty(), SECTION, || {
            format!("{who} is an array, which FMI 2.0 does not have")
        });
    }
    let is_independent = |variable: &&ScalarVariable| variable.causality == Causality::Independent;
    let independent = description.variables.iter().filter(is_independent).count();
    problems.demand(independent <= 1, SECTION, || {
        format!("{independent} variables are independent, at most one may be")
    });
    check_aliases(description, problems);
}

/// Checks the tables of causality, variability and initial.
fn check_table(variable: &ScalarVariable, problems: &mut Problems) {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter};
    use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
    let name = &variable.name;
    let allowed: &[Initial] = match (variable.causality, variable.variability) {
        (Parameter, Fixed | Tunable) | (Output | Local, Constant) => &[Initial::Exact],
        (CalculatedParameter | Local, Fixed | Tunable) => &[Initial::Calculated, Initial::Approx],
        (Output | Local, Discrete | Continuous) => {
            &[Initial::Calculated, Initial::Exact, Initial::Approx]
        }
        (Input, Discrete | Continuous) | (Independent, Continuous) => &[],
        (causality, variability) => {
            let (causality, variability) = (causality.as_str(), variability.as_str());
            let text = format!("variable {name}: a {causality} cannot be {variability}");
            return problems.add(SECTION, text);
        }
    };
    if let Some(initial) = variable.initial {
        problems.demand(allowed.contains(&initial), SECTION, || {
            let (causality, variability) =
                (variable.causality.as_str(), variable.variability.as_str());
            let initial = initial.as_str();
            format!(
                "variable {name}: initial {initial} is not allowed for {variability} {causality}"
            )
        });
    }
    let real = matches!(variable.kind, Kind::Real(_));
    problems.demand(real || variable.variability != Continuous, SECTION, || {
        format!("variable {name}: only a Real can be continuous, which is the default")
    });
}

/// Checks that the variable has a start value if, and only if, it needs one. A clock of FMI 3.0 needs none.
pub(super) fn check_start(variable: &ScalarVariable, is_clock: bool, problems: &mut Problems) {
    let name = &variable.name;
    let section = problems.sections.limits;
    let needed = match (variable.causality, variable.initial_in_force()) {
        _ if is_clock => false,
        (Causality::Independent, _) => false,
        (Causality::Input, _) => true,
        (_, initial) => initial != Some(Initial::Calculated),
    };
    match (needed, variable.has_start()) {
        (true, false) => problems.add(section, format!("variable {name} needs a start value")),
        (false, true) => problems.add(
            section,
            format!("variable {name} has a start value, which calculated and independent forbid"),
        ),
        _ => {}
    }
}

/// Checks limits and start of a Real variable or type, called `who`.
pub(super) fn check_real(who: &str, real: &RealType, problems: &mut Problems) {
    let section = problems.sections.limits;
    for (name, value) in
        [("start", real.start), ("min", real.min), ("max", real.max), ("nominal", real.nominal)]
    {
        problems.finite(section, &format!("{name} of {who}"), value);
    }
    if let Some(nominal) = real.nominal {
        problems.demand(nominal > 0.0, section, || {
            format!("{who}: nominal is {nominal:?}, not positive")
        });
    }
    check_order(who, real.min, real.start, real.max, problems);
}

/// Checks limits and start of an Integer or Enumeration variable or type, called `who`.
pub(super) fn check_integer(who: &str, integer: &IntegerType, problems: &mut Problems) {
    check_order(who, integer.min, integer.start, integer.max, problems);
}

/// Checks that `min <= start <= max` for those that are stated.
pub(super) fn check_order<T: Copy + PartialOrd + std::fmt::Debug>(
    who: &str,
    min: Option<T>,
    start: Option<T>,
    max: Option<T>,
    problems: &mut Problems,
) {
    let section = problems.sections.limits;
    for ((low, lower), (high, upper)) in [
        (("min", &min), ("max", &max)),
        (("min", &min), ("start", &start)),
        (("start", &start), ("max", &max)),
    ] {
        if let (Some(lower), Some(upper)) = (lower, upper) {
            problems.demand(lower <= upper, section, || {
                format!("{who}: {low} {lower:?} is above {high} {upper:?}")
            });
        }
    }
}

/// Checks that a declared type exists and has the variable's kind, and that min and max of a number are within those of
/// the type. An Enumeration must have a declared type, and an item of it as its start value.
fn check_declared_type(
    variable: &ScalarVariable,
    types: &HashMap<&str, &SimpleType>,
    problems: &mut Problems,
) {
    let name = &variable.name;
    let declared = match &variable.kind {
        Kind::Real(real) => real.declared_type.as_deref(),
        Kind::Integer(integer) | Kind::Enumeration(integer) => integer.declared_type.as_deref(),
        _ => None,
    };
    let Some(declared) = declared else {
        let needed = matches!(variable.kind, Kind::Enumeration(_));
        return problems.demand(!needed, SECTION, || {
            format!("variable {name} is an Enumeration and has no declared type")
        });
    };
    let Some(declared_type) = types.get(declared) else {
        return problems.add(SECTION, format!("variable {name}: there is no type {declared:?}"));
    };
    let inside = match (&variable.kind, &declared_type.kind) {
        (Kind::Real(inner), Kind::Real(outer)) => {
            within((inner.min, inner.max), (outer.min, outer.max))
        }
        (Kind::Integer(inner), Kind::Integer(outer)) => {
            within((inner.min, inner.max), (outer.min, outer.max))
        }
        (Kind::Enumeration(inner), Kind::Enumeration(_)) => {
            let is_item =
                |start| declared_type.items.iter().any(|(_, value)| i128::from(*value) == start);
            problems.demand(inner.start.is_none_or(is_item), SECTION, || {
                format!("variable {name}: the start value is no item of type {declared}")
            });
            true
        }
        _ => {
            let (kind, other) = (variable.kind.element(), declared_type.kind.element());
            return problems.add(
                SECTION,
                format!("variable {name} is {kind}, its declared type {declared} is {other}"),
            );
        }
    };
    problems.demand(inside, SECTION, || {
        format!("variable {name}: min and max are not inside those of its type {declared}")
    });
}

/// Whether the limits `inner` (min, max) are within `outer`; a limit that is not stated in both is not compared.
fn within<T: Copy + PartialOrd>(
    inner: (Option<T>, Option<T>),
    outer: (Option<T>, Option<T>),
) -> bool {
    let below = inner.0.zip(outer.0).is_some_and(|(inner, outer)| inner < outer);
    let above = inner.1.zip(outer.1).is_some_and(|(inner, outer)| inner > outer);
    !below && !above
}

/// Checks that `derivative` connects two different continuous Reals.
fn check_derivative(
    variable: &ScalarVariable,
    description: &ModelDescription,
    problems: &mut Problems,
) {
    let Kind::Real(RealType { derivative: Some(index), .. }) = variable.kind else {
        return;
    };
    let name = &variable.name;
    let is_continuous = |variable: &ScalarVariable| {
        matches!(variable.kind, Kind::Real(_)) && variable.variability == Variability::Continuous
    };
    let Some(state) = description.at(index) else {
        let text = format!("variable {name}: derivative {index} is the index of no variable");
        return problems.add(SECTION, text);
    };
    let sound = !std::ptr::eq(state, variable) && is_continuous(state) && is_continuous(variable);
    problems.demand(sound, SECTION, || {
        format!(
            "variable {name}: derivative {index} must connect two different continuous Reals, \
             it points at {}",
            state.name
        )
    });
}

/// Checks the sets of variables with one base type and one value reference.
fn check_aliases(description: &ModelDescription, problems: &mut Problems) {
    let mut sets: BTreeMap<(u8, u32), Vec<&ScalarVariable>> = BTreeMap::new();
    for variable in &description.variables {
        let base = match variable.kind {
            Kind::Real(_) => 0,
            Kind::Integer(_) | Kind::Enumeration(_) => 1,
            Kind::Boolean(_) => 2,
            _ => 3,
        };
        sets.entry((base, variable.value_reference)).or_default().push(variable);
    }
    for set in sets.values().filter(|set| set.len() > 1) {
        check_alias_set(set, problems);
    }
}

/// Checks that aliases have one unit, and that either all are constants of one value, or none is a constant, at most
/// one can be set and at most one has a start value.
fn check_alias_set(set: &[&ScalarVariable], problems: &mut Problems) {
    let names = set.iter().map(|variable| variable.name.as_str()).collect::<Vec<_>>().join(", ");
    let is_constant = |variable: &&&ScalarVariable| variable.variability == Variability::Constant;
    let constants = set.iter().filter(is_constant).count();
    problems.demand(constants == 0 || constants == set.len(), SECTION, || {
        format!("aliases {names}: constants can only be aliases of constants")
    });
    let is_settable = |variable: &&&ScalarVariable| {
        matches!(
            variable.causality,
            Causality::Parameter | Causality::Input | Causality::Independent
        )
    };
    problems.demand(set.iter().filter(is_settable).count() <= 1, SECTION, || {
        format!("aliases {names}: more than one can be set from outside")
    });
    let starts = set.iter().filter(|variable| variable.has_start()).count();
    problems.demand(constants > 0 || starts <= 1, SECTION, || {
        format!("aliases {names}: more than one has a start value")
    });
    let unit = |variable: &ScalarVariable| match &variable.kind {
        Kind::Real(real) => real.unit.clone(),
        _ => None,
    };
    let same_unit = set.windows(2).all(|pair| unit(pair[0]) == unit(pair[1]));
    problems.demand(same_unit, SECTION, || format!("aliases {names}: their units differ"));
    if constants == set.len() {
        let same = set.windows(2).all(|pair| same_start(&pair[0].kind, &pair[1].kind));
        problems.demand(same, SECTION, || {
            format!("aliases {names}: the values of these constants differ")
        });
    }
}

fn same_start(left: &Kind, right: &Kind) -> bool {
    match (left, right) {
        (Kind::Real(left), Kind::Real(right)) => left.start == right.start,
        (
            Kind::Integer(left) | Kind::Enumeration(left),
            Kind::Integer(right) | Kind::Enumeration(right),
        ) => left.start == right.start,
        (left, right) => left == right,
    }
}
