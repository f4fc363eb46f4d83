//! What can be asked of an instance, one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use fmi2::abi::{fmi2Boolean, fmi2EventInfo};

use super::functions::{CoSimulation, Directional, ModelExchange, Snapshot};
use super::{Component, Library, c_string};
use crate::slave::CallError;

/// Defines a method for each function of a table: its arguments, and the C arguments made of them.
macro_rules! calls {
    (|$library:ident, $function:ident| $table:expr; $($method:ident(
        $($argument:ident: $type:ty),*) = $name:literal($($c:expr),*);)*
    ) => {
        impl Component {
            $(pub(crate) fn $method(&mut self, $($argument: $type),*) -> Result<(), CallError> {
                let ($library, $function) = (&*self.library, $name);
                // SAFETY: the instance is alive; slices that belong together are equally long.
                let status = unsafe { ($table.$method)(self.pointer, $($c),*) };
                self.check($function, status)
            })*
        }
    };
}

calls! {
    |library, _function| library.common;
    enter_initialization_mode() = "fmi2EnterInitializationMode"();
    exit_initialization_mode() = "fmi2ExitInitializationMode"();
    terminate() = "fmi2Terminate"();
    get_real(references: &[u32], values: &mut [f64]) =
        "fmi2GetReal"(references.as_ptr(), same_length(references, values), values.as_mut_ptr());
    set_real(references: &[u32], values: &[f64]) =
        "fmi2SetReal"(references.as_ptr(), same_length(references, values), values.as_ptr());
    get_integer(references: &[u32], values: &mut [i32]) =
        "fmi2GetInteger"(references.as_ptr(), same_length(references, values), values.as_mut_ptr());
    set_integer(references: &[u32], values: &[i32]) =
        "fmi2SetInteger"(references.as_ptr(), same_length(references, values), values.as_ptr());
    get_boolean(references: &[u32], values: &mut [i32]) =
        "fmi2GetBoolean"(references.as_ptr(), same_length(references, values), values.as_mut_ptr());
    set_boolean(references: &[u32], values: &[i32]) =
        "fmi2SetBoolean"(references.as_ptr(), same_length(references, values), values.as_ptr());
}

calls! {
    |library, function| library.simulation(function)?;
    do_step(time: f64, size: f64, never_back: fmi2Boolean) =
        "fmi2DoStep"(time, size, never_back);
}

calls! {
    |library, function| library.exchange(function)?;
    enter_event_mode() = "fmi2EnterEventMode"();
    enter_continuous_time_mode() = "fmi2EnterContinuousTimeMode"();
    set_continuous_states(values: &[f64]) =
        "fmi2SetContinuousStates"(values.as_ptr(), values.len());
    get_continuous_states(values: &mut [f64]) =
        "fmi2GetContinuousStates"(values.as_mut_ptr(), values.len());
    get_derivatives(values: &mut [f64]) =
        "fmi2GetDerivatives"(values.as_mut_ptr(), values.len());
    get_nominals(values: &mut [f64]) =
        "fmi2GetNominalsOfContinuousStates"(values.as_mut_ptr(), values.len());
}

/// The length that both slices have.
fn same_length<A, B>(references: &[A], values: &[B]) -> usize {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    references.len()
}

fn absent(function: &'static str) -> CallError {
    let messages = vec!["the library does not have this function".to_owned()];
    CallError { function, status: None, messages }
}

impl Library {
    fn simulation(&self, function: &'static str) -> Result<&CoSimulation, CallError> {
        self.simulation.as_ref().ok_or_else(|| absent(function))
    }

    fn exchange(&self, function: &'static str) -> Result<&ModelExchange, CallError> {
        self.exchange.as_ref().ok_or_else(|| absent(function))
    }

    fn snapshot(&self, function: &'static str) -> Result<&Snapshot, CallError> {
        self.snapshot.as_ref().ok_or_else(|| absent(function))
    }

    fn directional(&self, function: &'static str) -> Result<&Directional, CallError> {
        self.directional.as_ref().ok_or_else(|| absent(function))
    }
}

