//! The library of an FMU of FMI 3.0: loading, instantiation, calls.
//!
//! [`Component`] has one method for each C function; it knows neither modes nor arrays. The module
//! `v3` of the crate builds a slave on it.
#![expect(unsafe_code, reason = "the boundary to C")]

mod calls;
mod equations;
mod functions;
mod intermediate;
mod states;
mod step;
mod values;

use std::cell::{Cell, RefCell};
use std::ffi::c_void;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fmu_description::abi::Status;

use super::canary::Guarded;
use super::log::{Sink, receive_message};
use super::{Handle, Loading, c_string, check_version};
use crate::crash::{self, Place};
use crate::error::LoadError;
use functions::{ClockUpdate, Functions, Instance, IntermediateUpdate, Preemption, State};
use intermediate::Inputs;
pub(crate) use intermediate::ORDERS;
use slave::{CallError, CallSink, Failure};
pub(crate) use step::StepDone;

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

/// `clockUpdate`: after each model partition its output clocks and intervals are asked for in any case.
unsafe extern "C" fn clock_update(_environment: *mut c_void) {}

/// `lockPreemption` and `unlockPreemption`: in simulated time, one model partition ends before the next one begins.
unsafe extern "C" fn preemption() {}

/// A loaded library with the functions of FMI 3.0.
pub(crate) struct Library {
    functions: Functions,
    path: PathBuf,
    /// An instance returned `fmi3Fatal`: no function of any instance may be called.
    corrupted: AtomicBool,
    _handle: Handle,
}

/// The arguments of the function that creates an instance that depend on the FMU.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instantiation<'a> {
    /// Which of the functions is called.
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
    /// The inputs that follow polynomials within a step, if the FMU asks for them.
    pub(crate) intermediate: &'a [u32],
}

impl Library {
    /// Loads the library and checks its version and that it has the functions of `interface`.
    pub(crate) fn open(loading: &Loading<'_>, interface: Interface) -> Result<Self, LoadError> {
        let path = loading.path;
        let handle = loading.load()?;
        let functions = Functions::load(&handle, "");
        check_version(path, functions.get_version, "fmi3GetVersion", "3.0")?;
        functions.require(interface, path)?;
        let corrupted = AtomicBool::new(false);
        Ok(Self { functions, path: path.to_owned(), corrupted, _handle: handle })
    }

