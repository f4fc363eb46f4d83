//! Instances for model exchange.

use std::sync::atomic::Ordering;

use slave::{CallError, CompletedStep, EventInfo, ModelExchange};

use super::{Fmu, FmuError};
use crate::instance::{Inner, Instance};
use crate::library::Interface;

impl Fmu {
    /// Creates a model-exchange instance called `name`.
    ///
    /// # Errors
    ///
    /// [`FmuError::OnlyOnce`] for a forbidden second instance; [`LoadError::Instantiate`] with the
    /// FMU's messages if `fmi2Instantiate` fails; [`FmuError::NoInterface`] without model exchange.
    pub fn instantiate_equations(&self, name: &str) -> Result<Box<dyn ModelExchange>, FmuError> {
        let description = self.description();
        let once = description.model_exchange.as_ref();
        let once = once.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        if once && self.content.instantiated.swap(true, Ordering::Relaxed) {
            let (instance, model) = (name.to_owned(), description.model_name.clone());
            return Err(FmuError::OnlyOnce { instance, model });
        }
        let component = self.component(Interface::ModelExchange, name)?;
        Ok(Box::new(Instance::new(Inner::V2(crate::v2::Instance::new(component)), self.clone())))
    }
}

impl ModelExchange for Instance {
    fn needs_completed_integrator_step(&self) -> bool {
        let flags = self.fmu().description().model_exchange.as_ref();
        flags.is_none_or(|flags| !flags.completed_integrator_step_not_needed)
    }

    fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        self.equations()?.set_time(time)
    }

    fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        self.equations()?.set_continuous_states(states)
    }

    fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), CallError> {
        self.equations()?.get_continuous_states(states)
    }

    fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), CallError> {
        self.equations()?.get_derivatives(derivatives)
    }

    fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Result<(), CallError> {
        self.equations()?.get_event_indicators(indicators)
    }

    fn get_nominals_of_continuous_states(&mut self, nominals: &mut [f64]) -> Result<(), CallError> {
        self.equations()?.get_nominals(nominals)
    }

    fn completed_integrator_step(&mut self, never_back: bool) -> Result<CompletedStep, CallError> {
        self.equations()?.completed_integrator_step(never_back)
    }

    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        self.equations()?.enter_event_mode()
    }

    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        let info = self.equations()?.new_discrete_states()?;
        Ok(EventInfo {
            discrete_states_need_update: info.new_discrete_states_needed != 0,
            terminate_simulation: info.terminate_simulation != 0,
            nominals_changed: info.nominals_of_continuous_states_changed != 0,
            values_changed: info.values_of_continuous_states_changed != 0,
            next_event_time: (info.next_event_time_defined != 0).then_some(info.next_event_time),
        })
    }

    fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        self.equations()?.enter_continuous_time_mode()
    }
}
