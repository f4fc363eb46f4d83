//! Values of variables: read from a slave, and stated in the XML.

use fmu_description::{Causality, Kind, ModelDescription, ScalarVariable, Variability};
use master::{CallError, Slave};

/// A value of any type; equality compares bits.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Real(u64),
    Integer(i32),
    Boolean(bool),
    String(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Real(bits) => write!(formatter, "{:?}", f64::from_bits(*bits)),
            Value::Integer(value) => write!(formatter, "{value}"),
            Value::Boolean(value) => write!(formatter, "{value}"),
            Value::String(value) => write!(formatter, "{value:?}"),
        }
    }
}

impl Value {
    /// Whether the value equals the number in the XML, whose last digit may be rounded.
    pub(super) fn agrees(&self, stated: &Value) -> bool {
        match (self, stated) {
            (Value::Real(found), Value::Real(stated)) => {
                let (found, stated) = (f64::from_bits(*found), f64::from_bits(*stated));
                (found - stated).abs() <= 1e-14 * stated.abs().max(found.abs())
            }
            _ => self == stated,
        }
    }

    /// Returns the difference relative to the larger of the two.
    fn apart(&self, other: &Value) -> f64 {
        match (self, other) {
            _ if self == other => 0.0,
            (Value::Real(one), Value::Real(other)) => {
                let (one, other) = (f64::from_bits(*one), f64::from_bits(*other));
                let relative = (one - other).abs() / one.abs().max(other.abs());
                // Positive and negative zero are equal.
                if (one - other).abs() <= 0.0 {
                    0.0
                } else {
                    Some(relative).filter(|own| !own.is_nan()).unwrap_or(f64::INFINITY)
                }
            }
            _ => f64::INFINITY,
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        !matches!(self, Value::Real(bits) if !f64::from_bits(*bits).is_finite())
    }
}

/// Returns the largest difference between two trajectories of outputs, relative to the size of the
/// values; infinite if the lengths or values other than numbers differ.
pub(super) fn distance(one: &[Vec<Value>], other: &[Vec<Value>]) -> f64 {
    if one.len() != other.len() {
        return f64::INFINITY;
    }
    let pairs = one.iter().flatten().zip(other.iter().flatten());
    pairs.map(|(one, other)| one.apart(other)).fold(0.0, f64::max)
}

/// Reads one variable.
pub(super) fn get(slave: &mut dyn Slave, variable: &ScalarVariable) -> Result<Value, CallError> {
    let reference = [variable.value_reference];
    Ok(match &variable.kind {
        own if own.as_real().is_some() => {
            let mut value = [0.0];
            slave.get_real(&reference, &mut value)?;
            Value::Real(value[0].to_bits())
        }
        own if own.as_integer().is_some() => {
            let mut value = [0];
            slave.get_integer(&reference, &mut value)?;
            Value::Integer(value[0])
        }
        Kind::Boolean(_) => {
            let mut value = [0];
            slave.get_boolean(&reference, &mut value)?;
            Value::Boolean(value[0] != 0)
        }
        _ => {
            let mut value = [String::new()];
            slave.get_string(&reference, &mut value)?;
            let [value] = value;
            Value::String(value)
        }
    })
}

/// Returns the start value in the XML.
pub(super) fn start(variable: &ScalarVariable) -> Option<Value> {
    match &variable.kind {
        Kind::Real(own) => own.start.map(|value| Value::Real(value.to_bits())),
        Kind::Boolean(start) => start.map(Value::Boolean),
        Kind::String(start) => start.clone().map(Value::String),
        other => {
            let start = other.as_integer()?.start?;
            i32::try_from(start).ok().map(Value::Integer)
        }
    }
}

/// Returns the variables that keep their start value during the initialization: parameters, inputs,
/// constants.
pub(super) fn kept(description: &ModelDescription) -> impl Iterator<Item = &ScalarVariable> {
    description.variables.iter().filter(|own| {
        matches!(own.causality, Causality::Parameter | Causality::Input)
            || own.variability == Variability::Constant
    })
}

/// Returns the variables whose trajectories are compared.
pub(super) fn outputs(description: &ModelDescription) -> impl Iterator<Item = &ScalarVariable> {
    description.variables.iter().filter(|own| own.causality == Causality::Output)
}

/// Returns a value reference that no variable has.
pub(super) fn unknown_reference(description: &ModelDescription) -> u32 {
    let used: std::collections::HashSet<u32> =
        description.variables.iter().map(|own| own.value_reference).collect();
    (0..=u32::MAX).rev().find(|reference| !used.contains(reference)).unwrap_or(u32::MAX)
}
