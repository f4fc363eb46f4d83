//! The library of an FMU of FMI 1.0, co-simulation (stand-alone) or model exchange: loading, instantiation, calls.
//!
//! The functions have the model identifier as prefix. [`Component`] has one method for each C function.
#![expect(unsafe_code, reason = "the boundary to C")]

pub(super) mod functions;

use std::ffi::{CStr, c_char, c_int};
use std::sync::Arc;
use std::time::{Duration, Instant};

use fmu_description::Version;
use fmu_description::abi::{Status, StatusKind};

use super::base::{Base, Loaded, instantiate};
use super::calls::{derivatives, equations, function, modes, same_length, strings, values};
use super::log::{Names, Sink, logger};
use super::step::{PAUSE, finish_step};
use super::{Interface, Loading, c_string, calloc, canary, copy_strings, free};
use crate::crash::Place;
use crate::error::LoadError;
use functions::{Callbacks, Functions, ModelCallbacks};
use slave::{CallError, CompletedStep, EventInfo, Failure, StepResult, absent};

/// The type of an FMU whose library runs in this process (FMI 1.0 for co-simulation, section 3.4.1).
const MIME_TYPE: &CStr = c"application/x-fmu-sharedlibrary";

/// A loaded library with the functions of FMI 1.0.
pub(crate) type Library = Loaded<Functions>;

impl Library {
    /// Loads the library, and checks its version and that it has the required functions of `interface`.
    pub(crate) fn open(
        loading: &Loading<'_>,
        model_identifier: &str,
        interface: Interface,
    ) -> Result<Arc<Self>, LoadError> {
        let prefix = format!("{model_identifier}_");
        Functions::open(loading, &prefix, &[functions::required(interface)])
    }

    /// Calls `fmiInstantiateSlave` or `fmiInstantiateModel`. `location` is the URI of the unpacked FMU.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        interface: Interface,
        name: &str,
        guid: &str,
        location: &str,
        names: Names,
    ) -> Result<Component, LoadError> {
        let function: &'static &'static str = match interface {
            Interface::CoSimulation => &"fmiInstantiateSlave",
            Interface::ModelExchange => &"fmiInstantiateModel",
        };
        let place = Place::new(name);
        let sink = Sink::new(&place, Some(names));
        let callbacks = ModelCallbacks {
            logger: Some(logger()),
            allocate_memory: Some(calloc),
            free_memory: Some(free),
        };
        let (c_name, c_guid, c_location) = (c_string(name), c_string(guid), c_string(location));
        let null = std::ptr::null_mut();
        let pointer = instantiate(&place, function, &sink, |logging| match interface {
            // SAFETY: terminated strings, and callbacks by value.
            Interface::CoSimulation => self.functions.instantiate.map_or(null, |function| unsafe {
                function(
                    c_name.as_ptr(),
                    c_guid.as_ptr(),
                    c_location.as_ptr(),
                    MIME_TYPE.as_ptr(),
                    0.0,
                    0,
                    0,
                    Callbacks { functions: callbacks, step_finished: None },
                    logging.into(),
                )
            }),
            Interface::ModelExchange => {
                // SAFETY: terminated strings, and callbacks by value.
                self.functions.instantiate_model.map_or(null, |function| unsafe {
                    function(c_name.as_ptr(), c_guid.as_ptr(), callbacks, logging.into())
                })
            }
        });
        let base = Base::new(self, pointer, function, place, sink, Version::V1)?;
        Ok(Component { base, interface })
    }
}

/// An instance of an FMU of FMI 1.0 and its C functions. Dropping it calls `fmiFreeSlaveInstance` or
/// `fmiFreeModelInstance`; the library stays loaded until then.
pub(crate) struct Component {
    pub(crate) base: Base<Functions>,
    interface: Interface,
}

// SAFETY: any thread may use an instance, one at a time; the pointers lead to the instance and to data
// shared with it through `Arc`.
unsafe impl Send for Component {}

impl Drop for Component {
    fn drop(&mut self) {
        if !self.base.may_be_freed() {
            return;
        }
        let functions = &self.base.functions;
        let (function, name): (_, &'static &'static str) = match self.interface {
            Interface::CoSimulation => (functions.free_instance, &"fmiFreeSlaveInstance"),
            Interface::ModelExchange => (functions.free_model, &"fmiFreeModelInstance"),
        };
        if let Some(free_instance) = function {
            self.base.place.enter(name);
            // SAFETY: the instance is alive and not used again.
            unsafe { free_instance(self.base.pointer) };
            self.base.place.leave();
        }
    }
}

