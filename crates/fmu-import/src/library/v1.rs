//! The library of an FMU of FMI 1.0, co-simulation (stand-alone) or model exchange: loading, instantiation, calls.
//!
//! The functions have the model identifier as prefix. [`Component`] has one method for each C function.
#![expect(unsafe_code, reason = "the boundary to C")]

mod equations;
mod functions;
mod step;

use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_int};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fmu_description::abi::Status;

use super::calls::{function, same_length};
use super::canary::{self, Guarded};
use super::log::{Names, Sink, logger};
use super::{Handle, Interface, Loading, c_string, calloc, check_version, copy_strings, free};
use crate::crash::{self, Place};
use crate::error::LoadError;
use functions::{Callbacks, Functions, Instance, ModelCallbacks};
use slave::{CallError, Failure, absent};

/// The type of an FMU whose library runs in this process (FMI 1.0 for co-simulation, section 3.4.1).
const MIME_TYPE: &CStr = c"application/x-fmu-sharedlibrary";

/// A loaded library with the functions of FMI 1.0 for one interface.
pub(crate) struct Library {
    functions: Functions,
    interface: Interface,
    path: PathBuf,
    /// An instance returned `fmiFatal`: no function of any instance may be called.
    corrupted: AtomicBool,
    _handle: Handle,
}

impl Library {
    /// Loads the library and checks its version and that it can run with `interface`.
    pub(crate) fn open(
        loading: &Loading<'_>,
        model_identifier: &str,
        interface: Interface,
    ) -> Result<Self, LoadError> {
        let path = loading.path;
        let handle = loading.load()?;
        let functions = Functions::load(&handle, &format!("{model_identifier}_"));
        check_version(path, functions.get_version, "fmiGetVersion", "1.0")?;
        functions.require(path, model_identifier, interface)?;
        let corrupted = AtomicBool::new(false);
        Ok(Self { functions, interface, path: path.to_owned(), corrupted, _handle: handle })
    }

