//! Model exchange: one method for each function of the standard.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::{equations, function};
use super::super::canary;
use super::Component;
use super::functions;
use slave::{CallError, CompletedStep, EventInfo, absent};

equations! {
    pub(crate) fn set_time = "fmiSetTime";
    pub(crate) fn set_continuous_states = "fmiSetContinuousStates";
    pub(crate) fn get_continuous_states = "fmiGetContinuousStates";
    pub(crate) fn get_derivatives = "fmiGetDerivatives";
    pub(crate) fn get_event_indicators = "fmiGetEventIndicators";
    pub(crate) fn get_nominals = "fmiGetNominalContinuousStates";
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
        let status = unsafe { function(self.base.pointer, controlled, tolerance, &raw mut info) };
        self.base.check(NAME, status)?;
        Ok(info.into())
    }

    /// Calls `fmiCompletedIntegratorStep`.
    #[inline]
    pub(crate) fn completed_integrator_step(&mut self) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmiCompletedIntegratorStep";
        let function = function!(self.completed_integrator_step, NAME);
        let mut event = 0;
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.base.pointer, &raw mut event) };
        self.base.check(NAME, status)?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: false })
    }

    /// Calls `fmiEventUpdate`, which iterates until nothing changes any more.
    pub(crate) fn event_update(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmiEventUpdate";
        let function = function!(self.event_update, NAME);
        let mut info = functions::EventInfo::default();
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.base.pointer, 0, &raw mut info) };
        self.base.check(NAME, status)?;
        Ok(info.into())
    }
}
