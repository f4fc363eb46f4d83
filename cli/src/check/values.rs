//! Values of variables: read from a slave, and stated in the XML.

use fmu_description::{Causality, Kind, ModelDescription, ScalarVariable, Variability};
use master::Value::Real;
use master::{CallError, Failure, Slave, ValueType};

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

    /// Returns the absolute difference of two real numbers. Equal values of any type have the difference 0; other
    /// values that are not finite real numbers have an infinite one.
    fn difference(&self, other: &Value) -> f64 {
        match (&self.0, &other.0) {
            _ if self == other => 0.0,
            (Real(one), Real(other)) => {
                let difference = (one - other).abs();
                if difference.is_nan() { f64::INFINITY } else { difference }
            }
            _ => f64::INFINITY,
        }
    }

    /// Returns the magnitude of a finite real number; 0 for other values.
    fn size(&self) -> f64 {
        match self.0 {
            Real(value) if value.is_finite() => value.abs(),
            _ => 0.0,
        }
    }

    /// Whether the importer cannot represent the value.
    pub(super) fn is_beyond(&self) -> bool {
        matches!(&self.0, master::Value::String(text) if text == BEYOND)
    }

    pub(super) fn is_finite(&self) -> bool {
        !matches!(self.0, Real(value) if !value.is_finite())
    }
}

/// Returns the largest difference between two trajectories of outputs, relative to the largest magnitude of each
/// output. The difference is infinite if the lengths differ, or if values that are not finite real numbers differ.
pub(super) fn distance(one: &[Vec<Value>], other: &[Vec<Value>]) -> f64 {
    if one.len() != other.len() {
        return f64::INFINITY;
    }
    let of_output = |output: usize| {
        let pairs = one.iter().zip(other).map(|(one, other)| (&one[output], &other[output]));
        let sizes = pairs.clone().map(|(one, other)| one.size().max(other.size()));
        let size = sizes.fold(f64::MIN_POSITIVE, f64::max);
        pairs.map(|(one, other)| one.difference(other) / size).fold(0.0, f64::max)
    };
    (0..one.first().map_or(0, Vec::len)).map(of_output).fold(0.0, f64::max)
}

/// The text of a `UInt64` that the importer cannot represent. Such values are equal in a comparison.
const BEYOND: &str = "a value above 2^63 - 1";

/// Reads one variable.
pub(super) fn get(slave: &mut dyn Slave, variable: &ScalarVariable) -> Result<Value, CallError> {
    let kind = ValueType::of(&variable.kind);
    match master::read_value(slave, variable.value_reference, kind) {
        // This is a limit of the importer, not a fault of the FMU.
        Err(CallError { failure: Failure::Unrepresentable(_), .. }) => {
            Ok(Value(master::Value::String(BEYOND.to_owned())))
        }
        read => read.map(Value),
    }
}

/// Returns the start value in the XML; `None` without a stated start value.
pub(super) fn start(variable: &ScalarVariable) -> Option<Value> {
    let start = match &variable.kind {
        Kind::String(start) => start.clone().map(master::Value::String),
        Kind::Binary(binary) => binary.start.clone().map(master::Value::Binary),
        other => master::Value::start(other),
    };
    start.map(Value)
}

/// Returns the variables that keep their start value during the initialization: parameters, inputs, constants. Omits
/// clocked variables, which cannot be read after the initialization.
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

    /// The second output decays to a rounding error, as a control error does.
    #[test]
    fn trajectories_are_compared_by_the_size_of_each_output() {
        let rows = |all: &[[f64; 2]]| -> Vec<Vec<Value>> {
            all.iter().map(|row| row.map(|number| Value(Real(number))).to_vec()).collect()
        };
        let trajectory = rows(&[[8.0, 1.0], [4.0, 1e-17]]);
        for (other, expected) in [
            ([[8.0, 1.0], [4.0, -1e-17]], 2e-17),
            ([[8.0, 1.0], [4.5, 1e-17]], 0.0625),
            ([[8.0, 1.0], [4.0, f64::NAN]], f64::INFINITY),
            ([[8.0, 1.0], [f64::INFINITY, 1e-17]], f64::INFINITY),
        ] {
            let actual = distance(&trajectory, &rows(&other));
            assert_eq!(actual.to_bits(), f64::to_bits(expected), "{other:?}: {actual}");
        }
        assert_eq!(distance(&rows(&[[0.0; 2]]), &rows(&[[-0.0; 2]])).to_bits(), 0);
        assert!(distance(&trajectory, &trajectory[..1]).is_infinite());
    }

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
