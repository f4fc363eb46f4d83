//! Arrays: scalars of FMI 2.0 that are one array in FMI 3.0.

use fmu_description::{Causality, Elements, Kind, RealType, ScalarVariable};

/// The scalars of one array, or a single scalar.
pub(super) struct Block {
    pub(super) name: String,
    /// Position of the first scalar, and number of scalars.
    pub(super) start: usize,
    pub(super) count: usize,
    /// Extents of the array; empty for a scalar.
    pub(super) extents: Vec<u64>,
}

/// Splits variables into arrays and scalars.
///
/// Scalars are an array if they follow one another, are named `name[1,1]`, `name[1,2]` and so on (or
/// `der(name[1,1])`), with every index in row-major order, and have the same attributes except the start value. Strings,
/// binaries, clocks and structural parameters stay scalars, and so do states and derivatives that are not arrays of the
/// same extents. A variable that is an alias, or has one, stays a scalar as well, because FMI 3.0 has no alias of an
/// element: `is_single` returns true for it.
pub(super) fn blocks(
    variables: &[ScalarVariable],
    is_single: impl Fn(&ScalarVariable) -> bool,
) -> Vec<Block> {
    let mut singles: Vec<String> = Vec::new();
    loop {
        let blocks = split_up(variables, &|variable| {
            is_single(variable) || singles.contains(&variable.name)
        });
        let unmatched = unmatched(variables, &blocks);
        if unmatched.is_empty() {
            return blocks;
        }
        singles.extend(unmatched);
    }
}

/// Returns the names of the first scalars of arrays of states without an array of derivatives of the same extents, and
/// of arrays of derivatives without such an array of states.
fn unmatched(variables: &[ScalarVariable], blocks: &[Block]) -> Vec<String> {
    let state =
        |position: usize| variables[position].kind.as_real().and_then(|real| real.derivative);
    let pairs = blocks.iter().filter_map(|block| {
        let state = state(block.start)? as usize - 1;
        let of = blocks.iter().find(|of| (of.start..of.start + of.count).contains(&state))?;
        Some((block, of, state))
    });
    let mut names = Vec::new();
    for (block, of, state) in pairs {
        if of.start != state || of.extents != block.extents {
            for block in [block, of].into_iter().filter(|block| !block.extents.is_empty()) {
                names.push(variables[block.start].name.clone());
            }
        }
    }
    names
}

/// Splits variables into arrays and scalars, without regard to states and derivatives.
fn split_up(
    variables: &[ScalarVariable],
    is_single: &impl Fn(&ScalarVariable) -> bool,
) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut start = 0;
    while start < variables.len() {
        let block = array(variables, start, is_single).unwrap_or_else(|| Block {
            name: variables[start].name.clone(),
            start,
            count: 1,
            extents: Vec::new(),
        });
        start += block.count;
        blocks.push(block);
    }
    blocks
}

/// Returns the array that starts at position `start`; `None` unless all elements of its name follow there in order.
fn array(
    variables: &[ScalarVariable],
    start: usize,
    is_single: &impl Fn(&ScalarVariable) -> bool,
) -> Option<Block> {
    let rest = &variables[start..];
    let (name, first) = split(&rest[0].name).filter(|_| !is_single(&rest[0]))?;
    let like_first = |(position, other): (usize, &ScalarVariable)| {
        let (of, indices) = split(&other.name)?;
        let fits = of == name && indices.len() == first.len() && !is_single(other);
        (fits && is_element(&rest[0], other, position)).then_some(indices)
    };
    let indices: Vec<_> = rest.iter().enumerate().map_while(like_first).collect();
    let extents = indices.last()?.clone();
    let all =
        variables.iter().filter(|variable| split(&variable.name).is_some_and(|(of, _)| of == name));
    let complete = all.count() == indices.len()
        && indices.iter().enumerate().all(|(position, element)| {
            let mut left = position as u64;
            extents.iter().zip(element).rev().all(|(extent, index)| {
                let fits = left % extent == index - 1;
                left /= extent;
                fits
            })
        });
    let count = extents.iter().try_fold(1_u64, |product, &extent| product.checked_mul(extent))?;
    let count = usize::try_from(count).ok()?;
    (complete && count == indices.len()).then_some(Block { name, start, count, extents })
}

/// Splits `name[1,2]` into `name` and its indices, `der(name[1,2])` into `der(name)` and its indices; `None` for a name
/// without indices of 1 or more.
fn split(name: &str) -> Option<(String, Vec<u64>)> {
    let (inner, closing) = match name.strip_suffix("])") {
        Some(inner) if name.starts_with("der(") => (inner, ")"),
        _ => (name.strip_suffix(']')?, ""),
    };
    let (base, indices) = inner.rsplit_once('[')?;
    let indices: Option<Vec<u64>> =
        indices.split(',').map(|index| index.parse().ok().filter(|index| *index > 0)).collect();
    Some((format!("{base}{closing}"), indices?))
}

/// Returns the type without start value and `reinit`.
pub(super) fn without_start(kind: &Kind) -> Kind {
    let mut kind = kind.clone();
    kind.clear_start();
    kind
}

