//! FMUs of FMI 1.0 for co-simulation (stand-alone) and for model exchange as slaves.
//!
//! FMI 1.0 has no initialization mode: `fmiInitializeSlave` or `fmiInitialize` is called when the master enters it.
//! Values set before are start values; afterwards inputs can be set, and parameters are fixed.

use std::collections::{HashMap, HashSet};
use std::ffi::{c_char, c_int};

use fmu_description::{Causality, Experiment, Kind, ModelDescription};

use crate::library::Interface;
use crate::library::v1::Component;
use crate::v2::narrow;
use slave::{CallError, CompletedStep, EventInfo, ValueType};

/// An instance of an FMU of FMI 1.0 in this process.
pub(crate) struct Instance {
    pub(crate) component: Component,
    experiment: Experiment,
    /// Whether the master is in initialization mode: the FMU is initialised already, and only inputs can be set.
    in_initialization_mode: bool,
    /// The inputs: type and value reference.
    inputs: HashSet<(ValueType, u32)>,
    /// Value references of the negated aliases in `description`, each with the value reference in the FMU.
    negated: HashMap<u32, u32>,
    /// The model description, with a separate value reference for each negated alias.
    description: ModelDescription,
    /// Buffers of the calls.
    references: Vec<u32>,
    reals: Vec<f64>,
    integers: Vec<c_int>,
    booleans: Vec<c_char>,
    /// Result of `fmiInitialize` of a model-exchange FMU, until a value is set or `fmiEventUpdate` is due.
    initialized: Option<EventInfo>,
    interface: Interface,
}

/// Returns the description of an instance: each negated alias has a separate value reference.
pub(crate) fn scalar_description(description: &ModelDescription) -> ModelDescription {
    let mut scalars = description.clone();
    separate_negated(&mut scalars);
    scalars
}

/// Gives each negated alias of `description` a value reference that no variable has; returns these references, each
/// with the value reference in the FMU. A String has no sign: its alias is no longer negated.
fn separate_negated(description: &mut ModelDescription) -> HashMap<u32, u32> {
    let used: HashSet<u32> =
        description.variables.iter().map(|variable| variable.value_reference).collect();
    let mut free = (0..=u32::MAX).rev().filter(|reference| !used.contains(reference));
    let mut negated = HashMap::new();
    for variable in description.variables.iter_mut().filter(|variable| variable.negated) {
        if matches!(variable.kind, Kind::String(_)) {
            variable.negated = false;
        } else if let Some(reference) = free.next() {
            negated.insert(reference, variable.value_reference);
            variable.value_reference = reference;
        }
    }
    negated
}

/// Returns the value references in the FMU of the variables in `list`; stores them in `buffer` if some are `negated`.
fn references_in_fmu<'a>(
    negated: &HashMap<u32, u32>,
    list: &'a [u32],
    buffer: &'a mut Vec<u32>,
) -> &'a [u32] {
    if !list.iter().any(|reference| negated.contains_key(reference)) {
        return list;
    }
    buffer.clear();
    buffer.extend(list.iter().map(|reference| negated.get(reference).unwrap_or(reference)));
    buffer
}

impl Instance {
    pub(crate) fn new(
        component: Component,
        description: &ModelDescription,
        interface: Interface,
    ) -> Self {
        let mut description = description.clone();
        let negated = separate_negated(&mut description);
        let inputs =
            description.variables.iter().filter(|variable| variable.causality == Causality::Input);
        let inputs =
            inputs.map(|variable| (ValueType::of(&variable.kind), variable.value_reference));
        Self {
            component,
            experiment: Experiment { start_time: 0.0, stop_time: None, tolerance: None },
            in_initialization_mode: false,
            inputs: inputs.collect(),
            negated,
            description,
            references: Vec::new(),
            reals: Vec::new(),
            integers: Vec::new(),
            booleans: Vec::new(),
            initialized: None,
            interface,
        }
    }

