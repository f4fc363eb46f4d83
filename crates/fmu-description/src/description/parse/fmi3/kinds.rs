//! Reads the types of FMI 3.0 with their attributes, in `TypeDefinitions` and of variables.

use std::ops::RangeInclusive;

use crate::description::parse::attributes::{Node, Result};
use crate::description::{
    BinaryType, ClockType, IntegerType, IntervalVariability, Kind, RealType, SimpleType, Version,
};

pub(super) fn types(root: Node<'_>) -> Result<Vec<SimpleType>> {
    let Some(list) = root.optional_child("TypeDefinitions")? else { return Ok(Vec::new()) };
    let mut types = Vec::new();
    for element in list.children() {
        let name = element.element.name.strip_suffix("Type");
        // The check against the schema has warned of other elements.
        let Some(mut kind) = name.and_then(Kind::blank) else { continue };
        attributes(element, &mut kind, None)?;
        let items = if let Kind::Enumeration(_) = kind {
            element.children_named("Item").map(item).collect::<Result<_, _>>()?
        } else {
            Vec::new()
        };
        types.push(SimpleType {
            name: element.required("name")?.to_owned(),
            description: element.text("description"),
            kind,
            items,
        });
    }
    Ok(types)
}

fn item(element: Node<'_>) -> Result<(String, i64)> {
    let text = element.required("value")?;
    let value = element.integer_within("value", &(i64::MIN.into()..=i64::MAX.into()))?;
    let value = value.and_then(|value| i64::try_from(value).ok());
    let value = value.ok_or_else(|| element.wrong("value", "an integer", text))?;
    Ok((element.required("name")?.to_owned(), value))
}

/// Reads the attributes that a type and a variable have in common into `kind`; a Boolean and a String have none.
/// `declared` are the name and the kind of the declared type, whose attributes replace missing ones.
pub(super) fn attributes(
    element: Node<'_>,
    kind: &mut Kind,
    declared: Option<(String, &Kind)>,
) -> Result<()> {
    let (declared_type, defaults) = declared.unzip();
    let (range, round) = (kind.integer_range(Version::V3), rounding(kind));
    if let (Some(integer_type), Some(range)) = (kind.as_integer_mut(), range) {
        let limits = integer(element, &range, defaults.and_then(Kind::as_integer))?;
        *integer_type = IntegerType { declared_type, ..limits };
    } else if let Some(real_type) = kind.as_real_mut() {
        let limits = real(element, round, defaults.and_then(Kind::as_real))?;
        *real_type = RealType { declared_type, ..limits };
    } else if let Kind::Binary(binary_type) = kind {
        let defaults = match defaults {
            Some(Kind::Binary(defaults)) => defaults,
            _ => &BinaryType::default(),
        };
        *binary_type = BinaryType { declared_type, ..binary(element, defaults) };
    } else if let Kind::Clock(clock_type) = kind {
        let defaults = match defaults {
            Some(Kind::Clock(defaults)) => Some(defaults),
            _ => None,
        };
        *clock_type = ClockType { declared_type, ..clock(element, defaults)? };
    }
    Ok(())
}

/// Returns the function that rounds a number to the precision of a floating-point type.
#[expect(clippy::cast_possible_truncation, reason = "the FMU stores the rounded number")]
pub(super) fn rounding(kind: &Kind) -> fn(f64) -> f64 {
    match kind {
        Kind::Float32(_) => |value| f64::from(value as f32),
        _ => |value| value,
    }
}

fn real(element: Node<'_>, round: fn(f64) -> f64, defaults: Option<&RealType>) -> Result<RealType> {
    let defaults = defaults.cloned().unwrap_or_default();
    Ok(RealType {
        quantity: element.text("quantity").or(defaults.quantity),
        unit: element.text("unit").or(defaults.unit),
        display_unit: element.text("displayUnit").or(defaults.display_unit),
        min: element.bound("min", defaults.min)?.map(round),
        max: element.bound("max", defaults.max)?.map(round),
        nominal: element.number("nominal")?.map(round).or(defaults.nominal),
        relative_quantity: element.optional_flag("relativeQuantity").or(defaults.relative_quantity),
        ..RealType::default()
    })
}

fn integer(
    element: Node<'_>,
    range: &RangeInclusive<i128>,
    defaults: Option<&IntegerType>,
) -> Result<IntegerType> {
    let defaults = defaults.cloned().unwrap_or_default();
    Ok(IntegerType {
        quantity: element.text("quantity").or(defaults.quantity),
        min: element.integer_within("min", range)?.or(defaults.min),
        max: element.integer_within("max", range)?.or(defaults.max),
        ..IntegerType::default()
    })
}

fn binary(element: Node<'_>, defaults: &BinaryType) -> BinaryType {
    BinaryType {
        mime_type: element.text("mimeType").or(defaults.mime_type.clone()),
        max_size: element.optional_counter("maxSize").or(defaults.max_size),
        ..BinaryType::default()
    }
}

fn clock(element: Node<'_>, defaults: Option<&ClockType>) -> Result<ClockType> {
    let has_defaults = defaults.is_some();
    let defaults = defaults.cloned().unwrap_or_default();
    let flag = |name, default| element.optional_flag(name).unwrap_or(default);
    let interval_decimal = element.number("intervalDecimal")?.or(defaults.interval_decimal);
    let stated = element.word("intervalVariability", IntervalVariability::WORDS);
    let interval_variability = match stated {
        Some(stated) => stated,
        None if has_defaults => defaults.interval_variability,
        None => assumed_interval(element, interval_decimal),
    };
    Ok(ClockType {
        declared_type: None,
        can_be_deactivated: flag("canBeDeactivated", defaults.can_be_deactivated),
        priority: element.optional_unsigned("priority").or(defaults.priority),
        interval_variability,
        interval_decimal,
        shift_decimal: element.number("shiftDecimal")?.or(defaults.shift_decimal),
        supports_fraction: flag("supportsFraction", defaults.supports_fraction),
        resolution: element.optional_counter("resolution").or(defaults.resolution),
        interval_counter: element.optional_counter("intervalCounter").or(defaults.interval_counter),
        shift_counter: element.optional_counter("shiftCounter").or(defaults.shift_counter),
    })
}

/// Returns the interval variability of a clock that states no valid one: constant if the clock has an interval,
/// otherwise triggered. Warns if the attribute is missing.
fn assumed_interval(element: Node<'_>, interval: Option<f64>) -> IntervalVariability {
    const NAME: &str = "intervalVariability";
    let assumed = if interval.is_some() {
        IntervalVariability::Constant
    } else {
        IntervalVariability::Triggered
    };
    if !element.has(NAME) {
        let expected = format!("one of {}", IntervalVariability::WORDS.join(", "));
        element.warn_missing(NAME, &expected, &format!("read as {}", assumed.as_str()));
    }
    assumed
}
