//! The functions of FMI 3.0 that differ from the functions of FMI 2.0.

mod clocks;
mod configuration;
mod derivatives;
mod intermediate;
mod step;
mod values;

use crate::interface::new_model;
use std::path::Path;

use super::{Instance, check_guid};
use crate::callbacks::{Callbacks, IntermediateUpdate};
use crate::interface::fmi3::{Dependency, Table};
use crate::model::{Event, Failure, Model};
use fmu_description::call_order::{InterfaceType, State};
use fmu_description::{ModelDescription, NativeType};

pub(crate) use derivatives::Jacobian;
use intermediate::Intermediate;

/// The largest number of scalars in one call whose places ([`Table`]) are on the stack.
const MOST_ON_STACK: usize = 8;

/// The part of an instance that only FMI 3.0 has.
pub(crate) struct Session {
    table: Table,
    event_mode_used: bool,
    early_return_allowed: bool,
    intermediate: Option<Box<Intermediate>>,
    /// The places ([`Table`]) of the variables of the present call.
    places: Vec<u32>,
    /// Orders of the output derivatives of the present call.
    integers: Vec<i32>,
    /// The event indicators.
    indicators: Vec<f64>,
    /// The structural parameters with which the variables were laid out.
    structural: Vec<u64>,
    /// The values returned by the last `fmi3GetBinary`, which must stay valid until the next call.
    binaries: Vec<Vec<u8>>,
}

/// The arguments of `fmi3InstantiateXXX` that the model needs.
pub(crate) struct Instantiation<'a> {
    pub(crate) interface_type: InterfaceType,
    pub(crate) token: &'a str,
    pub(crate) resources: &'a Path,
    pub(crate) logging_on: bool,
    pub(crate) event_mode_used: bool,
    pub(crate) early_return_allowed: bool,
    pub(crate) intermediate: Option<IntermediateUpdate>,
    /// The variables that the importer intends to access in intermediate update mode.
    pub(crate) required: &'a [u32],
}

impl<M: Model> Instance<M> {
    /// `fmi3InstantiateModelExchange`, `fmi3InstantiateCoSimulation`: reads the resources and checks the arguments.
    pub(crate) fn new_3(
        arguments: &Instantiation<'_>,
        callbacks: Callbacks,
    ) -> Result<Self, Failure> {
        let (mut instance, _) = Self::build(
            || new_model::<M>(arguments.resources),
            callbacks,
            |interface, description| {
                let (table, converted) =
                    interface.convert(description, arguments.interface_type)?;
                if !interface.offers_exchange() {
                    if arguments.interface_type == InterfaceType::ModelExchange {
                        return Err(Failure::Error(
                            "this FMU offers co-simulation only".to_owned(),
                        ));
                    }
                    if arguments.event_mode_used {
                        let message =
                            "eventModeUsed is true, but hasEventMode of this FMU is false";
                        return Err(Failure::Error(message.to_owned()));
                    }
                }
                check_guid::<M>(
                    interface.guid,
                    "instantiationToken",
                    arguments.token,
                    arguments.resources,
                )?;
                check_required(arguments.required, &converted)?;
                let indicators = vec![0.0; interface.event_indicators.unwrap_or_default()];
                let inputs = interface.interpolated.len();
                let intermediate =
                    arguments.intermediate.filter(|_| !arguments.required.is_empty());
                let intermediate =
                    intermediate.map(|update| Box::new(Intermediate::new(update, inputs)));
                Ok(Some(Box::new(Session {
                    table,
                    event_mode_used: arguments.event_mode_used,
                    early_return_allowed: arguments.early_return_allowed,
                    intermediate,
                    places: Vec::new(),
                    integers: Vec::new(),
                    indicators,
                    structural: Vec::new(),
                    binaries: Vec::new(),
                })))
            },
        )?;
        instance.debug_logging = true;
        instance.categories = (!arguments.logging_on).then(Vec::new);
        instance.session_mut()?.structural = instance.structural_parameters();
        instance.lay_out = Some(Self::lay_out);
        Ok(instance.into_type(arguments.interface_type))
    }

    /// Returns the part of FMI 3.0; an error for an instance of FMI 2.0.
    fn session(&self) -> Result<&Session, Failure> {
        self.session.as_deref().ok_or_else(other_version)
    }

    fn session_mut(&mut self) -> Result<&mut Session, Failure> {
        self.session.as_deref_mut().ok_or_else(other_version)
    }

    /// Whether this is co-simulation with event mode.
    pub(super) fn uses_event_mode(&self) -> bool {
        self.session.as_ref().is_some_and(|session| session.event_mode_used)
    }

    /// `fmi3SetDebugLogging`: turns the categories on or off, all of them if `categories` is empty. An error for an
    /// unknown category.
    pub(crate) fn set_debug_logging_3(
        &mut self,
        on: bool,
        categories: &[String],
    ) -> Result<(), Failure> {
        self.check_categories(categories)?;
        let known = &self.interface.log_categories;
        let mut selected = self.categories.take().unwrap_or_else(|| known.clone());
        if categories.is_empty() {
            self.categories = (!on).then(Vec::new);
            return Ok(());
        }
        selected.retain(|name| !categories.contains(name));
        if on {
            selected.extend_from_slice(categories);
        }
        self.categories = Some(selected);
        Ok(())
    }

