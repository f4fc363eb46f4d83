//! The functions of model exchange (FMI 3.0.2, section 3).

use super::Instance;
use super::mode::Mode;
use slave::{CallError, CompletedStep};

impl Instance {
    pub(crate) fn number_of_continuous_states(&mut self) -> Result<usize, CallError> {
        self.component.get_number_of_states()
    }

    pub(crate) fn number_of_event_indicators(&mut self) -> Result<usize, CallError> {
        self.component.get_number_of_indicators()
    }

    pub(crate) fn begin_communication_step(&mut self) {
        self.state.clocks.begin_step();
    }

    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        self.state.time = time;
        self.component.set_time(time)
    }

    pub(crate) fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        self.component.set_continuous_states(states)
    }

    pub(crate) fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), CallError> {
        self.component.get_continuous_states(states)
    }

    pub(crate) fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), CallError> {
        self.component.get_derivatives(derivatives)
    }

    pub(crate) fn get_event_indicators(&mut self, values: &mut [f64]) -> Result<(), CallError> {
        self.component.get_event_indicators(values)
    }

    pub(crate) fn get_nominals(&mut self, nominals: &mut [f64]) -> Result<(), CallError> {
        self.component.get_nominals(nominals)
    }

    pub(crate) fn completed_integrator_step(
        &mut self,
        never_back: bool,
    ) -> Result<CompletedStep, CallError> {
        self.component.completed_integrator_step(never_back)
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        self.state.clocks.end_event();
        self.component.enter_continuous_time_mode()?;
        self.state.mode = Mode::Step;
        Ok(())
    }
}
