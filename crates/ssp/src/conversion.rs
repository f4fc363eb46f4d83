//! Unit conversions and transformations along connections (SSP 1.0.1, section 4.5.2).

use fmu_description::unit::BaseUnit;
use fmu_description::{Kind, ModelDescription, ScalarVariable, SimpleType};

use super::structure::{Conversion, Definitions, Transformation as Stated, Type};
use slave::Transformation;

/// Two units of the same name count as equal if the factor of their conversion differs from 1, and its offset from 0,
/// by less than this, since files state units with different numbers of digits.
const SAME_FACTOR: f64 = 1e-6;

/// The unit or enumeration of the values at a connector.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Measure {
    /// Name and definition of the unit.
    pub(super) unit: Option<(String, Option<BaseUnit>)>,
    /// Whether the values are differences (`relativeQuantity`), which have no offset; `None` if no FMU states this.
    pub(super) relative: Option<bool>,
    /// Items of the enumeration.
    pub(super) items: Option<Vec<(String, i32)>>,
}

impl Measure {
    /// Creates the measure of a stated type, empty for a type without unit and enumeration. The first of `scopes` that
    /// has the name of the unit or enumeration defines the unit or enumeration.
    pub(super) fn stated(kind: Option<&Type>, scopes: &[&Definitions]) -> Self {
        match kind {
            Some(Type::Real(Some(unit))) => Measure::unit(unit, scopes),
            Some(Type::Enumeration(name)) => Measure::enumeration(name, scopes),
            _ => Measure::default(),
        }
    }

    /// Creates the measure of the unit `name`, defined in the first of `scopes` that has it.
    pub(super) fn unit(name: &str, scopes: &[&Definitions]) -> Self {
        let mut all = scopes.iter().flat_map(|scope| &scope.units);
        let base = all.find(|unit| unit.name == name).map(|unit| unit.base);
        Measure { unit: Some((name.to_owned(), base)), ..Measure::default() }
    }

    /// Creates the measure of the enumeration `name`, defined in the first of `scopes` that has it.
    pub(super) fn enumeration(name: &str, scopes: &[&Definitions]) -> Self {
        let mut all = scopes.iter().flat_map(|scope| &scope.enumerations);
        let items = all.find(|known| known.name == name).map(|known| known.items.clone());
        Measure { items, ..Measure::default() }
    }

    /// Creates the measure of a variable from the description of its FMU.
    pub(super) fn of_variable(variable: &ScalarVariable, description: &ModelDescription) -> Self {
        match &variable.kind {
            Kind::Real(real) | Kind::Float32(real) => {
                let unit = real.unit.as_ref().map(|name| {
                    let known = description.units.iter().find(|unit| unit.name == *name);
                    (name.clone(), known.and_then(|unit| unit.base))
                });
                Measure { unit, relative: Some(real.is_relative()), items: None }
            }
            Kind::Enumeration(kind) => {
                let declared = kind.declared_type.as_ref();
                let known = description
                    .types
                    .iter()
                    .find(|declared_type| Some(&declared_type.name) == declared);
                Measure { items: known.map(items_of), ..Measure::default() }
            }
            _ => Measure::default(),
        }
    }

    /// Replaces missing fields by the fields of `other`.
    pub(super) fn or(self, other: Measure) -> Self {
        Measure {
            unit: self.unit.or(other.unit),
            relative: self.relative.or(other.relative),
            items: self.items.or(other.items),
        }
    }

    fn name(&self) -> &str {
        self.unit.as_ref().map_or("no unit", |(name, _)| name)
    }
}

