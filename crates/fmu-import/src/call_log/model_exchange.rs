//! The calls of model exchange.

use slave::{CallError, CompletedStep, EventInfo, ModelExchange};

use super::{LoggedSlave, calls, reads};

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

    calls! {
        fn set_time(time: f64) = "fmi2SetTime", "{time:?}";
        fn set_continuous_states(states: &[f64]) = "fmi2SetContinuousStates", "{states:?}";
    }

    reads! {
        fn get_continuous_states(; f64) = "fmi2GetContinuousStates", "";
        fn get_derivatives(; f64) = "fmi2GetDerivatives", "";
        fn get_event_indicators(; f64) = "fmi2GetEventIndicators", "";
        fn get_nominals_of_continuous_states(; f64) = "fmi2GetNominalsOfContinuousStates", "";
    }

    fn completed_integrator_step(&mut self, never_back: bool) -> Result<CompletedStep, CallError> {
        let call = |slave: &mut Equations| slave.completed_integrator_step(never_back);
        self.call("fmi2CompletedIntegratorStep", format_args!("{never_back}"), call, |done| {
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
        self.call("fmi2NewDiscreteStates", format_args!(""), call, results)
    }

    fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        self.change_mode("fmi2EnterContinuousTimeMode", Equations::enter_continuous_time_mode)
    }
}
