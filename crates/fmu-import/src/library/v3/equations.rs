//! Model exchange: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::{equations, function};
use super::super::canary;
use super::Component;
use slave::{CallError, CompletedStep, absent};

equations! {
    pub(crate) fn set_time = "fmi3SetTime";
    pub(crate) fn set_continuous_states = "fmi3SetContinuousStates";
    pub(crate) fn get_continuous_states = "fmi3GetContinuousStates";
    pub(crate) fn get_derivatives = "fmi3GetContinuousStateDerivatives";
    pub(crate) fn get_event_indicators = "fmi3GetEventIndicators";
    pub(crate) fn get_nominals = "fmi3GetNominalsOfContinuousStates";
}

/// Defines a method for each function that returns a number of values.
macro_rules! numbers {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $name, "`.")]
            pub(crate) fn $method(&mut self) -> Result<usize, CallError> {
                let function = function!(self.$method, $name);
                self.base.log_call($name, String::new);
                let mut count = 0;
                // SAFETY: the instance is alive; one place for the number.
                let status = unsafe { function(self.base.pointer, &raw mut count) };
                self.base.check_results($name, status, || format!(" {count}"))?;
                canary::check_number(count).map_err(|failure| self.base.failed($name, failure))
            })*
        }
    };
}

numbers! {
    get_number_of_states = "fmi3GetNumberOfContinuousStates";
    get_number_of_indicators = "fmi3GetNumberOfEventIndicators";
}

impl Component {
    /// Calls `fmi3CompletedIntegratorStep`.
    #[inline]
    pub(crate) fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmi3CompletedIntegratorStep";
        let function = function!(self.completed_integrator_step, NAME);
        self.base.log_call(NAME, || never_back.to_string());
        let [mut event, mut terminate] = [0_u8; 2];
        // SAFETY: the instance is alive; one place for each result.
        let status =
            unsafe { function(self.base.pointer, never_back, &raw mut event, &raw mut terminate) };
        self.base.check_results(NAME, status, || {
            format!(" enterEventMode {event}, terminateSimulation {terminate}")
        })?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: terminate != 0 })
    }
}