    /// Returns whether to pass values to the FMU: in initialization mode only if all of them are values of inputs.
    /// The master then sets start values and parameters again, which the FMU has already. Passing a value makes the
    /// result of `fmiInitialize` out of date.
    fn accepts(&mut self, kind: ValueType, references: &[u32]) -> bool {
        let accepted = !self.in_initialization_mode
            || references.iter().all(|reference| self.inputs.contains(&(kind, *reference)));
        if accepted {
            self.initialized = None;
        }
        accepted
    }

    #[expect(clippy::unnecessary_wraps, reason = "as in FMI 2.0")]
    pub(crate) fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.experiment = *experiment;
        Ok(())
    }

    pub(crate) fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        let Experiment { start_time, stop_time, tolerance } = self.experiment;
        match self.interface {
            Interface::CoSimulation => self.component.initialize(start_time, stop_time)?,
            Interface::ModelExchange => {
                self.component.set_time(start_time)?;
                self.initialized = Some(self.component.initialize_model(tolerance)?);
            }
        }
        self.in_initialization_mode = true;
        Ok(())
    }

    #[expect(clippy::unnecessary_wraps, reason = "as in the later versions")]
    pub(crate) fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        self.in_initialization_mode = false;
        Ok(())
    }

    /// Returns the description, with a separate value reference for each negated alias.
    pub(crate) fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn is_negated(&self, reference: u32) -> bool {
        self.negated.contains_key(&reference)
    }

    /// Changes the sign of the values of negated aliases.
    fn negate(&self, list: &[u32], values: &mut [f64]) {
        for (value, reference) in values.iter_mut().zip(list) {
            if self.is_negated(*reference) {
                *value = -*value;
            }
        }
    }

    /// Stores the values for the FMU, with the opposite sign for negated aliases.
    fn store_reals(&mut self, list: &[u32], values: &[f64]) {
        self.reals.clear();
        for (value, reference) in values.iter().zip(list) {
            let real = if self.is_negated(*reference) { -value } else { *value };
            self.reals.push(real);
        }
    }

    pub(crate) fn get_real(&mut self, list: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.get_real(references, values)?;
        self.negate(list, values);
        Ok(())
    }

    pub(crate) fn set_real(&mut self, list: &[u32], values: &[f64]) -> Result<(), CallError> {
        if !self.accepts(ValueType::Real, list) {
            return Ok(());
        }
        self.store_reals(list, values);
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.set_real(references, &self.reals)
    }

    pub(crate) fn set_input_derivatives(
        &mut self,
        list: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        self.store_reals(list, values);
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.set_input_derivatives(references, orders, &self.reals)
    }

    pub(crate) fn get_output_derivatives(
        &mut self,
        list: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.get_output_derivatives(references, orders, values)?;
        self.negate(list, values);
        Ok(())
    }

    pub(crate) fn get_integer(
        &mut self,
        list: &[u32],
        values: &mut [i64],
    ) -> Result<(), CallError> {
        self.integers.clear();
        self.integers.resize(list.len(), 0);
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.get_integer(references, &mut self.integers)?;
        for ((value, integer), reference) in values.iter_mut().zip(&self.integers).zip(list) {
            let integer = i64::from(*integer);
            *value = if self.is_negated(*reference) { -integer } else { integer };
        }
        Ok(())
    }

    pub(crate) fn set_integer(&mut self, list: &[u32], values: &[i64]) -> Result<(), CallError> {
        if !self.accepts(ValueType::Integer, list) {
            return Ok(());
        }
        self.integers.clear();
        for (value, reference) in values.iter().zip(list) {
            let integer = integer_for_fmu(*value, self.is_negated(*reference))?;
            self.integers.push(integer);
        }
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.set_integer(references, &self.integers)
    }

    pub(crate) fn get_boolean(
        &mut self,
        list: &[u32],
        values: &mut [i32],
    ) -> Result<(), CallError> {
        self.booleans.clear();
        self.booleans.resize(list.len(), 0);
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.get_boolean(references, &mut self.booleans)?;
        for ((value, boolean), reference) in values.iter_mut().zip(&self.booleans).zip(list) {
            *value = i32::from((*boolean != 0) != self.is_negated(*reference));
        }
        Ok(())
    }

    pub(crate) fn set_boolean(&mut self, list: &[u32], values: &[i32]) -> Result<(), CallError> {
        if !self.accepts(ValueType::Boolean, list) {
            return Ok(());
        }
        self.booleans.clear();
        for (value, reference) in values.iter().zip(list) {
            let boolean = (*value != 0) != self.is_negated(*reference);
            self.booleans.push(c_char::from(boolean));
        }
        let references = references_in_fmu(&self.negated, list, &mut self.references);
        self.component.set_boolean(references, &self.booleans)
    }

    pub(crate) fn set_string(&mut self, list: &[u32], values: &[String]) -> Result<(), CallError> {
        if !self.accepts(ValueType::String, list) {
            return Ok(());
        }
        self.component.set_string(list, values)
    }

    // FMI 1.0 has no modes in model exchange: `fmiEventUpdate` handles a whole event.
    pub(crate) fn completed_integrator_step(
        &mut self,
        _never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        self.component.completed_integrator_step()
    }

    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "as in the later versions")]
    pub(crate) fn enter_event_mode(&mut self) -> Result<(), CallError> {
        Ok(())
    }

    /// Calls `fmiEventUpdate`. The first call after `fmiInitialize` instead returns the result of `fmiInitialize`,
    /// unless a value has been set since or the FMU needs another iteration.
    pub(crate) fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        match self.initialized.take() {
            Some(info) if !info.discrete_states_need_update => Ok(info),
            _ => self.component.event_update(),
        }
    }

    #[expect(clippy::unnecessary_wraps, clippy::unused_self, reason = "as in the later versions")]
    pub(crate) fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        Ok(())
    }
}

