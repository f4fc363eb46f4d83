//! Resolves the names of a request to variables and their roles.

use std::collections::HashSet;

use fmu_description::{
    Causality, Initial, Kind, ModelDescription, RealType, ScalarVariable, Variability,
};

use super::{Linearise, LineariseError};
use fmu_description::similar::nearest;
use slave::Value;

/// The causalities of states and outputs.
const READABLE: [Causality; 2] = [Causality::Output, Causality::Local];

/// A Real variable that is a state, an input or an output.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) reference: u32,
    pub(super) unit: Option<String>,
    pub(super) min: f64,
    pub(super) max: f64,
    /// The typical size of a change, from the request or from `nominal`.
    pub(super) typical: Option<f64>,
}

impl Part {
    /// Returns the typical size of a change about `value`: `typical`, otherwise |value|, or 1 for zero.
    pub(super) fn scale(&self, value: f64) -> f64 {
        let magnitude = if value == 0.0 { 1.0 } else { value.abs() };
        self.typical.unwrap_or(magnitude)
    }
}

/// A continuous state and the variable that is its derivative.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) part: Part,
    pub(super) derivative: u32,
}

/// One entry of the operating point.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    pub(super) name: String,
    pub(super) text: String,
    pub(super) reference: u32,
    pub(super) value: Value,
    pub(super) is_input: bool,
    /// Whether the variable is an input or has a start value that may be set.
    pub(super) settable: bool,
}

/// The resolved variables of a request.
pub(super) struct Parts<'a> {
    pub(super) description: &'a ModelDescription,
    /// The control inputs, then the faults.
    pub(super) inputs: Vec<Part>,
    /// Number of control inputs.
    pub(super) controlled: usize,
    pub(super) outputs: Vec<Part>,
    pub(super) settings: Vec<Setting>,
}

impl<'a> Parts<'a> {
    pub(super) fn of(
        description: &'a ModelDescription,
        request: &Linearise,
    ) -> Result<Self, LineariseError> {
        check_distinct(request.inputs.iter().chain(&request.faults), "inputs and faults")?;
        check_distinct(&request.outputs, "outputs")?;
        check_distinct(&request.states, "states")?;
        check_distinct(request.at.iter().map(|(name, _)| name), "values of the operating point")?;
        check_distinct(request.typical.iter().map(|(name, _)| name), "typical sizes")?;
        let part = |name: &String, allowed: &[Causality], expected| {
            let variable = find(description, name)?;
            part(description, request, variable, allowed, expected)
        };
        let inputs = request.inputs.iter().chain(&request.faults);
        let inputs = inputs.map(|name| part(name, &[Causality::Input], "an input"));
        let outputs = request.outputs.iter().map(|name| part(name, &READABLE, "an output"));
        for (name, size) in &request.typical {
            find(description, name)?;
            if !(size.is_finite() && *size > 0.0) {
                let what = format!("the typical size of {name}");
                let expected = "a finite number above zero";
                return Err(LineariseError::Number { what, value: *size, expected });
            }
        }
        Ok(Self {
            description,
            inputs: inputs.collect::<Result<_, _>>()?,
            controlled: request.inputs.len(),
            outputs: outputs.collect::<Result<_, _>>()?,
            settings: settings(description, request)?,
        })
    }

    /// Returns all continuous states, in the order of `Derivatives`.
    pub(super) fn states(&self, request: &Linearise) -> Result<Vec<State>, LineariseError> {
        let mut states = Vec::new();
        for unknown in &self.description.structure.derivatives {
            let derivative = self.description.at(unknown.index);
            let state = derivative
                .and_then(|variable| self.description.at(variable.kind.as_real()?.derivative?));
            let (Some(derivative), Some(state)) = (derivative, state) else {
                let index = unknown.index;
                let text = format!("the variable {index} is not the derivative of a state");
                return Err(LineariseError::Structure { text });
            };
            let part = part(self.description, request, state, &READABLE, "a state")?;
            states.push(State { part, derivative: derivative.value_reference });
        }
        Ok(states)
    }

    /// Returns the variables that the request names as states.
    pub(super) fn named_states(&self, request: &Linearise) -> Result<Vec<Part>, LineariseError> {
        let named = request.states.iter().map(|name| {
            let variable = find(self.description, name)?;
            part(self.description, request, variable, &READABLE, "a state")
        });
        named.collect()
    }
}

