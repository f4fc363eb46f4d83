//! Values of variables, parsed from text.

use std::fmt;

use fmu_description::{IntegerType, Kind, SimpleType};

/// Relative tolerance of [`Value::is_near`] for Reals.
const TOLERANCE: f64 = 1e-9;

/// A value of one of the base types of FMI; an Enumeration is an Integer.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Real.
    Real(f64),
    /// Integer or Enumeration.
    Integer(i32),
    /// Boolean.
    Boolean(bool),
    /// String.
    String(String),
}

impl Value {
    /// Reads `text` as a value of a variable of that kind. An item of an enumeration may be given by its
    /// name in `types`.
    ///
    /// # Errors
    ///
    /// What was expected, as part of a sentence: "a number".
    pub fn parse(kind: &Kind, types: &[SimpleType], text: &str) -> Result<Self, String> {
        let trimmed = text.trim();
        match kind {
            Kind::Real(_) | Kind::Float32(_) => {
                trimmed.parse().map(Value::Real).map_err(|_| "a number".to_owned())
            }
            Kind::Enumeration(integer) => enumeration(integer, types, trimmed),
            Kind::Boolean(_) => match trimmed {
                "true" | "1" => Ok(Value::Boolean(true)),
                "false" | "0" => Ok(Value::Boolean(false)),
                _ => Err("true or false".to_owned()),
            },
            Kind::String(_) => Ok(Value::String(text.to_owned())),
            Kind::Binary(_) | Kind::Clock(_) => {
                Err(format!("no value for a variable of type {}", kind.element()))
            }
            _ => trimmed.parse().map(Value::Integer).map_err(|_| "an integer".to_owned()),
        }
    }
}

impl Value {
    /// Returns the start value in a model description; `None` for a String or without start value.
    #[must_use]
    pub fn start(kind: &Kind) -> Option<Self> {
        match kind {
            Kind::Real(real) | Kind::Float32(real) => real.start.map(Value::Real),
            Kind::Boolean(start) => start.map(Value::Boolean),
            other => {
                let start = other.as_integer()?.start?;
                i32::try_from(start).ok().map(Value::Integer)
            }
        }
    }

    /// Whether `found`, read from an FMU, equals this value; for Reals within a relative difference of
    /// 1e-9.
    #[must_use]
    pub fn is_near(&self, found: &Self) -> bool {
        match (self, found) {
            (Value::Real(value), Value::Real(found)) => {
                value.total_cmp(found).is_eq()
                    || (found - value).abs() <= TOLERANCE * value.abs()
                    || value.is_nan() && found.is_nan()
            }
            _ => self == found,
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
        }
    }
}

fn enumeration(kind: &IntegerType, types: &[SimpleType], text: &str) -> Result<Value, String> {
    if let Ok(number) = text.parse() {
        return Ok(Value::Integer(number));
    }
    let declared = types.iter().find(|known| Some(&known.name) == kind.declared_type.as_ref());
    let items = declared.map(|declared| declared.items.as_slice()).unwrap_or_default();
    let named = items.iter().find(|(name, _)| name == text);
    if let Some(number) = named.and_then(|(_, number)| i32::try_from(*number).ok()) {
        return Ok(Value::Integer(number));
    }
    let names: Vec<_> = items.iter().map(|(name, _)| name.as_str()).collect();
    Err(format!("an integer or one of the items {}", names.join(", ")))
}
