//! The parts that libraries and instances of all versions of FMI share.

use std::cell::{Cell, RefCell};
use std::ffi::{c_int, c_void};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fmu_description::Version;
use fmu_description::abi::{Status, fmi2CallbackFunctions};
use slave::{CallError, CallSink, Failure};

use super::canary::Guarded;
use super::load::Handle;
use super::log::Sink;
use crate::crash::{self, Place};
use crate::error::LoadError;

/// A loaded library with the functions of its version of the standard.
pub(crate) struct Loaded<F> {
    pub(super) functions: F,
    path: PathBuf,
    /// Whether an instance returned `fmi2Fatal`: then no instance may be freed (FMI 2.0.5, section 2.1.3).
    corrupted: AtomicBool,
    _handle: Handle,
}

impl<F> Loaded<F> {
    pub(super) fn new(functions: F, path: &Path, handle: Handle) -> Self {
        let corrupted = AtomicBool::new(false);
        Self { functions, path: path.to_owned(), corrupted, _handle: handle }
    }
}

/// The part of an instance that does not depend on the version.
pub(crate) struct Base<F> {
    pub(super) pointer: *mut c_void,
    /// A copy of the library's function table.
    pub(super) functions: F,
    /// The current function and time of the instance, for crash reports.
    pub(super) place: Arc<Place>,
    /// Receives messages; the FMU holds its address. An FMU of FMI 1.0 does not return the address: the logger finds
    /// the sink by the thread or by the name of the instance.
    sink: Arc<Sink>,
    /// The callbacks of FMI 2.0, kept alive because the FMU holds their address.
    pub(super) callbacks: Option<Arc<fmi2CallbackFunctions>>,
    /// FMU states by slot; null in an empty slot.
    pub(super) saved: Vec<*mut c_void>,
    /// Time limit for a step that returned `fmi2Pending`; `None`: no limit.
    pub(crate) time_limit: Option<Duration>,
    /// Whether the instance still computes a step that could not be canceled, so that the instance must not be freed.
    pub(super) abandoned: bool,
    /// Whether a call has returned `fmi2Warning` since the last [`Base::take_warning`].
    warned: Cell<bool>,
    /// Whether calls pass copies of arrays with canaries to the FMU, to detect writes outside an array.
    pub(super) guards: bool,
    /// Receives a text for each call, if calls are logged; in FMI 3.0 only.
    call_sink: Option<RefCell<CallSink>>,
    version: Version,
    library: Arc<Loaded<F>>,
}

/// Calls `function` by `call` with `loggingOn` false. If it returns null without a message, calls it again with
/// `loggingOn` true, because many FMUs state the reason of a failure only then.
pub(super) fn instantiate(
    place: &Place,
    function: &'static &'static str,
    sink: &Sink,
    call: impl Fn(bool) -> *mut c_void,
) -> *mut c_void {
    place.enter(function);
    let mut pointer = call(false);
    if pointer.is_null() && sink.is_empty() {
        pointer = call(true);
    }
    place.leave();
    pointer
}

impl<F: Copy> Base<F> {
    /// Takes over the instance that `function` has created; if it is null, returns an error with the messages of the
    /// FMU.
    pub(super) fn new(
        library: &Arc<Loaded<F>>,
        pointer: *mut c_void,
        function: &'static str,
        place: Arc<Place>,
        sink: Arc<Sink>,
        version: Version,
    ) -> Result<Self, LoadError> {
        if pointer.is_null() {
            let messages = sink.take();
            let reason = if messages.is_empty() {
                "it gave no reason".to_owned()
            } else {
                messages.join("; ")
            };
            let (path, instance) = (library.path.clone(), place.instance().to_owned());
            return Err(LoadError::Instantiate { path, function, instance, reason });
        }
        Ok(Self {
            pointer,
            functions: library.functions,
            place,
            sink,
            callbacks: None,
            saved: Vec::new(),
            time_limit: None,
            abandoned: false,
            warned: Cell::new(false),
            guards: false,
            call_sink: None,
            version,
            library: library.clone(),
        })
    }