    /// Calls the C function of `with.interface`; null if it fails.
    fn create(&self, with: &Instantiation<'_>, sink: &Sink) -> Instance {
        let (name, token) = (c_string(with.name), c_string(with.token));
        let resources = with.resources.map(c_string);
        let resources = resources.as_ref().map_or(std::ptr::null(), |path| path.as_ptr());
        let (name, token) = (name.as_ptr(), token.as_ptr());
        let environment = std::ptr::from_ref(sink).cast_mut().cast();
        let log = Some(receive_message as functions::LogMessage);
        let created = match with.interface {
            Interface::CoSimulation => self.functions.instantiate.map(|function| {
                let (event_mode, early_return) = (with.event_mode, with.early_return);
                let (count, list) = (with.intermediate.len(), with.intermediate.as_ptr());
                let list = if count == 0 { std::ptr::null() } else { list };
                let update = (count > 0).then_some(intermediate::update as IntermediateUpdate);
                // SAFETY: terminated strings; an environment and a callback that outlive the instance.
                unsafe {
                    function(
                        name,
                        token,
                        resources,
                        false,
                        false,
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
                unsafe { function(name, token, resources, false, false, environment, log) }
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
                        false,
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

    /// Creates an instance.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        with: &Instantiation<'_>,
    ) -> Result<Component, LoadError> {
        let function = with.interface.function();
        let place = Place::new(with.name);
        let sink = Sink::new(&place, None);
        place.enter(function);
        let pointer = self.create(with, &sink);
        place.leave();
        let component = Component {
            pointer,
            functions: self.functions,
            place,
            sink,
            saved: Vec::new(),
            warned: Cell::new(false),
            guards: false,
            call_sink: RefCell::new(None),
            inputs: Box::default(),
            library: self.clone(),
        };
        if !pointer.is_null() {
            return Ok(component);
        }
        let messages = component.sink.take();
        let reason =
            if messages.is_empty() { "it gave no reason".to_owned() } else { messages.join("; ") };
        let (path, instance) = (self.path.clone(), with.name.to_owned());
        Err(LoadError::Instantiate { path, function, instance, reason })
    }
}

/// An instance of an FMU of FMI 3.0 and its C functions. Dropping it calls `fmi3FreeInstance`; the
/// library stays loaded until then.
pub(crate) struct Component {
    pointer: Instance,
    /// A copy of the library's function table.
    functions: Functions,
    /// The current function and time of the instance, for crash reports.
    place: Arc<Place>,
    /// Receives messages; the FMU holds its address.
    sink: Arc<Sink>,
    /// FMU states by slot; null in an empty slot.
    saved: Vec<State>,
    /// Whether a call has returned `fmi3Warning`.
    warned: Cell<bool>,
    /// Whether calls get copies of arrays, with canaries.
    guards: bool,
    /// Receives a text for each call, if calls are logged.
    call_sink: RefCell<Option<CallSink>>,
    /// The courses of the inputs within the present step.
    inputs: Box<Inputs>,
    library: Arc<Library>,
}

// SAFETY: any thread may use an instance, one at a time (FMI 3.0.2, section 2.2); the pointers lead to
// the instance, its states, and data shared with it through `Arc`.
unsafe impl Send for Component {}

impl Drop for Component {
    fn drop(&mut self) {
        if self.pointer.is_null() {
            return;
        }
        crash::check_returned(&self.place);
        if self.library.corrupted.load(Ordering::Relaxed) {
            // The instance may still use the library and the sink: they are leaked.
            std::mem::forget((self.library.clone(), self.sink.clone()));
            return;
        }
        for mut state in std::mem::take(&mut self.saved) {
            self.free_state(&mut state);
        }
        if let Some(free_instance) = self.functions.free_instance {
            self.place.enter(&"fmi3FreeInstance");
            // SAFETY: the instance is alive and not used again.
            unsafe { free_instance(self.pointer) };
            self.place.leave();
        }
    }
}

impl Component {
    /// Passes the text of every call from now on to `sink`.
    pub(crate) fn log_calls(&mut self, sink: CallSink) {
        self.call_sink = RefCell::new(Some(sink));
    }

    /// Logs a call before it is made.
    #[inline]
    fn log_call(&self, function: &'static str, arguments: impl FnOnce() -> String) {
        if let Some(sink) = &mut *self.call_sink.borrow_mut() {
            sink(&format!("{function}({})", arguments()));
        }
    }

    /// As [`Component::check`], for a call with results, which are logged.
    #[inline]
    fn check_results(
        &self,
        function: &'static str,
        status: i32,
        results: impl FnOnce() -> String,
    ) -> Result<(), CallError> {
        if let Some(sink) = &mut *self.call_sink.borrow_mut() {
            let name = match Status::from_c(status) {
                Some(status) => status.name().replace("fmi2", "fmi3"),
                None => status.to_string(),
            };
            sink(&format!(" -> {name}{}\n", results()));
        }
        self.check_status(function, status)
    }

    /// Lets the calls from now on get copies of arrays, with canaries.
    pub(crate) fn guard_arrays(&mut self) {
        self.guards = true;
    }

    /// As [`Component::check_results`], for a call that may have been guarded.
    #[inline]
    fn check_guarded(
        &self,
        function: &'static str,
        (status, violation): Guarded,
        results: impl FnOnce() -> String,
    ) -> Result<(), CallError> {
        let done = self.check_results(function, status, results);
        match violation {
            None => done,
            Some(what) => Err(self.failed(function, Failure::InvalidAnswer(what))),
        }
    }

    /// Marks the call as returned and converts its status to a result.
    #[inline]
    fn check(&self, function: &'static str, status: i32) -> Result<(), CallError> {
        self.check_results(function, status, String::new)
    }

    #[inline]
    fn check_status(&self, function: &'static str, status: i32) -> Result<(), CallError> {
        self.place.leave();
        if status == Status::OK as i32 {
            return Ok(());
        }
        if status == Status::Warning as i32 {
            self.warned.set(true);
            return Ok(());
        }
        if status == Status::Fatal as i32 {
            self.library.corrupted.store(true, Ordering::Relaxed);
        }
        let failure = match Status::from_c(status) {
            Some(Status::Pending) | None => Failure::UnknownStatus(status),
            Some(status) => Failure::Status(status),
        };
        Err(self.failed(function, failure))
    }

    /// Returns whether a call has returned `fmi3Warning` since the last call of this function.
    pub(crate) fn take_warning(&mut self) -> bool {
        self.warned.take()
    }

    /// Returns the error of a call, with the instance's recent messages.
    #[cold]
    pub(crate) fn failed(&self, function: &'static str, failure: Failure) -> CallError {
        self.place.failed(CallError { function, failure, messages: self.sink.take() })
    }
}
