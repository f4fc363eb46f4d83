//! Values of variables, parsed from text.

use std::fmt;

use fmu_description::{IntegerType, Kind, SimpleType, Version, from_hex, to_hex};
use serde::{Deserialize, Serialize};

/// Relative tolerance of [`Value::is_near`] for Reals.
const TOLERANCE: f64 = 1e-9;

/// A value of one of the base types of FMI; an Enumeration is an Integer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// Real.
    Real(f64),
    /// Integer or Enumeration.
    Integer(i64),
    /// Boolean.
    Boolean(bool),
    /// String.
    String(String),
    /// Binary; as text, hexadecimal digits.
    Binary(Vec<u8>),
}

impl Value {
    /// Reads `text` as a value of a variable of type `kind`; blanks around `text` are ignored, except in a String. An
    /// Enumeration is any integer, or the name of an item of its type in `types`.
    ///
    /// # Errors
    ///
    /// Returns what was expected, as part of a sentence: "a number".
    pub fn parse(kind: &Kind, types: &[SimpleType], text: &str) -> Result<Self, String> {
        let trimmed = text.trim();
        match kind {
            Kind::Real(_) | Kind::Float32(_) => {
                trimmed.parse().map(Value::Real).map_err(|_| "a number".to_owned())
            }
            Kind::Enumeration(integer) => enumeration(integer, types, trimmed),
            Kind::Boolean(_) | Kind::Clock(_) => match trimmed {
                "true" | "1" => Ok(Value::Boolean(true)),
                "false" | "0" => Ok(Value::Boolean(false)),
                _ => Err("true or false".to_owned()),
            },
            Kind::String(_) if text.contains('\0') => {
                Err("a text without the character NUL, which ends the Strings of FMI".to_owned())
            }
            Kind::String(_) => Ok(Value::String(text.to_owned())),
            Kind::Binary(_) => from_hex(trimmed)
                .map(Value::Binary)
                .ok_or_else(|| "an even number of hexadecimal digits".to_owned()),
            Kind::Integer(_) => match trimmed.parse::<i32>() {
                Ok(value) => Ok(Value::Integer(value.into())),
                Err(_) => Err("an integer".to_owned()),
            },
            _ => parse_integer(kind, trimmed),
        }
    }
}

/// Reads an integer of a type of FMI 3.0. A `UInt64` above `i64::MAX` is not supported.
fn parse_integer(kind: &Kind, text: &str) -> Result<Value, String> {
    let range = kind.integer_range(Version::V3).unwrap_or(0..=0);
    let (least, most) = (*range.start(), (*range.end()).min(i64::MAX.into()));
    let value = text.parse::<i128>().ok().filter(|value| (least..=most).contains(value));
    let value = value.and_then(|value| i64::try_from(value).ok());
    value.map(Value::Integer).ok_or_else(|| {
        format!("an integer from {least} to {most}, as its type is {}", kind.element())
    })
}

/// The types that a master distinguishes, by the functions of [`crate::Slave`] that access a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ValueType {
    /// `get_real` and `set_real`: Real, `Float64`, `Float32`.
    Real,
    /// `get_integer` and `set_integer`: all integers and enumerations.
    Integer,
    /// `get_boolean` and `set_boolean`: Boolean, Clock.
    Boolean,
    /// `get_string` and `set_string`.
    String,
    /// `get_binary` and `set_binary`.
    Binary,
}

impl ValueType {
    /// Returns the type by which a master accesses a variable of type `kind`.
    #[must_use]
    pub fn of(kind: &Kind) -> Self {
        match kind {
            Kind::Real(_) | Kind::Float32(_) => ValueType::Real,
            Kind::Boolean(_) | Kind::Clock(_) => ValueType::Boolean,
            Kind::String(_) => ValueType::String,
            Kind::Binary(_) => ValueType::Binary,
            _ => ValueType::Integer,
        }
    }
}

/// Converts an Integer to a Real, rounded to the nearest `f64` beyond 2^53.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "rounds to the nearest number")]
pub fn to_real(value: i64) -> f64 {
    value as f64
}