/// Whether `other` can be the element at `position` of the array whose first element is `first`.
fn is_element(first: &ScalarVariable, other: &ScalarVariable, position: usize) -> bool {
    let Ok(offset) = u32::try_from(position) else { return false };
    let kind = match (&first.kind, &other.kind) {
        (Kind::Real(one), Kind::Real(two)) => {
            let shifted = one.derivative.map(|derivative| derivative + offset);
            let alike = RealType { start: two.start, derivative: two.derivative, ..one.clone() };
            alike == *two && shifted == two.derivative && one.start.is_some() == two.start.is_some()
        }
        (Kind::String(_) | Kind::Binary(_) | Kind::Clock(_), _) => false,
        (one, two) => {
            without_start(one) == without_start(two) && one.has_start() == two.has_start()
        }
    };
    let alike = ScalarVariable {
        name: other.name.clone(),
        value_reference: first.value_reference + offset,
        kind: other.kind.clone(),
        ..first.clone()
    };
    kind && first.causality != Causality::StructuralParameter && alike == *other
}

/// Returns the start values of the elements; `None` for elements without start values, texts and binaries.
pub(super) fn starts(elements: &[ScalarVariable]) -> Option<Elements> {
    let real = |variable: &ScalarVariable| variable.kind.as_real().and_then(|real| real.start);
    let integer =
        |variable: &ScalarVariable| variable.kind.as_integer().and_then(|integer| integer.start);
    let boolean = |variable: &ScalarVariable| match variable.kind {
        Kind::Boolean(start) => start,
        _ => None,
    };
    match &elements.first()?.kind {
        Kind::Boolean(_) => {
            elements.iter().map(boolean).collect::<Option<_>>().map(Elements::Boolean)
        }
        kind if kind.as_real().is_some() => {
            elements.iter().map(real).collect::<Option<_>>().map(Elements::Real)
        }
        kind if kind.as_integer().is_some() => {
            elements.iter().map(integer).collect::<Option<_>>().map(Elements::Integer)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use fmu_description::{ClockType, IntegerType};

    use super::*;

    fn variables(names: &[&str]) -> Vec<ScalarVariable> {
        (1..)
            .zip(names)
            .map(|(value_reference, name)| ScalarVariable {
                name: (*name).to_owned(),
                value_reference,
                ..ScalarVariable::default()
            })
            .collect()
    }

    fn blocks_of(names: &[&str]) -> Vec<(String, usize, Vec<u64>)> {
        let blocks = blocks(&variables(names), |_| false);
        blocks.into_iter().map(|block| (block.name, block.count, block.extents)).collect()
    }

    #[test]
    fn scalars_with_every_index_in_row_major_order_are_an_array() {
        let names = ["x", "A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]", "b[1]", "b[2]", "der(b[1])"];
        let expected =
            [("x", 1, vec![]), ("A", 4, vec![2, 2]), ("b", 2, vec![2]), ("der(b)", 1, vec![1])];
        assert_eq!(blocks_of(&names), expected.map(|(name, n, e)| (name.to_owned(), n, e)));
    }

    #[test]
    fn incomplete_or_disordered_indices_are_scalars() {
        for names in [
            &["A[1,1]", "A[2,2]"][..],
            &["A[1,2]", "A[1,1]"],
            &["A[2]", "A[3]"],
            &["A[1,1]", "A[1,2]", "A[2,1]"],
            &["A[0]"],
            &["A[x]"],
        ] {
            assert!(blocks_of(names).iter().all(|block| block.2.is_empty()), "{names:?}");
        }
    }

    #[test]
    fn each_element_of_an_array_of_enumerations_has_its_start_value() {
        let mut modes = variables(&["mode[1]", "mode[2]"]);
        for (mode, start) in modes.iter_mut().zip([2, 1]) {
            mode.kind = Kind::Enumeration(IntegerType {
                declared_type: Some("Mode".to_owned()),
                start: Some(start),
                ..IntegerType::default()
            });
        }
        assert_eq!(blocks(&modes, |_| false).len(), 1);
        assert_eq!(starts(&modes), Some(Elements::Integer(vec![2, 1])));
    }

    /// FMI 3.0.2, section 2.4.7.2 allows no arrays of them.
    #[test]
    fn clocks_and_structural_parameters_are_scalars() {
        let (mut clocks, mut sizes) = (variables(&["tick[1]", "tick[2]"]), variables(&["n[1]"]));
        for clock in &mut clocks {
            clock.kind = Kind::Clock(ClockType::default());
        }
        sizes[0].causality = Causality::StructuralParameter;
        for all in [clocks, sizes] {
            assert!(blocks(&all, |_| false).iter().all(|block| block.extents.is_empty()));
        }
    }

    #[test]
    fn elements_with_other_attributes_are_scalars() {
        let mut all = variables(&["x[1]", "x[2]"]);
        all[1].kind = Kind::Real(RealType { unit: Some("m".to_owned()), ..RealType::default() });
        assert!(blocks(&all, |_| false).iter().all(|block| block.extents.is_empty()));
    }
}
