//! The library of an FMU of FMI 3.0: loading, instantiation, calls.
//!
//! [`Component`] has one method for each C function; it knows neither modes nor arrays. The module
//! `v3` of the crate builds a slave on it.
#![expect(unsafe_code, reason = "the boundary to C")]

mod calls;
pub(super) mod functions;
mod intermediate;
mod step;

use std::ffi::c_void;
use std::sync::Arc;

use fmu_description::Version;

use super::base::{Base, Loaded, instantiate};
use super::log::{Sink, receive_message};
use super::{Loading, c_string};
use crate::crash::Place;
use crate::error::LoadError;
use functions::{ClockUpdate, Functions, Instance, IntermediateUpdate, Preemption};
use intermediate::Inputs;
pub(crate) use intermediate::{InputElement, ORDERS};
pub(crate) use step::DoStepResult;

/// The interface of an instance of FMI 3.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interface {
    CoSimulation,
    ModelExchange,
    ScheduledExecution,
}

impl Interface {
    /// Returns the name of the function that creates the instance.
    fn function(self) -> &'static &'static str {
        match self {
            Interface::CoSimulation => &"fmi3InstantiateCoSimulation",
            Interface::ModelExchange => &"fmi3InstantiateModelExchange",
            Interface::ScheduledExecution => &"fmi3InstantiateScheduledExecution",
        }
    }
}

/// `clockUpdate`: does nothing, because the importer asks for output clocks and intervals after each model partition.
unsafe extern "C" fn clock_update(_environment: *mut c_void) {}

/// `lockPreemption` and `unlockPreemption`: do nothing, because in simulated time model partitions run one by one.
unsafe extern "C" fn preemption() {}

/// A loaded library with the functions of FMI 3.0.
pub(crate) type Library = Loaded<Functions>;

/// The arguments of the function that creates an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instantiation<'a> {
    /// The interface of the instance, which selects the C function.
    pub(crate) interface: Interface,
    /// `instanceName`.
    pub(crate) name: &'a str,
    /// `instantiationToken`.
    pub(crate) token: &'a str,
    /// `resourcePath`: absolute, with a trailing separator; `None` without resources.
    pub(crate) resources: Option<&'a str>,
    /// `eventModeUsed`.
    pub(crate) event_mode: bool,
    /// `earlyReturnAllowed`.
    pub(crate) early_return: bool,
    /// `requiredIntermediateVariables`: the inputs that follow polynomials within a step, if the FMU asks for them.
    pub(crate) intermediate: &'a [u32],
}

impl Library {
    /// Loads the library, and checks its version and that it has the required functions of `interface`.
    pub(crate) fn open(
        loading: &Loading<'_>,
        interface: Interface,
    ) -> Result<Arc<Self>, LoadError> {
        Functions::open(loading, "", &functions::required(interface))
    }

    /// Calls the C function of `arguments.interface` with `logging` as `loggingOn`; returns null if it fails or is
    /// missing.
    fn create(&self, arguments: &Instantiation<'_>, sink: &Sink, logging: bool) -> Instance {
        let (name, token) = (c_string(arguments.name), c_string(arguments.token));
        let resources = arguments.resources.map(c_string);
        let resources = resources.as_ref().map_or(std::ptr::null(), |path| path.as_ptr());
        let (name, token) = (name.as_ptr(), token.as_ptr());
        let environment = std::ptr::from_ref(sink).cast_mut().cast();
        let log = Some(receive_message as functions::LogMessage);
        let created = match arguments.interface {
            Interface::CoSimulation => self.functions.instantiate.map(|function| {
                let (event_mode, early_return) = (arguments.event_mode, arguments.early_return);
                let (count, list) = (arguments.intermediate.len(), arguments.intermediate.as_ptr());
                let list = if count == 0 { std::ptr::null() } else { list };
                let update = (count > 0).then_some(intermediate::update as IntermediateUpdate);
                // SAFETY: terminated strings; an environment and a callback that outlive the instance.
                unsafe {
                    function(
                        name,
                        token,
                        resources,
                        false,
                        logging,
                        event_mode,
                        early_return,
                        list,
                        count,
                        environment,
                        log,
                        update,
                    )
                }
            }),
            Interface::ModelExchange => self.functions.instantiate_equations.map(|function| {
                // SAFETY: as above.
                unsafe { function(name, token, resources, false, logging, environment, log) }
            }),
            Interface::ScheduledExecution => self.functions.instantiate_scheduled.map(|function| {
                let (update, lock) = (clock_update as ClockUpdate, preemption as Preemption);
                let (update, lock, unlock) = (Some(update), Some(lock), Some(lock));
                // SAFETY: as above.
                unsafe {
                    function(
                        name,
                        token,
                        resources,
                        false,
                        logging,
                        environment,
                        log,
                        update,
                        lock,
                        unlock,
                    )
                }
            }),
        };
        created.unwrap_or(std::ptr::null_mut())
    }

    /// Creates an instance; an error with the messages of the FMU if it returns none.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        arguments: &Instantiation<'_>,
    ) -> Result<Component, LoadError> {
        let function = arguments.interface.function();
        let place = Place::new(arguments.name);
        let sink = Sink::new(&place, None);
        let pointer =
            instantiate(&place, function, &sink, |logging| self.create(arguments, &sink, logging));
        let base = Base::new(self, pointer, function, place, sink, Version::V3)?;
        Ok(Component { base, inputs: Box::default() })
    }
}

/// An instance of an FMU of FMI 3.0 and its C functions. Dropping it calls `fmi3FreeInstance`; the
/// library stays loaded until then.
pub(crate) struct Component {
    pub(crate) base: Base<Functions>,
    /// The polynomials of the inputs within the present step.
    inputs: Box<Inputs>,
}

// SAFETY: any thread may use an instance, one at a time (FMI 3.0.2, section 2.2); the pointers lead to
// the instance, its states, and data shared with it through `Arc`.
unsafe impl Send for Component {}

impl Drop for Component {
    fn drop(&mut self) {
        if !self.base.may_be_freed() {
            return;
        }
        self.free_states();
        if let Some(free_instance) = self.base.functions.free_instance {
            self.base.place.enter(&"fmi3FreeInstance");
            // SAFETY: the instance is alive and not used again.
            unsafe { free_instance(self.base.pointer) };
            self.base.place.leave();
        }
    }
}