/// Returns factor and offset that convert values from the unit of `from` to the unit of `to`; both
/// units satisfy `base = factor * unit + offset`, without the offset for differences.
///
/// The result is (1, 0) if one side has no unit. For units of the same name the result is also (1, 0), unless both are
/// defined, measure the same quantity and differ in factor or offset. For units of different names the result is `None`
/// if a definition is missing, and an error sentence if the units measure different quantities, or differ by an offset
/// while only one side is a difference.
pub(super) fn between(from: &Measure, to: &Measure) -> Result<Option<(f64, f64)>, String> {
    const SAME: (f64, f64) = (1.0, 0.0);
    let (Some((from_name, from_base)), Some((to_name, to_base))) = (&from.unit, &to.unit) else {
        return Ok(Some(SAME));
    };
    let same_name = from_name == to_name;
    let (Some(source), Some(target)) = (from_base, to_base) else {
        return Ok(same_name.then_some(SAME));
    };
    let Some((factor, offset)) = source.conversion(target) else {
        return if same_name {
            Ok(Some(SAME))
        } else {
            Err(format!("{from_name} and {to_name} are units of different quantities"))
        };
    };
    let nearly_one = (factor - 1.0).abs() < SAME_FACTOR && offset.abs() < SAME_FACTOR;
    match (from.relative, to.relative) {
        _ if same_name && nearly_one => Ok(Some(SAME)),
        (Some(one), Some(other)) if one != other && offset != 0.0 => {
            let (one, other) = if one { (from_name, to_name) } else { (to_name, from_name) };
            Err(format!(
                "the value in {one} is a difference (relativeQuantity) and the one in {other} is \
                 not: state suppressUnitConversion and a LinearTransformation"
            ))
        }
        (one, other) if one.or(other) == Some(true) => Ok(Some((factor, 0.0))),
        _ => Ok(Some((factor, offset))),
    }
}

/// The composed conversion along a path of connections, and the unit or enumeration at its end.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ConversionChain {
    pub(super) measure: Measure,
    pub(super) transformation: Transformation,
    /// One sentence for each conversion that was skipped.
    pub(super) warnings: Vec<String>,
}

impl ConversionChain {
    /// Starts a path at a connector with `measure`.
    pub(super) fn from(measure: Measure) -> Self {
        ConversionChain { measure, ..ConversionChain::default() }
    }

    /// Appends a connection that ends at a connector with the measure `there`: the unit conversion, unless suppressed,
    /// then the transformation. Returns an error sentence if the units cannot be converted, if an enumeration lacks an
    /// item, or if transformations of different types follow each other.
    pub(super) fn append(
        self,
        conversion: &Conversion,
        there: Measure,
    ) -> Result<ConversionChain, String> {
        let (mut transformation, mut warnings) = (self.transformation, self.warnings);
        if !conversion.suppress_units {
            match between(&self.measure, &there)? {
                Some((factor, offset)) => {
                    transformation = then(transformation, linear(factor, offset))?;
                }
                None => warnings.push(format!(
                    "{} is not converted to {}: a definition is missing",
                    self.measure.name(),
                    there.name()
                )),
            }
        }
        let stated = conversion.transformation.as_ref();
        if let Some(stated) = stated {
            let stated = resolve(stated, &self.measure, &there)?;
            transformation = then(transformation, stated)?;
        }
        let Measure { unit, relative, items } = self.measure;
        // If the conversion is suppressed, the unit of the values, and whether they are differences, is unknown.
        let (unit, relative) =
            if conversion.suppress_units { (None, None) } else { (unit, relative) };
        // An offset turns a difference from an operating point into an absolute value.
        let is_moved = matches!(stated, Some(Stated::Linear { offset, .. }) if *offset != 0.0);
        let relative = relative.filter(|_| !is_moved);
        let items = if stated.is_some() { None } else { items };
        let measure = there.or(Measure { unit, relative, items });
        Ok(ConversionChain { measure, transformation, warnings })
    }
}

fn linear(factor: f64, offset: f64) -> Transformation {
    if (factor, offset) == (1.0, 0.0) {
        Transformation::Identity
    } else {
        Transformation::Linear { factor, offset }
    }
}

