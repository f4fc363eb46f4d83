//! The calls of model exchange.

use slave::{CallError, CompletedStep, EventInfo, ModelExchange};

use super::LoggedSlave;

/// The instances whose calls are logged here.
type Equations = dyn ModelExchange;

impl ModelExchange for LoggedSlave<Equations> {
    fn number_of_continuous_states(&mut self) -> Result<usize, CallError> {
        self.slave.number_of_continuous_states()
    }

    fn number_of_event_indicators(&mut self) -> Result<usize, CallError> {
        self.slave.number_of_event_indicators()
    }

    fn needs_completed_integrator_step(&self) -> bool {
        self.slave.needs_completed_integrator_step()
    }

    fn begin_communication_step(&mut self) {
        self.slave.begin_communication_step();
    }

    fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        self.plain("fmi2SetTime", &format!("{time:?}"), |slave| slave.set_time(time))
    }

    fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        let call = |slave: &mut Equations| slave.set_continuous_states(states);
        self.plain("fmi2SetContinuousStates", &format!("{states:?}"), call)
    }

    fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), CallError> {
        self.read("fmi2GetContinuousStates", "", states, Equations::get_continuous_states)
    }

    fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), CallError> {
        self.read("fmi2GetDerivatives", "", derivatives, Equations::get_derivatives)
    }

    fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Result<(), CallError> {
        self.read("fmi2GetEventIndicators", "", indicators, Equations::get_event_indicators)
    }

    fn get_nominals_of_continuous_states(&mut self, nominals: &mut [f64]) -> Result<(), CallError> {
        self.read("fmi2GetNominalsOfContinuousStates", "", nominals, |slave, to| {
            slave.get_nominals_of_continuous_states(to)
        })
    }

    fn completed_integrator_step(&mut self, never_back: bool) -> Result<CompletedStep, CallError> {
        let call = |slave: &mut Equations| slave.completed_integrator_step(never_back);
        self.call("fmi2CompletedIntegratorStep", &never_back.to_string(), call, |done| {
            let CompletedStep { enter_event_mode, terminate_simulation } = done;
            format!(
                " enterEventMode {enter_event_mode}, terminateSimulation {terminate_simulation}"
            )
        })
    }

    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        self.change_mode("fmi2EnterEventMode", Equations::enter_event_mode)
    }

    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        let call = |slave: &mut Equations| slave.update_discrete_states();
        let results = |info: &EventInfo| format!(" {info:?}");
        self.call("fmi2NewDiscreteStates", "", call, results)
    }

    fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        self.change_mode("fmi2EnterContinuousTimeMode", Equations::enter_continuous_time_mode)
    }
}
