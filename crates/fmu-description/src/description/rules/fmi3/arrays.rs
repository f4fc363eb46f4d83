//! Rules on arrays and structural parameters (section 2.4.7.2).

use std::collections::HashMap;

use crate::description::rules::Problems;
use crate::description::{Causality, Dimension, Kind, ScalarVariable, Variability};

const SECTION: &str = "2.4.7.2";

pub(super) fn check(problems: &mut Problems<'_>) {
    let variables =
        problems.description.variables.iter().filter(|variable| variable.alias_of.is_none());
    let references: HashMap<u32, &ScalarVariable> =
        variables.clone().map(|variable| (variable.value_reference, variable)).collect();
    for variable in variables {
        let name = &variable.name;
        let scalar = match variable.kind {
            Kind::Clock(_) => Some("a Clock"),
            _ if variable.causality == Causality::StructuralParameter => {
                Some("a structural parameter")
            }
            _ => None,
        };
        if let Some(what) = scalar.filter(|_| !variable.dimensions.is_empty()) {
            problems.add(SECTION, format!("variable {name}: {what} cannot be an array"));
        }
        let mut size = Some(1_u64);
        for dimension in &variable.dimensions {
            let extent = extent(name, dimension, &references, problems);
            size = size.zip(extent).and_then(|(size, extent)| size.checked_mul(extent));
        }
        let Some(starts) = &variable.start_elements else { continue };
        let count = u64::try_from(starts.len()).unwrap_or(u64::MAX);
        problems.demand(size.is_none_or(|size| size == count), SECTION, || {
            let size = size.unwrap_or_default();
            format!("variable {name} has {count} start values for {size} elements")
        });
    }
}

/// Returns the extent of a dimension of the variable `name`. Adds a problem for an extent of 0, or without an extent.
fn extent(
    name: &str,
    dimension: &Dimension,
    references: &HashMap<u32, &ScalarVariable>,
    problems: &mut Problems<'_>,
) -> Option<u64> {
    let extent = match *dimension {
        Dimension::Fixed(extent) => extent,
        Dimension::Variable(reference) => {
            let size = references.get(&reference).filter(|variable| {
                matches!(variable.kind, Kind::UInt64(_))
                    && (variable.causality == Causality::StructuralParameter
                        || variable.variability == Variability::Constant)
            });
            let start = size.and_then(|variable| variable.kind.as_integer()?.start);
            let Some(start) = start.and_then(|start| u64::try_from(start).ok()) else {
                let text = format!(
                    "variable {name}: a dimension refers to {reference}, which is no constant or \
                     structural parameter of type UInt64 with a start value"
                );
                problems.add(SECTION, text);
                return None;
            };
            start
        }
    };
    problems
        .demand(extent > 0, SECTION, || format!("variable {name}: a dimension starts with size 0"));
    Some(extent)
}