impl Component {
    /// `fmi2SetupExperiment`.
    pub(crate) fn setup_experiment(&mut self, e: &fmi2::Experiment) -> Result<(), CallError> {
        let (tolerance, stop) = (e.tolerance.unwrap_or(0.0), e.stop_time.unwrap_or(0.0));
        let (has_tolerance, has_stop) =
            (fmi2Boolean::from(e.tolerance.is_some()), fmi2Boolean::from(e.stop_time.is_some()));
        // SAFETY: the instance is alive.
        let status = unsafe {
            (self.library.common.setup_experiment)(
                self.pointer,
                has_tolerance,
                tolerance,
                e.start_time,
                has_stop,
                stop,
            )
        };
        self.check("fmi2SetupExperiment", status)
    }

    /// `fmi2SetString` of one variable.
    pub(crate) fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError> {
        let value = c_string(value);
        // SAFETY: the instance is alive; one reference, one terminated string.
        let status = unsafe {
            let pointer = value.as_ptr();
            (self.library.common.set_string)(
                self.pointer,
                &raw const reference,
                1,
                &raw const pointer,
            )
        };
        self.check("fmi2SetString", status)
    }

    /// `fmi2SetRealInputDerivatives` of first order.
    pub(crate) fn set_input_slopes(&mut self, to: &[u32], slopes: &[f64]) -> Result<(), CallError> {
        self.ones.resize(self.ones.len().max(same_length(to, slopes)), 1);
        let name = "fmi2SetRealInputDerivatives";
        let function = self.library.simulation(name)?.set_real_input_derivatives;
        // SAFETY: the instance is alive; the arrays have `to.len()` elements.
        let status = unsafe {
            function(self.pointer, to.as_ptr(), to.len(), self.ones.as_ptr(), slopes.as_ptr())
        };
        self.check(name, status)
    }

    /// `fmi2GetRealOutputDerivatives` of first order.
    pub(crate) fn get_output_slopes(
        &mut self,
        from: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), CallError> {
        self.ones.resize(self.ones.len().max(same_length(from, slopes)), 1);
        let name = "fmi2GetRealOutputDerivatives";
        let function = self.library.simulation(name)?.get_real_output_derivatives;
        // SAFETY: the instance is alive; the arrays have `from.len()` elements.
        let status = unsafe {
            function(
                self.pointer,
                from.as_ptr(),
                from.len(),
                self.ones.as_ptr(),
                slopes.as_mut_ptr(),
            )
        };
        self.check(name, status)
    }

    /// `fmi2NewDiscreteStates`.
    pub(crate) fn new_discrete_states(&mut self) -> Result<fmi2EventInfo, CallError> {
        let name = "fmi2NewDiscreteStates";
        let mut info = fmi2EventInfo::default();
        let function = self.library.exchange(name)?.new_discrete_states;
        // SAFETY: the instance is alive; one structure to write to.
        let status = unsafe { function(self.pointer, &raw mut info) };
        self.check(name, status)?;
        Ok(info)
    }

    /// `fmi2GetFMUstate`: keeps the state of now, in place of the one kept before.
    pub(crate) fn save(&mut self) -> Result<(), CallError> {
        let name = "fmi2GetFMUstate";
        let function = self.library.snapshot(name)?.get;
        // SAFETY: the instance is alive; the state is null or its own.
        let status = unsafe { function(self.pointer, &raw mut self.saved) };
        self.check(name, status)
    }

    /// `fmi2SetFMUstate`: back to the state that [`Component::save`] keeps.
    pub(crate) fn restore(&mut self) -> Result<(), CallError> {
        let name = "fmi2SetFMUstate";
        assert!(!self.saved.is_null(), "a state is kept");
        let function = self.library.snapshot(name)?.set;
        // SAFETY: the instance is alive; the state is its own.
        let status = unsafe { function(self.pointer, self.saved) };
        self.check(name, status)
    }

    /// `fmi2GetDirectionalDerivative` with respect to one known, for a change of one.
    pub(crate) fn derivative(
        &mut self,
        unknowns: &[u32],
        known: u32,
        values: &mut [f64],
    ) -> Result<(), CallError> {
        let name = "fmi2GetDirectionalDerivative";
        let function = self.library.directional(name)?.get_directional_derivative;
        let (length, change) = (same_length(unknowns, values), 1.0);
        // SAFETY: the instance is alive; `length` unknowns and values, one known and its change.
        let status = unsafe {
            function(
                self.pointer,
                unknowns.as_ptr(),
                length,
                &raw const known,
                1,
                &raw const change,
                values.as_mut_ptr(),
            )
        };
        self.check(name, status)
    }
}