    /// Calls `fmiInstantiateSlave` or `fmiInstantiateModel`. `location` is the URI of the unpacked FMU.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        name: &str,
        guid: &str,
        location: &str,
        names: Names,
    ) -> Result<Component, LoadError> {
        let function: &'static &'static str = match self.interface {
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
        let pointer = match self.interface {
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
        let component = Component {
            pointer,
            functions: self.functions,
            place,
            sink,
            time_limit: None,
            abandoned: false,
            warned: Cell::new(false),
            guards: false,
            library: self.clone(),
        };
        if !pointer.is_null() {
            return Ok(component);
        }
        let messages = component.sink.take();
        let reason =
            if messages.is_empty() { "it gave no reason".to_owned() } else { messages.join("; ") };
        let (path, instance) = (self.path.clone(), name.to_owned());
        Err(LoadError::Instantiate { path, function, instance, reason })
    }
}

/// An instance of an FMU of FMI 1.0 and its C functions. Dropping it calls `fmiFreeSlaveInstance` or
/// `fmiFreeModelInstance`; the library stays loaded until then.
pub(crate) struct Component {
    pointer: Instance,
    /// A copy of the library's function table.
    functions: Functions,
    /// The current function and time of the instance, for crash reports.
    place: Arc<Place>,
    /// Receives messages. The logger finds it by the thread or the name of the instance, because FMI 1.0
    /// has no environment.
    sink: Arc<Sink>,
    /// How long a step that returned `fmiPending` may take; `None`: no limit.
    pub(crate) time_limit: Option<Duration>,
    /// The instance still computes a step that could not be canceled, and must not be freed.
    abandoned: bool,
    /// Whether a call has returned `fmiWarning`.
    warned: Cell<bool>,
    /// Whether calls get copies of arrays, with canaries.
    guards: bool,
    library: Arc<Library>,
}

// SAFETY: any thread may use an instance, one at a time; the pointers lead to the instance and to data
// shared with it through `Arc`.
unsafe impl Send for Component {}

impl Drop for Component {
    fn drop(&mut self) {
        if self.pointer.is_null() {
            return;
        }
        crash::check_returned(&self.place);
        if self.abandoned || self.library.corrupted.load(Ordering::Relaxed) {
            // The instance may still use the library and the sink: they are leaked.
            std::mem::forget((self.library.clone(), self.sink.clone()));
            return;
        }
        let (function, name): (_, &'static &'static str) = match self.library.interface {
            Interface::CoSimulation => (self.functions.free_instance, &"fmiFreeSlaveInstance"),
            Interface::ModelExchange => (self.functions.free_model, &"fmiFreeModelInstance"),
        };
        if let Some(free_instance) = function {
            self.place.enter(name);
            // SAFETY: the instance is alive and not used again.
            unsafe { free_instance(self.pointer) };
            self.place.leave();
        }
    }
}

impl Component {
    /// Marks the call as returned and converts its status to a result.
    #[inline]
    fn check(&self, function: &'static str, status: c_int) -> Result<(), CallError> {
        self.place.leave();
        if status == Status::OK as c_int {
            return Ok(());
        }
        if status == Status::Warning as c_int {
            self.warned.set(true);
            return Ok(());
        }
        if status == Status::Fatal as c_int {
            self.library.corrupted.store(true, Ordering::Relaxed);
        }
        let failure =
            Status::from_c(status).map_or(Failure::UnknownStatus(status), Failure::Status);
        Err(self.failed(function, failure))
    }

    /// Lets the calls from now on get copies of arrays, with canaries.
    pub(crate) fn guard_arrays(&mut self) {
        self.guards = true;
    }

    /// As [`Component::check`], for a call that may have been guarded.
    #[inline]
    fn check_guarded(
        &self,
        function: &'static str,
        (status, violation): Guarded,
    ) -> Result<(), CallError> {
        let done = self.check(function, status);
        match violation {
            None => done,
            Some(what) => Err(self.failed(function, Failure::InvalidAnswer(what))),
        }
    }

    /// Returns whether a call has returned `fmiWarning` since the last call of this function.
    pub(crate) fn take_warning(&mut self) -> bool {
        self.warned.take()
    }

    /// Returns the error of a call, with the instance's recent messages.
    #[cold]
    fn failed(&self, function: &'static str, failure: Failure) -> CallError {
        self.place.failed(CallError { function, failure, messages: self.sink.take() })
    }

    /// Calls `fmiSetDebugLogging`.
    pub(crate) fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        const NAME: &str = "fmiSetDebugLogging";
        let function = function!(self.set_debug_logging, NAME);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer, on.into()) };
        self.check(NAME, status)
    }

    /// Calls `fmiInitializeSlave`.
    pub(crate) fn initialize(&mut self, start: f64, stop: Option<f64>) -> Result<(), CallError> {
        const NAME: &str = "fmiInitializeSlave";
        let function = function!(self.initialize, NAME);
        self.place.set_time(start);
        // SAFETY: the instance is alive.
        let status =
            unsafe { function(self.pointer, start, stop.is_some().into(), stop.unwrap_or(0.0)) };
        self.check(NAME, status)
    }

    /// Calls `fmiTerminateSlave` or `fmiTerminate`.
    pub(crate) fn terminate(&mut self) -> Result<(), CallError> {
        const NAME: &str = "fmiTerminateSlave";
        if self.library.interface == Interface::ModelExchange {
            return self.terminate_model();
        }
        let function = function!(self.terminate, NAME);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer) };
        self.check(NAME, status)
    }

    /// Calls `fmiSetRealInputDerivatives`.
    pub(crate) fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[c_int],
        values: &[f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmiSetRealInputDerivatives";
        let function = function!(self.set_input_derivatives, NAME);
        let (count, guards) = (same_length(references, values), self.guards);
        let done = canary::constant(guards, canary::ORDERS, &orders[..count], |orders| {
            // SAFETY: the instance is alive; as many references as orders and values.
            let call = |list, array| unsafe { function(self.pointer, list, count, orders, array) };
            canary::write(guards, references, values, call)
        });
        self.check_guarded(NAME, done)
    }

    /// Calls `fmiGetRealOutputDerivatives`.
    pub(crate) fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[c_int],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmiGetRealOutputDerivatives";
        let function = function!(self.get_output_derivatives, NAME);
        let (count, guards) = (same_length(references, values), self.guards);
        let done = canary::constant(guards, canary::ORDERS, &orders[..count], |orders| {
            // SAFETY: the instance is alive; as many references as orders and values.
            let call = |list, array| unsafe { function(self.pointer, list, count, orders, array) };
            canary::read(guards, references, values, call)
        });
        self.check_guarded(NAME, done)
    }

    /// Calls `fmiSetString`.
    pub(crate) fn set_string(
        &mut self,
        references: &[u32],
        values: &[String],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmiSetString";
        let function = function!(self.set_string, NAME);
        let count = same_length(references, values);
        let values: Vec<_> = values.iter().map(|value| c_string(value)).collect();
        let texts: Vec<_> = values.iter().map(CString::as_bytes_with_nul).collect();
        let (pointer, guards) = (self.pointer, self.guards);
        let done = canary::constants(guards, canary::STRING, &texts, |array| {
            canary::constant(guards, canary::REFERENCES, references, |list| {
                // SAFETY: the instance is alive; as many references as terminated strings.
                (unsafe { function(pointer, list, count, array.cast()) }, None)
            })
        });
        self.check_guarded(NAME, done)
    }

    /// Calls `fmiGetString` and copies the strings.
    pub(crate) fn get_string(
        &mut self,
        references: &[u32],
        values: &mut [String],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmiGetString";
        let function = function!(self.get_string, NAME);
        let count = same_length(references, values);
        let mut pointers = vec![std::ptr::null(); count];
        // SAFETY: the instance is alive; as many references as pointers to write.
        let call = |list, array| unsafe { function(self.pointer, list, count, array) };
        self.check_guarded(NAME, canary::read(self.guards, references, &mut pointers, call))?;
        self.place.enter(&NAME);
        // SAFETY: the FMU returns null or terminated strings, which live until the next call.
        unsafe { copy_strings(&pointers, values) };
        self.place.leave();
        Ok(())
    }
}

