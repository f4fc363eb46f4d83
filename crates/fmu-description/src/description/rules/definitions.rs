//! Rules on `UnitDefinitions` and `TypeDefinitions` (FMI 2.0.5, sections 2.2.2 and 2.2.3; FMI 3.0.2,
//! sections 2.4.3 and 2.4.4).

use std::collections::{HashMap, HashSet};

use super::{Problems, Sections};
use crate::description::{Kind, RealType, SimpleType};
use crate::unit::Unit;

pub(super) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    let Sections { units: in_units, types: in_types, .. } = problems.sections;
    problems.unique(in_units, "unit", description.units.iter().map(|unit| unit.name.as_str()));
    for unit in &description.units {
        check_unit(unit, problems);
    }
    let units = description.units.iter().map(|unit| (unit.name.as_str(), unit)).collect();
    for variable in &description.variables {
        if let Some(real) = variable.kind.as_real() {
            check_use(&format!("variable {}", variable.name), real, &units, problems);
        }
    }
    let names = description.types.iter().map(|declared| declared.name.as_str());
    problems.unique(in_types, "type", names);
    let variables: HashSet<_> =
        description.variables.iter().map(|variable| variable.name.as_str()).collect();
    for declared in &description.types {
        problems.demand(!variables.contains(declared.name.as_str()), in_types, || {
            format!("type {} has the name of a variable", declared.name)
        });
        if let Some(real) = declared.kind.as_real() {
            check_use(&format!("type {}", declared.name), real, &units, problems);
        }
        check_type(declared, problems);
    }
}

fn check_unit(unit: &Unit, problems: &mut Problems<'_>) {
    let Sections { units: in_units, .. } = problems.sections;
    let name = &unit.name;
    problems.line(in_units, "unit", name);
    let displays = unit.display_units.iter().map(|display| display.name.as_str());
    problems.unique(in_units, &format!("in unit {name:?}, display unit"), displays);
    let base = unit.base.iter().map(|base| ("its base unit", base.factor, base.offset));
    let displays = unit
        .display_units
        .iter()
        .map(|display| (display.name.as_str(), display.factor, display.offset));
    for (other, factor, offset) in base.chain(displays) {
        let sound = factor.is_finite() && factor != 0.0 && offset.is_finite();
        problems.demand(sound, in_units, || {
            format!(
                "unit {name:?} to {other}: factor {factor:?} must be finite and not zero, \
                 offset {offset:?} finite"
            )
        });
    }
}

/// Checks that the unit of a variable or type, called `who`, is defined and lists its display unit.
fn check_use(
    who: &str,
    real: &RealType,
    units: &HashMap<&str, &Unit>,
    problems: &mut Problems<'_>,
) {
    let Sections { units: in_units, types: in_types, .. } = problems.sections;
    let unit = real.unit.as_deref();
    let defined = unit.and_then(|name| units.get(name));
    if let Some(unit) = unit {
        problems.demand(defined.is_some(), in_units, || {
            format!("{who} has unit {unit:?}, which is not defined")
        });
    }
    let Some(display) = &real.display_unit else { return };
    let description = problems.description;
    let lists = |unit: &Unit| unit.display_units.iter().any(|known| known.name == *display);
    // Problems with the display unit of a declared type are stated once, for the type.
    let inherited = |declared: &SimpleType| {
        real.declared_type.as_ref() == Some(&declared.name)
            && declared.kind.as_real().is_some_and(|other| {
                (&other.unit, &other.display_unit) == (&real.unit, &real.display_unit)
            })
    };
    if unit.is_some() && defined.copied().is_none_or(lists)
        || description.types.iter().any(inherited)
    {
        return;
    }
    let problem = match unit {
        None => "and no unit",
        Some(_) if description.units.iter().any(lists) => "which its unit does not list",
        Some(_) => "which no unit lists",
    };
    problems.add(in_types, format!("{who} has display unit {display:?}, {problem}"));
}

fn check_type(declared: &SimpleType, problems: &mut Problems<'_>) {
    let Sections { types: in_types, .. } = problems.sections;
    let name = &declared.name;
    problems.demand(!name.is_empty(), in_types, || "a type has no name".to_owned());
    problems.line(in_types, "type", name);
    problems.text(
        in_types,
        "description of a type",
        declared.description.as_deref().unwrap_or_default(),
    );
    match &declared.kind {
        Kind::Enumeration(_) => {
            problems.demand(!declared.items.is_empty(), in_types, || {
                format!("enumeration type {name} has no item")
            });
            let items = declared.items.iter().map(|(item, _)| item.as_str());
            problems.unique(in_types, &format!("in type {name}, item"), items);
            let mut values = HashSet::new();
            for (item, value) in &declared.items {
                problems.demand(values.insert(value), in_types, || {
                    format!("in type {name}, item {item} has the value {value} of another item")
                });
            }
        }
        other => {
            let who = format!("type {name}");
            if let Some(real) = other.as_real() {
                super::variables::check_real(&who, real, problems);
            } else if let Some(integer) = other.as_integer() {
                super::variables::check_integer(&who, integer, problems);
            }
        }
    }
}
