//! Implements [`ModelExchange`] for every version of FMI.

use slave::{CallError, CompletedStep, EventInfo, Events as _, ModelExchange};

use super::{Inner, Instance, methods, of_version};
use crate::library::check_number;

/// Converts a number that the description states in `attribute`; an error if it is too large for a vector.
fn stated_number(attribute: &'static str, count: u32) -> Result<usize, CallError> {
    let error = |failure| CallError { function: attribute, failure, messages: Vec::new() };
    check_number(count as usize).map_err(error)
}

impl ModelExchange for Instance {
    fn number_of_continuous_states(&mut self) -> Result<usize, CallError> {
        match &mut self.inner {
            Inner::V1(instance) => {
                let flags = instance.description().model_exchange.as_ref();
                let count = flags.map_or(0, |flags| flags.number_of_continuous_states);
                stated_number("numberOfContinuousStates", count)
            }
            Inner::V3(instance) => instance.component.get_number_of_states(),
            Inner::V2(_) => Ok(self.fmu().description().structure.derivatives.len()),
        }
    }

    fn number_of_event_indicators(&mut self) -> Result<usize, CallError> {
        if let Inner::V3(instance) = &mut self.inner {
            return instance.component.get_number_of_indicators();
        }
        let count = self.fmu().description().number_of_event_indicators.unwrap_or(0);
        stated_number("numberOfEventIndicators", count)
    }

    fn begin_communication_step(&mut self) {
        if let Inner::V3(instance) = &mut self.inner {
            instance.begin_communication_step();
        }
    }

    fn needs_completed_integrator_step(&self) -> bool {
        let flags = self.fmu().description().model_exchange.as_ref();
        flags.is_none_or(|flags| !flags.completed_integrator_step_not_needed)
    }

    methods! {
        fn set_time(time: f64) -> () = [V1.component, V2.component, V3];
        fn set_continuous_states(states: &[f64]) -> () = [V1.component, V2.component, V3.component];
        fn get_continuous_states(states: &mut [f64]) -> () =
            [V1.component, V2.component, V3.component];
        fn get_derivatives(derivatives: &mut [f64]) -> () =
            [V1.component, V2.component, V3.component];
        fn get_event_indicators(indicators: &mut [f64]) -> () =
            [V1.component, V2.component, V3.component];
        fn get_nominals_of_continuous_states(nominals: &mut [f64]) -> () =
            [V1.component, V2.component, V3.component];
        fn completed_integrator_step(never_back: bool) -> CompletedStep =
            [V1, V2.component, V3.component];
        fn enter_event_mode() -> () = [V1, V2.component, V3];
        fn update_discrete_states() -> EventInfo = [V1, V2.component, V3];
        fn enter_continuous_time_mode() -> () = [V1, V2.component, V3];
    }
}