/// Defines the methods of the types whose values are copied.
macro_rules! values {
    ($($get:ident $set:ident: $type:ty = $get_name:literal $set_name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $get_name, "`.")]
            #[inline]
            pub(crate) fn $get(
                &mut self,
                references: &[u32],
                values: &mut [$type],
            ) -> Result<(), CallError> {
                let function = function!(self.$get, $get_name);
                let count = same_length(references, values);
                // SAFETY: the instance is alive; as many references as values.
                let call = |list, array| unsafe { function(self.pointer, list, count, array) };
                self.check_guarded($get_name, canary::read(self.guards, references, values, call))
            }

            #[doc = concat!("Calls `", $set_name, "`.")]
            #[inline]
            pub(crate) fn $set(
                &mut self,
                references: &[u32],
                values: &[$type],
            ) -> Result<(), CallError> {
                let function = function!(self.$set, $set_name);
                let count = same_length(references, values);
                // SAFETY: the instance is alive; as many references as values.
                let call = |list, array| unsafe { function(self.pointer, list, count, array) };
                self.check_guarded($set_name, canary::write(self.guards, references, values, call))
            })*
        }
    };
}

values! {
    get_real set_real: f64 = "fmiGetReal" "fmiSetReal";
    get_integer set_integer: c_int = "fmiGetInteger" "fmiSetInteger";
    get_boolean set_boolean: c_char = "fmiGetBoolean" "fmiSetBoolean";
}
