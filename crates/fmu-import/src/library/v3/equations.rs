//! Model exchange: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::function;
use super::super::canary;
use super::Component;
use slave::{CallError, CompletedStep, absent};

/// Defines a method for each function that fills a vector.
macro_rules! vectors {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $name, "`.")]
            #[inline]
            pub(crate) fn $method(&mut self, values: &mut [f64]) -> Result<(), CallError> {
                let function = function!(self.$method, $name);
                self.log_call($name, String::new);
                let count = values.len();
                // SAFETY: the instance is alive; a place for each value.
                let call = |array| unsafe { function(self.pointer, array, count) };
                let done = canary::fill(self.guards, values, call);
                self.check_guarded($name, done, || format!(" {values:?}"))
            })*
        }
    };
}

vectors! {
    get_continuous_states = "fmi3GetContinuousStates";
    get_derivatives = "fmi3GetContinuousStateDerivatives";
    get_event_indicators = "fmi3GetEventIndicators";
    get_nominals = "fmi3GetNominalsOfContinuousStates";
}

/// Defines a method for each function that returns a number of values.
macro_rules! numbers {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $name, "`.")]
            pub(crate) fn $method(&mut self) -> Result<usize, CallError> {
                let function = function!(self.$method, $name);
                self.log_call($name, String::new);
                let mut count = 0;
                // SAFETY: the instance is alive; one place for the number.
                let status = unsafe { function(self.pointer, &raw mut count) };
                self.check_results($name, status, || format!(" {count}"))?;
                canary::check_number(count).map_err(|failure| self.failed($name, failure))
            })*
        }
    };
}

numbers! {
    get_number_of_states = "fmi3GetNumberOfContinuousStates";
    get_number_of_indicators = "fmi3GetNumberOfEventIndicators";
}

impl Component {
    /// Calls `fmi3SetTime`.
    #[inline]
    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetTime";
        let function = function!(self.set_time, NAME);
        self.log_call(NAME, || format!("{time:?}"));
        self.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer, time) };
        self.check(NAME, status)
    }

    /// Calls `fmi3SetContinuousStates`.
    #[inline]
    pub(crate) fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetContinuousStates";
        let function = function!(self.set_continuous_states, NAME);
        self.log_call(NAME, || format!("{states:?}"));
        // SAFETY: the instance is alive; `states.len()` values.
        let call = |array| unsafe { function(self.pointer, array, states.len()) };
        self.check_guarded(NAME, canary::send(self.guards, states, call), String::new)
    }

    /// Calls `fmi3CompletedIntegratorStep`.
    #[inline]
    pub(crate) fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmi3CompletedIntegratorStep";
        let function = function!(self.completed_integrator_step, NAME);
        self.log_call(NAME, || never_back.to_string());
        let [mut event, mut terminate] = [0_u8; 2];
        // SAFETY: the instance is alive; one place for each result.
        let status =
            unsafe { function(self.pointer, never_back, &raw mut event, &raw mut terminate) };
        self.check_results(NAME, status, || {
            format!(" enterEventMode {event}, terminateSimulation {terminate}")
        })?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: terminate != 0 })
    }
}
