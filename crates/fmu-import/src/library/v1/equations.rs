//! Model exchange: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::function;
use super::super::canary;
use super::Component;
use super::functions;
use slave::{CallError, CompletedStep, EventInfo, absent};

/// Defines a method for each function that fills a vector.
macro_rules! vectors {
    ($($method:ident = $name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $name, "`.")]
            #[inline]
            pub(crate) fn $method(&mut self, values: &mut [f64]) -> Result<(), CallError> {
                let function = function!(self.$method, $name);
                let count = values.len();
                // SAFETY: the instance is alive; a place for each value.
                let call = |array| unsafe { function(self.pointer, array, count) };
                self.check_guarded($name, canary::fill(self.guards, values, call))
            })*
        }
    };
}

vectors! {
    get_continuous_states = "fmiGetContinuousStates";
    get_derivatives = "fmiGetDerivatives";
    get_event_indicators = "fmiGetEventIndicators";
    get_nominals = "fmiGetNominalContinuousStates";
}

impl From<functions::EventInfo> for EventInfo {
    fn from(info: functions::EventInfo) -> Self {
        Self {
            discrete_states_need_update: info.iteration_converged == 0,
            terminate_simulation: info.terminate_simulation != 0,
            // The states are other variables: so are their nominal values.
            nominals_changed: info.state_value_references_changed != 0,
            values_changed: info.state_values_changed != 0,
            next_event_time: (info.upcoming_time_event != 0).then_some(info.next_event_time),
        }
    }
}

impl Component {
    /// Calls `fmiInitialize`.
    pub(crate) fn initialize_model(
        &mut self,
        tolerance: Option<f64>,
    ) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmiInitialize";
        let function = function!(self.initialize_model, NAME);
        let mut info = functions::EventInfo::default();
        let (controlled, tolerance) = (tolerance.is_some().into(), tolerance.unwrap_or(0.0));
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.pointer, controlled, tolerance, &raw mut info) };
        self.check(NAME, status)?;
        Ok(info.into())
    }

    /// Calls `fmiTerminate`.
    pub(super) fn terminate_model(&mut self) -> Result<(), CallError> {
        const NAME: &str = "fmiTerminate";
        let function = function!(self.terminate_model, NAME);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer) };
        self.check(NAME, status)
    }

    /// Calls `fmiSetTime`.
    #[inline]
    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        const NAME: &str = "fmiSetTime";
        let function = function!(self.set_time, NAME);
        self.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer, time) };
        self.check(NAME, status)
    }

    /// Calls `fmiSetContinuousStates`.
    #[inline]
    pub(crate) fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        const NAME: &str = "fmiSetContinuousStates";
        let function = function!(self.set_continuous_states, NAME);
        // SAFETY: the instance is alive; `states.len()` values.
        let call = |array| unsafe { function(self.pointer, array, states.len()) };
        self.check_guarded(NAME, canary::send(self.guards, states, call))
    }

    /// Calls `fmiCompletedIntegratorStep`.
    #[inline]
    pub(crate) fn completed_integrator_step(&mut self) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmiCompletedIntegratorStep";
        let function = function!(self.completed_integrator_step, NAME);
        let mut event = 0;
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.pointer, &raw mut event) };
        self.check(NAME, status)?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: false })
    }

    /// Calls `fmiEventUpdate`, which iterates until nothing changes any more.
    pub(crate) fn event_update(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmiEventUpdate";
        let function = function!(self.event_update, NAME);
        let mut info = functions::EventInfo::default();
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.pointer, 0, &raw mut info) };
        self.check(NAME, status)?;
        Ok(info.into())
    }
}