/// Replaces the names of enumeration items in a transformation by their numbers; returns an error sentence if an
/// item is unknown. A Boolean that the mapping does not name keeps its value.
fn resolve(stated: &Stated, here: &Measure, there: &Measure) -> Result<Transformation, String> {
    Ok(match stated {
        Stated::Linear { factor, offset } => linear(*factor, *offset),
        Stated::Boolean(pairs) => {
            let mapped = |value| pairs.iter().find(|(source, _)| *source == value);
            Transformation::Boolean {
                from_false: mapped(false).is_some_and(|(_, target)| *target),
                from_true: mapped(true).is_none_or(|(_, target)| *target),
            }
        }
        Stated::Integer(pairs) => Transformation::Integer(pairs.clone()),
        Stated::Enumeration(pairs) => {
            let number = |items: &Measure, name: &str| {
                let items = items.items.as_deref().unwrap_or_default();
                let item = items.iter().find(|(item, _)| item == name);
                item.map(|(_, value)| *value).ok_or_else(|| {
                    let items: Vec<&str> = items.iter().map(|(item, _)| item.as_str()).collect();
                    format!("expected an item of {}, found {name:?}", listed(&items))
                })
            };
            let pairs = pairs
                .iter()
                .map(|(source, target)| Ok((number(here, source)?, number(there, target)?)));
            Transformation::Integer(pairs.collect::<Result<_, String>>()?)
        }
    })
}

/// Returns the items of an enumeration; leaves out items whose number does not fit the 32-bit integers of SSP.
pub(super) fn items_of(declared: &SimpleType) -> Vec<(String, i32)> {
    let small = |(name, value): &(String, i64)| Some((name.clone(), i32::try_from(*value).ok()?));
    declared.items.iter().filter_map(small).collect()
}

fn listed(items: &[&str]) -> String {
    if items.is_empty() {
        return "an enumeration, which neither the connector nor the FMU states".to_owned();
    }
    format!("the enumeration {}", items.join(", "))
}

/// Composes two transformations: `second` after `first`. Returns an error sentence if they are for different types.
pub(super) fn then(
    first: Transformation,
    second: Transformation,
) -> Result<Transformation, String> {
    use Transformation::{Boolean, Identity, Integer, Linear};
    Ok(match (first, second) {
        (Identity, other) | (other, Identity) => other,
        (Linear { factor: f, offset: o }, Linear { factor, offset }) => {
            linear(factor * f, factor * o + offset)
        }
        (Boolean { from_false: low, from_true: high }, Boolean { from_false, from_true }) => {
            let second = |value| if value { from_true } else { from_false };
            Boolean { from_false: second(low), from_true: second(high) }
        }
        (Integer(first), Integer(second)) => {
            let mut sources: Vec<i32> = first.iter().chain(&second).map(|pair| pair.0).collect();
            sources.sort_unstable();
            sources.dedup();
            let pairs =
                sources.into_iter().map(|source| (source, mapped(&second, mapped(&first, source))));
            Integer(pairs.filter(|(source, target)| source != target).collect())
        }
        _ => return Err("transformations of different types follow each other".to_owned()),
    })
}

/// Returns the target of `value` in `pairs`; `value` itself if no pair has it.
fn mapped(pairs: &[(i32, i32)], value: i32) -> i32 {
    pairs.iter().find(|(source, _)| *source == value).map_or(value, |(_, target)| *target)
}

/// Returns a warning if the file and the FMU state different units for a connector, or units of different names of
/// which one has no definition.
pub(super) fn contradiction(stated: &Measure, declared: &Measure) -> Option<String> {
    match between(stated, declared) {
        Ok(Some((factor, offset))) if (factor, offset) == (1.0, 0.0) => None,
        _ => Some(format!(
            "the unit is {} in the system structure and {} in the FMU: the former is taken",
            stated.name(),
            declared.name()
        )),
    }
}

#[cfg(test)]
mod tests {
    use fmu_description::RealType;

    use super::*;

    #[test]
    fn a_float32_has_the_unit_of_its_variable() {
        let real = RealType { unit: Some("mm".to_owned()), ..RealType::default() };
        let variable = ScalarVariable { kind: Kind::Float32(real), ..ScalarVariable::default() };
        let measure = Measure::of_variable(&variable, &ModelDescription::default());
        assert_eq!(measure.unit, Some(("mm".to_owned(), None)));
    }
}
