//! Values of variables: read from a slave, and stated in the XML.

use fmu_description::{Causality, Kind, ModelDescription, ScalarVariable, Variability};
use master::{CallError, Slave, ValueType};

/// A value of any type; equality compares bits.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Real(u64),
    Integer(i64),
    Boolean(bool),
    String(String),
    Binary(Vec<u8>),
}

impl std::fmt::Display for Value {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Real(bits) => write!(formatter, "{:?}", f64::from_bits(*bits)),
            Value::Integer(value) => write!(formatter, "{value}"),
            Value::Boolean(value) => write!(formatter, "{value}"),
            Value::String(value) => write!(formatter, "{value:?}"),
            Value::Binary(value) => formatter.write_str(&master::to_hex(value)),
        }
    }
}

impl Value {
    /// Whether the value equals the number in the XML, whose last digit may be rounded.
    pub(super) fn agrees(&self, stated: &Value) -> bool {
        match (self, stated) {
            (Value::Real(actual), Value::Real(stated)) => {
                let (actual, stated) = (f64::from_bits(*actual), f64::from_bits(*stated));
                (actual - stated).abs() <= 1e-14 * stated.abs().max(actual.abs())
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
                    Some(relative).filter(|distance| !distance.is_nan()).unwrap_or(f64::INFINITY)
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
    Ok(match ValueType::of(&variable.kind) {
        ValueType::Real => {
            let mut value = [0.0];
            slave.get_real(&reference, &mut value)?;
            Value::Real(value[0].to_bits())
        }
        ValueType::Integer => {
            let mut value = [0];
            slave.get_integer(&reference, &mut value)?;
            Value::Integer(value[0])
        }
        ValueType::Boolean => {
            let mut value = [0];
            slave.get_boolean(&reference, &mut value)?;
            Value::Boolean(value[0] != 0)
        }
        ValueType::String => {
            let mut value = [String::new()];
            slave.get_string(&reference, &mut value)?;
            let [value] = value;
            Value::String(value)
        }
        ValueType::Binary => {
            let mut value = [Vec::new()];
            slave.get_binary(&reference, &mut value)?;
            let [value] = value;
            Value::Binary(value)
        }
    })
}

/// Returns the start value in the XML.
pub(super) fn start(variable: &ScalarVariable) -> Option<Value> {
    match &variable.kind {
        Kind::String(start) => start.clone().map(Value::String),
        Kind::Binary(binary) => binary.start.clone().map(Value::Binary),
        other => match master::Value::start(other)? {
            master::Value::Real(value) => Some(Value::Real(value.to_bits())),
            master::Value::Integer(value) => Some(Value::Integer(value)),
            master::Value::Boolean(value) => Some(Value::Boolean(value)),
            master::Value::String(_) | master::Value::Binary(_) => None,
        },
    }
}

/// Returns the variables that keep their start value during the initialization: parameters, inputs,
/// constants.
pub(super) fn stated_values(
    description: &ModelDescription,
) -> impl Iterator<Item = &ScalarVariable> {
    description.variables.iter().filter(|variable| {
        matches!(variable.causality, Causality::Parameter | Causality::Input)
            || variable.variability == Variability::Constant
    })
}

/// Returns the variables whose trajectories are compared.
pub(super) fn outputs(description: &ModelDescription) -> impl Iterator<Item = &ScalarVariable> {
    description.variables.iter().filter(|variable| variable.causality == Causality::Output)
}

/// Returns a value reference that no variable has.
pub(super) fn unknown_reference(description: &ModelDescription) -> u32 {
    let used: std::collections::HashSet<u32> =
        description.variables.iter().map(|variable| variable.value_reference).collect();
    (0..=u32::MAX).rev().find(|reference| !used.contains(reference)).unwrap_or(u32::MAX)
}
