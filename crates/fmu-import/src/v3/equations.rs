//! The functions of model exchange (FMI 3.0.2, section 3).

use super::Instance;
use slave::{CallError, CompletedStep, Events as _};

impl Instance {
    pub(crate) fn begin_communication_step(&mut self) {
        self.state.clocks.begin_step();
    }

    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        self.state.time = time;
        self.component.set_time(time)
    }

    pub(crate) fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        self.component.completed_integrator_step(never_back)
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        self.leave_event_mode()
    }
}