/// Converts a value to an Integer of the FMU, with the opposite sign if `negated`; an error beyond 32 bits.
fn integer_for_fmu(value: i64, negated: bool) -> Result<c_int, CallError> {
    // The smallest i64 has no opposite and is beyond 32 bits in any case.
    let value = if negated { value.wrapping_neg() } else { value };
    narrow("fmiSetInteger", value)
}

#[cfg(test)]
mod tests {
    use fmu_description::ScalarVariable;

    use super::*;

    #[test]
    fn negated_aliases_have_value_references_of_their_own_unless_they_are_strings() {
        let variable = |name: &str, kind, value_reference, negated| ScalarVariable {
            name: String::from(name),
            kind,
            value_reference,
            negated,
            ..ScalarVariable::default()
        };
        let variables = vec![
            variable("on", Kind::Boolean(None), 7, false),
            variable("off", Kind::Boolean(None), 7, true),
            variable("text", Kind::String(None), 8, false),
            variable("same_text", Kind::String(None), 8, true),
        ];
        let mut description = ModelDescription { variables, ..ModelDescription::default() };
        let negated = separate_negated(&mut description);
        assert_eq!(negated, HashMap::from([(u32::MAX, 7)]));
        let references = description.variables.iter().map(|variable| variable.value_reference);
        assert_eq!(references.collect::<Vec<_>>(), [7, u32::MAX, 8, 8]);
        assert!(description.variables[1].negated && !description.variables[3].negated);
        let mut buffer = Vec::new();
        let translated = references_in_fmu(&negated, &[8, u32::MAX], &mut buffer);
        assert_eq!(translated, [8, 7]);
    }

    #[test]
    fn integers_of_negated_aliases_have_the_opposite_sign_within_32_bits() {
        assert_eq!(integer_for_fmu(5, true), Ok(-5));
        assert_eq!(integer_for_fmu(1 << 31, true), Ok(c_int::MIN));
        assert!(integer_for_fmu(1 << 31, false).is_err());
        assert!(integer_for_fmu(i64::MIN, true).is_err());
    }
}