impl Component {
    pub(crate) fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        const NAME: &str = "fmiSetDebugLogging";
        let function = function!(self.set_debug_logging, NAME);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.base.pointer, on.into()) };
        self.base.check(NAME, status)
    }

    pub(crate) fn initialize(&mut self, start: f64, stop: Option<f64>) -> Result<(), CallError> {
        const NAME: &str = "fmiInitializeSlave";
        let function = function!(self.initialize, NAME);
        self.base.place.set_time(start);
        // SAFETY: the instance is alive.
        let status = unsafe {
            function(self.base.pointer, start, stop.is_some().into(), stop.unwrap_or(0.0))
        };
        self.base.check(NAME, status)
    }

    /// Calls `fmiTerminateSlave` or `fmiTerminate`.
    pub(crate) fn terminate(&mut self) -> Result<(), CallError> {
        match self.interface {
            Interface::CoSimulation => self.terminate_slave(),
            Interface::ModelExchange => self.terminate_model(),
        }
    }

    /// Calls `fmiDoStep` from `time` with the step `size`, both in s. `newStep` is true: the last step is accepted.
    #[inline]
    pub(crate) fn do_step(&mut self, time: f64, size: f64) -> Result<StepResult, CallError> {
        const NAME: &str = "fmiDoStep";
        let function = function!(self.do_step, NAME);
        self.base.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.base.pointer, time, size, 1) };
        self.base.place.leave();
        if status == Status::OK as c_int {
            return Ok(StepResult::Whole);
        }
        self.finish_step(status, time, size)
    }

    pub(crate) fn initialize_model(
        &mut self,
        tolerance: Option<f64>,
    ) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmiInitialize";
        let function = function!(self.initialize_model, NAME);
        let mut info = functions::EventInfo::default();
        let (controlled, tolerance) = (tolerance.is_some().into(), tolerance.unwrap_or(0.0));
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.base.pointer, controlled, tolerance, &raw mut info) };
        self.base.check(NAME, status)?;
        Ok(info.into())
    }

    #[inline]
    pub(crate) fn completed_integrator_step(&mut self) -> Result<CompletedStep, CallError> {
        const NAME: &str = "fmiCompletedIntegratorStep";
        let function = function!(self.completed_integrator_step, NAME);
        let mut event = 0;
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.base.pointer, &raw mut event) };
        self.base.check(NAME, status)?;
        Ok(CompletedStep { enter_event_mode: event != 0, terminate_simulation: false })
    }

    /// Calls `fmiEventUpdate`, which iterates until nothing changes any more.
    pub(crate) fn event_update(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmiEventUpdate";
        let function = function!(self.event_update, NAME);
        let mut info = functions::EventInfo::default();
        // SAFETY: the instance is alive; one place for the result.
        let status = unsafe { function(self.base.pointer, 0, &raw mut info) };
        self.base.check(NAME, status)?;
        Ok(info.into())
    }
}

impl From<functions::EventInfo> for EventInfo {
    fn from(info: functions::EventInfo) -> Self {
        Self {
            discrete_states_need_update: info.iteration_converged == 0,
            terminate_simulation: info.terminate_simulation != 0,
            // After such a change the states are other variables, with other nominal values.
            nominals_changed: info.state_value_references_changed != 0,
            values_changed: info.state_values_changed != 0,
            next_event_time: (info.upcoming_time_event != 0).then_some(info.next_event_time),
        }
    }
}

modes! {
    fn terminate_slave = "fmiTerminateSlave";
    fn terminate_model = "fmiTerminate";
}

values! {
    fn get_real, set_real: f64 = "fmiGetReal" "fmiSetReal", same_length;
    fn get_integer, set_integer: c_int = "fmiGetInteger" "fmiSetInteger", same_length;
    fn get_boolean, set_boolean: c_char = "fmiGetBoolean" "fmiSetBoolean", same_length;
}

strings! {
    fn get_string, set_string = "fmiGetString" "fmiSetString", same_length;
}

derivatives! {
    fn set_input_derivatives, get_output_derivatives =
        "fmiSetRealInputDerivatives" "fmiGetRealOutputDerivatives";
}

equations! {
    fn set_time = "fmiSetTime";
    fn set_continuous_states = "fmiSetContinuousStates";
    fn get_continuous_states = "fmiGetContinuousStates";
    fn get_derivatives = "fmiGetDerivatives";
    fn get_event_indicators = "fmiGetEventIndicators";
    fn get_nominals_of_continuous_states = "fmiGetNominalContinuousStates";
}

finish_step! {
    do_step = "fmiDoStep", discard = "fmiDiscard";
    cancel_step = "fmiCancelStep";
    get_status = "fmiGetStatus";
    get_real_status = "fmiGetRealStatus";
}