/// Returns the target of the first pair of [`crate::Transformation::Integer`] with the source `value`; without such a
/// pair, returns `value`.
#[must_use]
pub fn mapped_integer(pairs: &[(i32, i32)], value: i64) -> i64 {
    let pair = pairs.iter().find(|(from, _)| i64::from(*from) == value);
    pair.map_or(value, |(_, to)| (*to).into())
}

impl Value {
    /// Returns the start value that the model description states. `None` if there is none, for a String, a
    /// Binary and a Clock, and for an integer above `i64::MAX`.
    #[must_use]
    pub fn start(kind: &Kind) -> Option<Self> {
        match kind {
            Kind::Real(real) | Kind::Float32(real) => {
                real.start.map(|start| Value::Real(start).held_by(kind))
            }
            Kind::Boolean(start) => start.map(Value::Boolean),
            other => {
                let start = other.as_integer()?.start?;
                i64::try_from(start).ok().map(Value::Integer)
            }
        }
    }

    /// Returns the value that a variable of that kind holds: a `Float32` rounds a Real that is not too large for it.
    #[must_use]
    pub fn held_by(self, kind: &Kind) -> Self {
        match (self, kind) {
            (Value::Real(value), Kind::Float32(_)) => {
                #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
                let rounded = f64::from(value as f32);
                Value::Real(if rounded.is_finite() { rounded } else { value })
            }
            (value, _) => value,
        }
    }

    /// Whether `other`, read from an FMU, equals this value. Reals are equal within a relative difference
    /// of 1e-9, and NaN equals NaN.
    #[must_use]
    pub fn is_near(&self, other: &Self) -> bool {
        match (self, other) {
            (Value::Real(value), Value::Real(other)) => {
                value.total_cmp(other).is_eq()
                    || value.is_finite() && (other - value).abs() <= TOLERANCE * value.abs()
                    || value.is_nan() && other.is_nan()
            }
            _ => self == other,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Real(value) => value.fmt(formatter),
            Value::Integer(value) => value.fmt(formatter),
            Value::Boolean(value) => value.fmt(formatter),
            Value::String(value) => write!(formatter, "{value:?}"),
            Value::Binary(value) => formatter.write_str(&to_hex(value)),
        }
    }
}

/// Reads an integer, or the name of an item of the declared type.
fn enumeration(kind: &IntegerType, types: &[SimpleType], text: &str) -> Result<Value, String> {
    if let Ok(number) = text.parse() {
        return Ok(Value::Integer(number));
    }
    let declared = types.iter().find(|known| Some(&known.name) == kind.declared_type.as_ref());
    let items = declared.map(|declared| declared.items.as_slice()).unwrap_or_default();
    if let Some((_, number)) = items.iter().find(|(name, _)| name == text) {
        return Ok(Value::Integer(*number));
    }
    if items.is_empty() {
        return Err("an integer".to_owned());
    }
    let names: Vec<_> = items.iter().map(|(name, _)| name.as_str()).collect();
    Err(format!("an integer or one of the items {}", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::Value;
    use fmu_description::{IntegerType, Kind};

    #[test]
    fn an_enumeration_without_items_expects_an_integer() {
        let kind = Kind::Enumeration(IntegerType::default());
        assert_eq!(Value::parse(&kind, &[], "7"), Ok(Value::Integer(7)));
        assert_eq!(Value::parse(&kind, &[], "on"), Err("an integer".to_owned()));
    }

    #[test]
    fn a_string_has_no_nul_which_would_end_it_in_the_fmu() {
        let kind = Kind::String(None);
        assert_eq!(Value::parse(&kind, &[], " a "), Ok(Value::String(" a ".to_owned())));
        assert!(Value::parse(&kind, &[], "a\0b").is_err());
    }

    #[test]
    fn an_infinite_real_is_near_itself_only() {
        let infinite = Value::Real(f64::INFINITY);
        assert!(infinite.is_near(&infinite));
        for other in [5.0, f64::NEG_INFINITY, f64::NAN] {
            assert!(!infinite.is_near(&Value::Real(other)), "{other}");
        }
    }
}
