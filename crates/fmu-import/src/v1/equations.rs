//! The functions of model exchange (FMI 1.0 for model exchange, section 3). FMI 1.0 has no modes: `fmiEventUpdate` is
//! an event as a whole.

use super::Instance;
use slave::{CallError, CompletedStep, EventInfo};

impl Instance {
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

    /// Calls `fmiEventUpdate`. The first call after `fmiInitialize` returns the result of that function instead, unless
    /// a value has been set since or the FMU needs another iteration.
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
