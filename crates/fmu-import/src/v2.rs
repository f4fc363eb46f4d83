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

/// Converts an integer to the type of the FMU. The error of `function` describes this type by `expected`.
pub(crate) fn narrow<T: TryFrom<i64>>(
    function: &'static str,
    expected: &str,
    value: i64,
) -> Result<T, CallError> {
    T::try_from(value).map_err(|_| {
        refused(function, format!("cannot take the value {value}, expected {expected}"))
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
            self.integers.push(narrow("fmi2SetInteger", "an Integer of 32 bits", *value)?);
        }
        self.component.set_integer(references, &self.integers)
    }
}
