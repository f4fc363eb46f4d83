//! The library of an FMU of FMI 1.0, co-simulation (stand-alone) or model exchange: loading, instantiation, calls.
//!
//! The functions have the model identifier as prefix. [`Component`] has one method for each C function.
#![expect(unsafe_code, reason = "the boundary to C")]

mod equations;
mod functions;
mod step;

use std::ffi::{CStr, c_char, c_int};
use std::sync::Arc;

use fmu_description::Version;

use super::base::{Base, Loaded};
use super::calls::{derivatives, function, modes, same_length, strings, values};
use super::log::{Names, Sink, logger};
use super::{Interface, Loading, c_string, calloc, canary, check_version, copy_strings, free};
use crate::crash::Place;
use crate::error::LoadError;
use functions::{Callbacks, Functions, ModelCallbacks};
use slave::{CallError, absent};

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
    ) -> Result<Self, LoadError> {
        let handle = loading.load()?;
        let prefix = format!("{model_identifier}_");
        let functions = Functions::load(&handle, &prefix);
        check_version(loading.path, functions.get_version, "fmiGetVersion", "1.0")?;
        functions.require(loading.path, &prefix, &[functions::required(interface)])?;
        Ok(Self::new(functions, loading.path, handle))
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
        place.enter(function);
        let pointer = match interface {
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
                    0,
                )
            }),
            Interface::ModelExchange => {
                // SAFETY: terminated strings, and callbacks by value.
                self.functions.instantiate_model.map_or(null, |function| unsafe {
                    function(c_name.as_ptr(), c_guid.as_ptr(), callbacks, 0)
                })
            }
        };
        place.leave();
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
    /// Calls `fmiSetDebugLogging`.
    pub(crate) fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        const NAME: &str = "fmiSetDebugLogging";
        let function = function!(self.set_debug_logging, NAME);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.base.pointer, on.into()) };
        self.base.check(NAME, status)
    }

    /// Calls `fmiInitializeSlave`.
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
}

modes! {
    fn terminate_slave = "fmiTerminateSlave";
    fn terminate_model = "fmiTerminate";
}

values! {
    pub(crate) fn get_real, set_real: f64 = "fmiGetReal" "fmiSetReal", same_length;
    pub(crate) fn get_integer, set_integer: c_int = "fmiGetInteger" "fmiSetInteger", same_length;
    pub(crate) fn get_boolean, set_boolean: c_char = "fmiGetBoolean" "fmiSetBoolean", same_length;
}

strings! {
    pub(crate) fn get_string, set_string = "fmiGetString" "fmiSetString", same_length;
}

derivatives! {
    pub(crate) fn set_input_derivatives, get_output_derivatives =
        "fmiSetRealInputDerivatives" "fmiGetRealOutputDerivatives";
}
