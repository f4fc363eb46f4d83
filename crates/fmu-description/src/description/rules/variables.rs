//! Rules on `ModelVariables` of FMI 2.0 (section 2.2.7), and on limits in both versions.

use std::collections::{BTreeMap, HashMap};

use super::structure::is_real;
use super::{Problems, Sections};
use crate::description::{
    Causality, Elements, Initial, IntegerType, Kind, RealType, ScalarVariable, SimpleType,
    Variability, Version,
};

const SECTION: &str = "2.2.7";

pub(super) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    problems.demand(!description.variables.is_empty(), SECTION, || {
        "ModelVariables has no variable".to_owned()
    });
    let types =
        description.types.iter().map(|declared| (declared.name.as_str(), declared)).collect();
    for variable in &description.variables {
        check_table(variable, problems);
        check_start(variable, false, problems);
        if let Some(declared) = check_declared_type(variable, &types, problems) {
            check_limits(variable, declared, problems);
        }
        check_derivative(variable, problems);
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
    check_aliases(problems);
}

/// Checks the tables of causality, variability and initial.
pub(super) fn check_table(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    use Causality::{
        CalculatedParameter, Independent, Input, Local, Output, Parameter, StructuralParameter,
    };
    use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
    let Sections { variables: section, limits, .. } = problems.sections;
    let version = problems.version;
    let third = version == Version::V3;
    let name = &variable.name;
    let (causality, variability) = (variable.causality.as_str(), variable.variability.as_str());
    let allowed: &[Initial] = match (variable.causality, variable.variability) {
        (StructuralParameter, Fixed | Tunable) | (Input, Discrete | Continuous) if third => {
            &[Initial::Exact]
        }
        (Parameter, Fixed | Tunable) | (Output | Local, Constant) => &[Initial::Exact],
        (CalculatedParameter | Local, Fixed | Tunable) => &[Initial::Calculated, Initial::Approx],
        (Output | Local, Discrete | Continuous) => {
            &[Initial::Calculated, Initial::Exact, Initial::Approx]
        }
        (Input, Discrete | Continuous) | (Independent, Continuous) => &[],
        _ => {
            let text = format!("variable {name}: a {causality} cannot be {variability}");
            return problems.add(section, text);
        }
    };
    let allowed = if matches!(variable.kind, Kind::Clock(_)) { &[] } else { allowed };
    if let Some(initial) = variable.initial {
        problems.demand(allowed.contains(&initial), limits, || {
            let (initial, kind) = (initial.as_str(), variable.kind.element_in(version));
            let of_type = if third { format!(" of type {kind}") } else { String::new() };
            format!(
                "variable {name}: initial {initial} is not allowed for {variability} \
                 {causality}{of_type}"
            )
        });
    }
    let real = is_real(variable, version);
    problems.demand(real || variable.variability != Continuous, section, || {
        let rule = if third {
            "only a Float32 or Float64 can be continuous"
        } else {
            "only a Real can be continuous, which is the default"
        };
        format!("variable {name}: {rule}")
    });
}

/// Checks that the variable has a start value if, and only if, it needs one. A clock of FMI 3.0 needs none.
pub(super) fn check_start(variable: &ScalarVariable, is_clock: bool, problems: &mut Problems<'_>) {
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
pub(super) fn check_real(who: &str, real: &RealType, problems: &mut Problems<'_>) {
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
pub(super) fn check_integer(who: &str, integer: &IntegerType, problems: &mut Problems<'_>) {
    check_order(who, integer.min, integer.start, integer.max, problems);
}

/// Checks that `min <= start <= max`, as far as they are stated.
pub(super) fn check_order<T: Copy + PartialOrd + std::fmt::Debug>(
    who: &str,
    min: Option<T>,
    start: Option<T>,
    max: Option<T>,
    problems: &mut Problems<'_>,
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

/// Checks that a declared type exists and has the variable's kind, and that an Enumeration has a declared type and one
/// of its items as start value. Returns the type if it has the kind.
pub(super) fn check_declared_type<'a>(
    variable: &ScalarVariable,
    types: &HashMap<&str, &'a SimpleType>,
    problems: &mut Problems<'_>,
) -> Option<&'a SimpleType> {
    let (section, version) = (problems.sections.limits, problems.version);
    let name = &variable.name;
    let Some(declared) = variable.kind.declared_type() else {
        let needed = matches!(variable.kind, Kind::Enumeration(_));
        problems.demand(!needed, section, || {
            format!("variable {name} is an Enumeration and has no declared type")
        });
        return None;
    };
    let Some(declared_type) = types.get(declared) else {
        problems.add(section, format!("variable {name}: there is no type {declared:?}"));
        return None;
    };
    let [kind, other] = [&variable.kind, &declared_type.kind].map(|kind| kind.element_in(version));
    if kind != other {
        let text = format!("variable {name} is {kind}, its declared type {declared} is {other}");
        problems.add(section, text);
        return None;
    }
    if let Kind::Enumeration(integer) = &variable.kind {
        let is_item =
            |start| declared_type.items.iter().any(|(_, value)| i128::from(*value) == start);
        problems.demand(integer.start.is_none_or(is_item), section, || {
            format!("variable {name}: the start value is no item of type {declared}")
        });
    }
    Some(declared_type)
}

/// Checks that min and max of a Real or Integer are within the limits of its declared type.
fn check_limits(variable: &ScalarVariable, declared: &SimpleType, problems: &mut Problems<'_>) {
    let inside = match (&variable.kind, &declared.kind) {
        (Kind::Real(inner), Kind::Real(outer)) => {
            within((inner.min, inner.max), (outer.min, outer.max))
        }
        (Kind::Integer(inner), Kind::Integer(outer)) => {
            within((inner.min, inner.max), (outer.min, outer.max))
        }
        _ => true,
    };
    problems.demand(inside, SECTION, || {
        let (name, declared) = (&variable.name, &declared.name);
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
fn check_derivative(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    let Kind::Real(RealType { derivative: Some(index), .. }) = variable.kind else {
        return;
    };
    let name = &variable.name;
    let is_continuous = |variable: &ScalarVariable| {
        matches!(variable.kind, Kind::Real(_)) && variable.variability == Variability::Continuous
    };
    let Some(state) = problems.description.at(index) else {
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
fn check_aliases(problems: &mut Problems<'_>) {
    let mut sets: BTreeMap<(u8, u32), Vec<&ScalarVariable>> = BTreeMap::new();
    for variable in &problems.description.variables {
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
fn check_alias_set(set: &[&ScalarVariable], problems: &mut Problems<'_>) {
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
    let unit = |at: usize| set[at].kind.as_real().and_then(|real| real.unit.as_ref());
    let same_unit = (1..set.len()).all(|at| unit(at) == unit(0));
    problems.demand(same_unit, SECTION, || format!("aliases {names}: their units differ"));
    if constants == set.len() {
        let start = |at: usize| Elements::repeated(&set[at].kind, 1);
        let same = (1..set.len()).all(|at| start(at) == start(0));
        problems.demand(same, SECTION, || {
            format!("aliases {names}: the values of these constants differ")
        });
    }
}