    /// `fmi3ExitInitializationMode`: leads to event mode if the importer handles events.
    pub(crate) fn exit_initialization_mode_3(&mut self) -> Result<(), Failure> {
        self.exit_initialization_mode()?;
        if self.uses_event_mode() {
            self.core.state = State::EventMode;
        }
        if self.core.state == State::EventMode {
            self.tick();
        }
        Ok(())
    }

    /// `fmi3EnterEventMode`. An error in co-simulation without event mode.
    pub(crate) fn enter_event_mode_3(&mut self) -> Result<(), Failure> {
        if self.core.interface_type == InterfaceType::CoSimulation && !self.uses_event_mode() {
            return Err(Failure::Error("eventModeUsed is false".to_owned()));
        }
        self.enter_event_mode()?;
        self.core.next_event = None;
        self.tick();
        Ok(())
    }

    /// `fmi3UpdateDiscreteStates`: ends the ticks of all clocks; the model may tick them for a further update.
    pub(crate) fn update_discrete_states_3(&mut self) -> Result<Event, Failure> {
        let event = self.update_discrete_states()?;
        self.clear_clocks();
        if event.new_discrete_states_needed {
            self.tick();
        }
        Ok(event)
    }

    /// `fmi3EnterStepMode`.
    pub(crate) fn enter_step_mode(&mut self) -> Result<(), Failure> {
        self.clear_clocks();
        self.refresh()?;
        self.core.state = State::StepComplete;
        Ok(())
    }

    /// `fmi3EnterContinuousTimeMode`.
    pub(crate) fn enter_continuous_time_mode_3(&mut self) {
        self.clear_clocks();
        self.enter_continuous_time_mode();
    }

    /// `fmi3GetNumberOfContinuousStates`.
    pub(crate) fn state_count(&self) -> usize {
        self.interface.states.len()
    }

    /// `fmi3GetNumberOfEventIndicators`.
    pub(crate) fn indicator_count(&self) -> usize {
        self.interface.event_indicators.unwrap_or_default()
    }

    /// `fmi3GetVariableDependencies`: until initialization mode has ended, the dependencies of the initial value.
    pub(crate) fn dependencies(&self, reference: u32) -> Result<Vec<Dependency>, Failure> {
        let initial = matches!(
            self.core.state,
            State::Instantiated | State::ConfigurationMode | State::InitializationMode
        );
        self.session()?.table.dependencies(reference, initial)
    }

    /// Finds the places ([`Table`]) of the elements of variables of one type, in row-major order, and runs `body` with
    /// them. An error for a variable of another type, and if there are not `count` elements.
    pub(crate) fn located(
        &mut self,
        kind: NativeType,
        references: &[u32],
        count: usize,
        body: impl FnOnce(&mut Self, &[u32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let mut on_stack = [0; MOST_ON_STACK];
        if let Some(places) = on_stack.get_mut(..count)
            && self.session()?.table.locate_scalars(kind, references, places)
        {
            return body(self, places);
        }
        self.located_in_arrays(kind, references, count, body)
    }

    /// [`Instance::located`] for a function that sets; an error for a calculated variable. In event mode the model ticks
    /// its clocks again, which may depend on the values.
    pub(crate) fn set_located(
        &mut self,
        kind: NativeType,
        references: &[u32],
        count: usize,
        set: impl FnOnce(&mut Self, &[u32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.session()?.table.check_settable(references)?;
        self.located(kind, references, count, set)?;
        if self.core.state == State::EventMode {
            self.tick();
        }
        Ok(())
    }

    /// [`Instance::located`] for a function that reads. While a clock ticks, in a model with clocked variables, `body`
    /// reads the values after the event.
    pub(crate) fn read_located(
        &mut self,
        kind: NativeType,
        references: &[u32],
        count: usize,
        read: impl FnOnce(&mut Self, &[u32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        if self.core.state == State::EventMode && self.interface.clocks.any() && self.ticks() {
            return self.at_tick(|instance| instance.located(kind, references, count, read));
        }
        self.located(kind, references, count, read)
    }

    /// [`Instance::located`] of arrays or of many variables.
    #[inline(never)]
    fn located_in_arrays(
        &mut self,
        kind: NativeType,
        references: &[u32],
        count: usize,
        body: impl FnOnce(&mut Self, &[u32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let session = self.session_mut()?;
        let mut places = std::mem::take(&mut session.places);
        let located = session.table.locate(kind, references, count, &mut places);
        let result = located.and_then(|()| body(self, &places));
        self.session_mut()?.places = places;
        result
    }
}

/// Checks that the variables of `requiredIntermediateVariables` have `intermediateUpdate = true` (section 2.3.1).
fn check_required(required: &[u32], description: &ModelDescription) -> Result<(), Failure> {
    for &reference in required {
        let variable =
            description.variables.iter().find(|known| known.value_reference == reference);
        if variable.is_none_or(|variable| !variable.intermediate_update) {
            let name = variable.map_or("no variable", |variable| &variable.name);
            return Err(Failure::Error(format!(
                "requiredIntermediateVariables has the value reference {reference} of {name}, expected \
                 variables with intermediateUpdate = true"
            )));
        }
    }
    Ok(())
}

#[cold]
fn other_version() -> Failure {
    Failure::Error("the instance was made by fmi2Instantiate".to_owned())
}