fn check_distinct<'n>(
    names: impl IntoIterator<Item = &'n String>,
    list: &'static str,
) -> Result<(), LineariseError> {
    let mut earlier = HashSet::new();
    match names.into_iter().find(|name| !earlier.insert(*name)) {
        Some(name) => Err(LineariseError::Twice { name: name.clone(), list }),
        None => Ok(()),
    }
}

pub(super) fn find<'a>(
    description: &'a ModelDescription,
    name: &str,
) -> Result<&'a ScalarVariable, LineariseError> {
    description.variable(name).ok_or_else(|| LineariseError::UnknownVariable {
        model: description.model_name.clone(),
        name: name.to_owned(),
        nearest: nearest(description, name),
    })
}

/// Resolves a continuous Real with one of the allowed causalities; any other variable is an error.
fn part(
    description: &ModelDescription,
    request: &Linearise,
    variable: &ScalarVariable,
    allowed: &[Causality],
    expected: &'static str,
) -> Result<Part, LineariseError> {
    let name = variable.name.clone();
    let role =
        |actual: String, expected| LineariseError::Role { name: name.clone(), actual, expected };
    if !allowed.contains(&variable.causality) {
        let actual = format!("a variable of causality {}", variable.causality.as_str());
        return Err(role(actual, expected));
    }
    let Kind::Real(real) = &variable.kind else {
        return Err(role(format!("a variable of type {}", variable.kind.element()), "a Real"));
    };
    if variable.variability != Variability::Continuous {
        let actual = format!("a variable of variability {}", variable.variability.as_str());
        return Err(role(actual, "a continuous one"));
    }
    let typical = request.typical.iter().find(|(known, _)| *known == name).map(|(_, size)| *size);
    let usable = |size: &f64| size.is_finite() && *size > 0.0;
    let nominal = attribute(description, real, |real| real.nominal).filter(usable);
    Ok(Part {
        reference: variable.value_reference,
        unit: attribute(description, real, |real| real.unit.clone()),
        min: attribute(description, real, |real| real.min).unwrap_or(f64::NEG_INFINITY),
        max: attribute(description, real, |real| real.max).unwrap_or(f64::INFINITY),
        typical: typical.or(nominal),
        name,
    })
}

/// Returns an attribute of the variable, otherwise the attribute of its declared type; `None` if neither states it.
fn attribute<T>(
    description: &ModelDescription,
    real: &RealType,
    get: impl Fn(&RealType) -> Option<T>,
) -> Option<T> {
    get(real).or_else(|| {
        let declared = real.declared_type.as_ref()?;
        let declared = description.types.iter().find(|known| known.name == *declared)?;
        let Kind::Real(real) = &declared.kind else { return None };
        get(real)
    })
}

/// Parses the values of the operating point.
fn settings(
    description: &ModelDescription,
    request: &Linearise,
) -> Result<Vec<Setting>, LineariseError> {
    let setting = |(name, text): &(String, String)| {
        let variable = find(description, name)?;
        let wrong = |expected: String| {
            let (name, text) = (name.clone(), text.clone());
            LineariseError::Value { name, text, expected }
        };
        let value = Value::parse(&variable.kind, &description.types, text).map_err(wrong)?;
        if matches!(value, Value::Real(value) if !value.is_finite()) {
            return Err(wrong("a finite number".to_owned()));
        }
        let at_start = variable.variability != Variability::Constant
            && matches!(variable.initial_in_force(), Some(Initial::Exact | Initial::Approx));
        let is_input = variable.causality == Causality::Input;
        Ok(Setting {
            name: name.clone(),
            text: text.clone(),
            reference: variable.value_reference,
            value,
            is_input,
            settable: is_input || at_start,
        })
    };
    request.at.iter().map(setting).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_description::{ModelStructure, Unknown};

    /// FMI 3.0 allows continuous states of the type Float32.
    #[test]
    fn a_state_of_the_type_float32_is_refused_for_its_type() {
        let variable = |name: &str, derivative| ScalarVariable {
            name: name.to_owned(),
            kind: Kind::Float32(RealType { derivative, ..RealType::default() }),
            ..ScalarVariable::default()
        };
        let derivatives = vec![Unknown { index: 2, ..Unknown::default() }];
        let description = ModelDescription {
            variables: vec![variable("x", None), variable("der(x)", Some(1))],
            structure: ModelStructure { derivatives, ..ModelStructure::default() },
            ..ModelDescription::default()
        };
        let request = Linearise::default();
        let parts = Parts::of(&description, &request).unwrap();
        let refused = parts.states(&request).unwrap_err();
        assert_eq!(refused.to_string(), "x is a variable of type Float32, expected a Real");
    }
}
