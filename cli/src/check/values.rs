//! Values of variables: read from a slave, and stated in the XML.

use fmu_description::{Causality, Kind, ModelDescription, ScalarVariable, Variability};
use master::Value::Real;
use master::{CallError, Slave, ValueType};

/// A value of any type; equality compares bits.
#[derive(Clone, Debug)]
pub(super) struct Value(master::Value);

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Real(one), Real(other)) => one.to_bits() == other.to_bits(),
            (one, other) => one == other,
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.0 {
            Real(value) => write!(formatter, "{value:?}"),
            other => other.fmt(formatter),
        }
    }
}

impl Value {
    /// Whether the value equals the value in the XML; the last digit of a real number may be rounded.
    pub(super) fn agrees(&self, stated: &Value) -> bool {
        match (&self.0, &stated.0) {
            _ if self == stated => true,
            (Real(actual), Real(stated)) => {
                let difference = (actual - stated).abs();
                let rounded = difference <= 1e-14 * stated.abs().max(actual.abs());
                rounded && difference.is_finite() || actual.is_nan() && stated.is_nan()
            }
            _ => false,
        }
    }

    /// Returns the difference relative to the larger of two real numbers; 0 for equal values, infinite for others
    /// that are not finite real numbers.
    fn difference(&self, other: &Value) -> f64 {
        match (&self.0, &other.0) {
            _ if self == other => 0.0,
            (Real(one), Real(other)) => {
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
        !matches!(self.0, Real(value) if !value.is_finite())
    }
}

/// Returns the largest difference between two trajectories of outputs, relative to the size of the
/// values; infinite if the lengths differ, or values that are not finite real numbers.
pub(super) fn distance(one: &[Vec<Value>], other: &[Vec<Value>]) -> f64 {
    if one.len() != other.len() {
        return f64::INFINITY;
    }
    let pairs = one.iter().flatten().zip(other.iter().flatten());
    pairs.map(|(one, other)| one.difference(other)).fold(0.0, f64::max)
}

/// Reads one variable.
pub(super) fn get(slave: &mut dyn Slave, variable: &ScalarVariable) -> Result<Value, CallError> {
    master::read_value(slave, variable.value_reference, ValueType::of(&variable.kind)).map(Value)
}

/// Returns the start value in the XML; `None` if it states none.
pub(super) fn start(variable: &ScalarVariable) -> Option<Value> {
    let start = match &variable.kind {
        Kind::String(start) => start.clone().map(master::Value::String),
        Kind::Binary(binary) => binary.start.clone().map(master::Value::Binary),
        other => master::Value::start(other),
    };
    start.map(Value)
}

/// Returns the variables that keep their start value during the initialization: parameters, inputs,
/// constants. Clocked ones cannot be read after it.
pub(super) fn start_variables(
    description: &ModelDescription,
) -> impl Iterator<Item = &ScalarVariable> {
    description.variables.iter().filter(|variable| variable.clocks.is_empty()).filter(|variable| {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn start_values_of_clocked_variables_are_not_compared() {
        let description = ModelDescription::parse(
            r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="t">
<CoSimulation modelIdentifier="M" hasEventMode="true"/><ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
<Clock name="c" valueReference="1" causality="input" intervalVariability="triggered"/>
<Float64 name="a" valueReference="2" causality="input" start="5" clocks="1"/>
<Float64 name="b" valueReference="3" causality="input" start="5"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"#,
        );
        let description = description.unwrap();
        let names = start_variables(&description).map(|variable| variable.name.as_str());
        assert_eq!(names.collect::<Vec<_>>(), ["c", "b"]);
    }

    #[test]
    fn start_values_agree_to_the_last_digit_and_infinite_ones_only_if_they_are_equal() {
        let (inf, nan) = (f64::INFINITY, f64::NAN);
        for (actual, stated, agrees) in [
            (0.1 + 0.2, 0.3, true),
            (1.0, 1.001, false),
            (0.0, -0.0, true),
            (inf, inf, true),
            (inf, -inf, false),
            (1.0, inf, false),
            (inf, 1.0, false),
            (nan, -nan, true),
            (nan, 1.0, false),
        ] {
            let [value, start] = [actual, stated].map(|number| Value(Real(number)));
            assert_eq!(value.agrees(&start), agrees, "{actual} {stated}");
        }
    }
}