    /// Returns whether the instance may be freed. If not, library, callbacks and sink are leaked, because the instance
    /// may still use them. If a call of the instance has not returned, ends the process.
    pub(super) fn may_be_freed(&self) -> bool {
        crash::check_returned(&self.place);
        let is_lost = self.abandoned || self.library.corrupted.load(Ordering::Relaxed);
        if is_lost {
            std::mem::forget((self.library.clone(), self.callbacks.clone(), self.sink.clone()));
        }
        !is_lost
    }

    /// Logs a warning about an answer of the FMU that breaks the standard but is used.
    #[cold]
    pub(crate) fn warn(&self, text: &str) {
        tracing::warn!("{}: {text}", self.place.instance());
    }

    /// Lets the calls from now on get copies of arrays, with canaries.
    pub(crate) fn guard_arrays(&mut self) {
        self.guards = true;
    }

    /// Passes the text of every call from now on to `sink`.
    pub(crate) fn log_calls(&mut self, sink: CallSink) {
        self.call_sink = Some(RefCell::new(sink));
    }

    /// Logs a call before it is made.
    #[inline]
    pub(super) fn log_call(&self, function: &'static str, arguments: impl FnOnce() -> String) {
        if let Some(sink) = &self.call_sink {
            sink.borrow_mut()(&format!("{function}({})", arguments()));
        }
    }

    /// Marks the call as returned, logs its status and converts it to a result.
    #[inline]
    pub(super) fn check(&self, function: &'static str, status: c_int) -> Result<(), CallError> {
        self.check_results(function, status, String::new)
    }

    /// Like [`Base::check`], but also logs the results of the call.
    #[inline]
    pub(super) fn check_results(
        &self,
        function: &'static str,
        status: c_int,
        results: impl FnOnce() -> String,
    ) -> Result<(), CallError> {
        if let Some(sink) = &self.call_sink {
            let name = match Status::from_c(status) {
                Some(status) => status.name().replace("fmi2", "fmi3"),
                None => status.to_string(),
            };
            sink.borrow_mut()(&format!(" -> {name}{}\n", results()));
        }
        self.check_status(function, status)
    }

    /// Like [`Base::check_results`], for a call with guards: its violation of an array, if any, is an error.
    #[inline]
    pub(super) fn check_guarded(
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

    /// Like [`Base::check`], for a call that is not logged.
    #[inline]
    pub(super) fn check_status(
        &self,
        function: &'static str,
        status: c_int,
    ) -> Result<(), CallError> {
        self.place.leave();
        if status == Status::OK as c_int || self.is_warning(status) {
            return Ok(());
        }
        if status == Status::Fatal as c_int {
            self.library.corrupted.store(true, Ordering::Relaxed);
        }
        let failure = match Status::from_c(status) {
            // FMI 3.0 has no pending calls.
            Some(Status::Pending) if self.version == Version::V3 => Failure::UnknownStatus(status),
            Some(status) => Failure::Status(status),
            None => Failure::UnknownStatus(status),
        };
        Err(self.failed(function, failure))
    }

    /// Returns whether `status` is `fmi2Warning`, and records it for [`Base::take_warning`].
    #[inline]
    pub(super) fn is_warning(&self, status: c_int) -> bool {
        let warning = status == Status::Warning as c_int;
        if warning {
            self.warned.set(true);
        }
        warning
    }

    /// Returns whether a call has returned `fmi2Warning` since the last call of this function.
    pub(crate) fn take_warning(&self) -> bool {
        self.warned.take()
    }

    /// Returns the error of a call, with the instance's recent messages, and notes it for a crash report.
    #[cold]
    pub(super) fn failed(&self, function: &'static str, failure: Failure) -> CallError {
        self.place.note_failure(CallError { function, failure, messages: self.sink.take() })
    }
}
