//! FMUs of FMI 1.0 for co-simulation (stand-alone) and for model exchange as slaves.
//!
//! FMI 1.0 has no initialization mode: `fmiInitializeSlave` or `fmiInitialize` is called when the master enters it. Values
//! set before are start values; afterwards inputs can be set, and parameters are fixed.

mod equations;

use std::collections::{HashMap, HashSet};
use std::ffi::{c_char, c_int};

use fmu_description::{Causality, Experiment, ModelDescription};

use crate::library::Interface;
use crate::library::v1::Component;
use crate::v2::narrow;
use slave::{CallError, EventInfo, ValueType};

/// An instance of an FMU of FMI 1.0 in this process.
pub(crate) struct Instance {
    pub(crate) component: Component,
    experiment: Experiment,
    /// Whether the master is in initialization mode: the FMU is initialised already, and only inputs can be set.
    in_initialization_mode: bool,
    /// The inputs: type and value reference.
    inputs: HashSet<(ValueType, u32)>,
    /// Value references of variables whose sign differs from that of their FMU's value reference
    /// (`negatedAlias`): that of the description, that of the FMU.
    negated: HashMap<u32, u32>,
    references: Vec<u32>,
    reals: Vec<f64>,
    /// The description, in which negated aliases have value references of their own.
    description: ModelDescription,
    integers: Vec<c_int>,
    booleans: Vec<c_char>,
    /// For model exchange: the result of `fmiInitialize`, until a value is set or the event is updated.
    initialized: Option<EventInfo>,
    interface: Interface,
}

/// Returns the description of an instance, in which negated aliases have value references of their own.
#[cfg(target_os = "linux")]
pub(crate) fn scalar_description(description: &ModelDescription) -> ModelDescription {
    let mut scalars = description.clone();
    separate_negated(&mut scalars);
    scalars
}

/// Gives the negated aliases of `description` value references that no variable has; returns each with
/// that of the FMU.
fn separate_negated(description: &mut ModelDescription) -> HashMap<u32, u32> {
    let used: HashSet<u32> =
        description.variables.iter().map(|variable| variable.value_reference).collect();
    let mut free = (0..=u32::MAX).rev().filter(|reference| !used.contains(reference));
    let mut negated = HashMap::new();
    for variable in description.variables.iter_mut().filter(|variable| variable.negated) {
        if let Some(reference) = free.next() {
            negated.insert(reference, variable.value_reference);
            variable.value_reference = reference;
        }
    }
    negated
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
            references: Vec::new(),
            reals: Vec::new(),
            description,
            integers: Vec::new(),
            booleans: Vec::new(),
            initialized: None,
            interface,
        }
    }

    /// Whether the FMU takes the values: in initialization mode only if all of them are values of inputs.
    /// The master repeats settings there; the FMU has them already.
    fn takes(&mut self, kind: ValueType, references: &[u32]) -> bool {
        self.initialized = None;
        !self.in_initialization_mode
            || references.iter().all(|reference| self.inputs.contains(&(kind, *reference)))
    }

    pub(crate) fn setup_experiment(&mut self, experiment: &Experiment) {
        self.experiment = *experiment;
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

    pub(crate) fn exit_initialization_mode(&mut self) {
        self.in_initialization_mode = false;
    }

    /// Returns the description, in which negated aliases have value references of their own.
    pub(crate) fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Stores the value references of the FMU for a list, if they differ.
    fn translate(&mut self, list: &[u32]) -> bool {
        if self.negated.is_empty()
            || !list.iter().any(|reference| self.negated.contains_key(reference))
        {
            return false;
        }
        self.references.clear();
        let negated = &self.negated;
        self.references
            .extend(list.iter().map(|reference| negated.get(reference).unwrap_or(reference)));
        true
    }

    pub(crate) fn get_real(&mut self, list: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        if !self.translate(list) {
            return self.component.get_real(list, values);
        }
        self.component.get_real(&self.references, values)?;
        for (value, _) in
            values.iter_mut().zip(list).filter(|(_, reference)| self.is_negated(**reference))
        {
            *value = -*value;
        }
        Ok(())
    }

    fn is_negated(&self, reference: u32) -> bool {
        self.negated.contains_key(&reference)
    }

    pub(crate) fn set_real(&mut self, list: &[u32], values: &[f64]) -> Result<(), CallError> {
        if !self.takes(ValueType::Real, list) {
            return Ok(());
        }
        if !self.translate(list) {
            return self.component.set_real(list, values);
        }
        self.reals.clear();
        for (value, reference) in values.iter().zip(list) {
            self.reals.push(if self.negated.contains_key(reference) { -value } else { *value });
        }
        self.component.set_real(&self.references, &self.reals)
    }

    pub(crate) fn get_integer(
        &mut self,
        references: &[u32],
        values: &mut [i64],
    ) -> Result<(), CallError> {
        self.integers.clear();
        self.integers.resize(references.len(), 0);
        let translated = self.translate(references);
        let list = if translated { &self.references } else { references };
        self.component.get_integer(list, &mut self.integers)?;
        for ((value, integer), reference) in values.iter_mut().zip(&self.integers).zip(references) {
            let integer = i64::from(*integer);
            *value = if translated && self.is_negated(*reference) { -integer } else { integer };
        }
        Ok(())
    }

    pub(crate) fn set_integer(
        &mut self,
        references: &[u32],
        values: &[i64],
    ) -> Result<(), CallError> {
        if !self.takes(ValueType::Integer, references) {
            return Ok(());
        }
        self.integers.clear();
        for (value, reference) in values.iter().zip(references) {
            let value = if self.is_negated(*reference) { -*value } else { *value };
            self.integers.push(narrow("fmiSetInteger", "an Integer of 32 bits", value)?);
        }
        let translated = self.translate(references);
        let list = if translated { &self.references } else { references };
        self.component.set_integer(list, &self.integers)
    }

    pub(crate) fn get_boolean(
        &mut self,
        references: &[u32],
        values: &mut [i32],
    ) -> Result<(), CallError> {
        self.booleans.clear();
        self.booleans.resize(references.len(), 0);
        self.component.get_boolean(references, &mut self.booleans)?;
        for (value, boolean) in values.iter_mut().zip(&self.booleans) {
            *value = i32::from(*boolean != 0);
        }
        Ok(())
    }

    pub(crate) fn set_boolean(
        &mut self,
        references: &[u32],
        values: &[i32],
    ) -> Result<(), CallError> {
        if !self.takes(ValueType::Boolean, references) {
            return Ok(());
        }
        self.booleans.clear();
        self.booleans.extend(values.iter().map(|value| c_char::from(*value != 0)));
        self.component.set_boolean(references, &self.booleans)
    }

    pub(crate) fn set_string(
        &mut self,
        references: &[u32],
        values: &[String],
    ) -> Result<(), CallError> {
        if !self.takes(ValueType::String, references) {
            return Ok(());
        }
        self.component.set_string(references, values)
    }
}
