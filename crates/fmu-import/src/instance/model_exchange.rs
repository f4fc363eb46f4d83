//! Instances for model exchange.

use std::sync::Arc;

use fmu_description::Version;
use fmu_description::location::file_uri;
use slave::{CallError, CompletedStep, EventInfo, Events as _, ModelExchange};

use super::{Inner, Instance, of_version};
use crate::fmu::{Fmu, FmuError, resource_path, with_tool_hint};
use crate::library::{Interface, check_number, v1, v3};

impl Fmu {
    /// Creates a model-exchange instance called `name`.
    ///
    /// # Errors
    ///
    /// [`FmuError::NoInterface`] without model exchange; [`FmuError::OnlyOnce`] for a forbidden second instance;
    /// [`FmuError::Package`] without a library for this platform; [`FmuError::Load`] if the library does not load, or,
    /// with the FMU's messages, if the FMU does not instantiate; [`FmuError::NeedsTool`] in place of
    /// [`FmuError::Load`] if the FMU declares to need a tool.
    pub fn instantiate_equations(&self, name: &str) -> Result<Box<dyn ModelExchange>, FmuError> {
        let description = self.description();
        let flags = description.model_exchange.as_ref();
        let once = flags.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        let only = once.then(|| self.occupy(name)).transpose()?;
        let inner = match description.version() {
            Version::V1 => Inner::V1(Box::new(self.equations_of_version_1(name)?)),
            Version::V2 => {
                let component = self.component(Interface::ModelExchange, name)?;
                Inner::V2(crate::v2::Instance::new(component))
            }
            Version::V3 => Inner::V3(Box::new(self.equations_of_version_3(name)?)),
        };
        Ok(Box::new(Instance::new(inner, only, self.clone())))
    }

    fn equations_of_version_1(&self, name: &str) -> Result<crate::v1::Instance, FmuError> {
        let (unpacked, description) = (&self.content.unpacked, self.description());
        let Some(flags) = &description.model_exchange else {
            return Err(self.no_interface("ModelExchange"));
        };
        let (identifier, interface) = (&flags.model_identifier, Interface::ModelExchange);
        let hint = |error| with_tool_hint(description, error);
        let library = unpacked.library(identifier)?;
        let library = v1::Library::open(&self.loading(&library), identifier, interface);
        let library = library.map_err(hint)?;
        let (location, names) = (file_uri(unpacked.folder())?, self.names());
        let (library, guid) = (Arc::new(library), &description.guid);
        let component = library.instantiate(interface, name, guid, &location, names);
        Ok(crate::v1::Instance::new(component.map_err(hint)?, description, interface))
    }

    fn equations_of_version_3(&self, name: &str) -> Result<crate::v3::Instance, FmuError> {
        let (unpacked, description) = (&self.content.unpacked, self.description());
        let Some(flags) = &description.model_exchange else {
            return Err(self.no_interface("ModelExchange"));
        };
        let hint = |error| with_tool_hint(description, error);
        let interface = v3::Interface::ModelExchange;
        let library = unpacked.library(&flags.model_identifier)?;
        let library =
            Arc::new(v3::Library::open(&self.loading(&library), interface).map_err(hint)?);
        let resources = resource_path(&unpacked.resources());
        let resources = resources.as_deref();
        crate::v3::Instance::new(&library, description, interface, name, resources).map_err(hint)
    }
}

/// Returns the number in an attribute of the description; an error if it is too large for a vector.
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

    fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        of_version!(self.set_time(time), V1.component, V2.component, V3)
    }

    fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        of_version!(self.set_continuous_states(states))
    }

    fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), CallError> {
        of_version!(self.get_continuous_states(states))
    }

    fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), CallError> {
        of_version!(self.get_derivatives(derivatives))
    }

    fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Result<(), CallError> {
        of_version!(self.get_event_indicators(indicators))
    }

    fn get_nominals_of_continuous_states(&mut self, nominals: &mut [f64]) -> Result<(), CallError> {
        of_version!(self.get_nominals(nominals))
    }

    fn completed_integrator_step(&mut self, never_back: bool) -> Result<CompletedStep, CallError> {
        of_version!(self.completed_integrator_step(never_back), V1, V2.component, V3)
    }

    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        of_version!(self.enter_event_mode(), V1, V2.component, V3)
    }

    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        of_version!(self.update_discrete_states(), V1, V2.component, V3)
    }

    fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        of_version!(self.enter_continuous_time_mode(), V1, V2.component, V3)
    }
}
