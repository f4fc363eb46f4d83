//! FMUs of FMI 2.0 for co-simulation and for model exchange as slaves.

use crate::error::refused;
use crate::library::Component;
use slave::CallError;

/// An instance of an FMU of FMI 2.0 in this process.
pub(crate) struct Instance {
    pub(crate) component: Component,
    /// Buffer for Integers.
    integers: Vec<i32>,
}

/// Converts an integer to the type of the FMU; an error of `function` beyond 32 bits.
pub(crate) fn narrow(function: &'static str, value: i64) -> Result<i32, CallError> {
    i32::try_from(value).map_err(|_| {
        let what = format!("cannot take the value {value}, expected an Integer of 32 bits");
        refused(function, what)
    })
}

impl Instance {
    pub(crate) fn new(component: Component) -> Self {
        Self { component, integers: Vec::new() }
    }

    pub(crate) fn get_integer(
        &mut self,
        references: &[u32],
        values: &mut [i64],
    ) -> Result<(), CallError> {
        self.integers.clear();
        self.integers.resize(references.len(), 0);
        self.component.get_integer(references, &mut self.integers)?;
        for (value, integer) in values.iter_mut().zip(&self.integers) {
            *value = (*integer).into();
        }
        Ok(())
    }

    pub(crate) fn set_integer(
        &mut self,
        references: &[u32],
        values: &[i64],
    ) -> Result<(), CallError> {
        self.integers.clear();
        for value in values {
            self.integers.push(narrow("fmi2SetInteger", *value)?);
        }
        self.component.set_integer(references, &self.integers)
    }
}
