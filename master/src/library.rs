//! The shared library of an FMU: loading, symbols, calls. This file and its folder are the one place
//! of the crate where C is called and pointers are handed out.
#![expect(unsafe_code, reason = "the boundary to C")]

mod calls;
mod functions;

use std::ffi::{CStr, CString, OsStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use fmi2::abi::{
    CO_SIMULATION, DESCRIBE, DescribeSink, MODEL_EXCHANGE, Status, fmi2CallbackFunctions,
    fmi2CallbackLogger, fmi2Component, fmi2FMUstate, fmi2Integer, fmi2Status,
};
use libloading::Library as Handle;

use crate::error::LoadError;
use crate::slave::CallError;
use functions::{CoSimulation, Common, Directional, ModelExchange, Snapshot};

const PYTHON: &str = "\nThe library expects Python to be in the process already, as those that \
    PythonFMU exports do: load it first with --preload, for example --preload libpython3.11.so.1.0";

unsafe extern "C" {
    fn master_logger();
}

/// Receives the messages of one instance; begins like `struct sink` of `logger.c`.
#[repr(C)]
struct Sink {
    receive: extern "C" fn(*mut Sink, c_int, *const c_char, *const c_char),
    messages: Mutex<Vec<String>>,
}

extern "C" fn receive(sink: *mut Sink, _: c_int, _: *const c_char, text: *const c_char) {
    // SAFETY: the logger hands back the sink that `Component` owns, and a terminated text.
    let (sink, text) = unsafe { (&*sink, CStr::from_ptr(text)) };
    if let Ok(mut messages) = sink.messages.lock() {
        messages.push(text.to_string_lossy().into_owned());
    }
}

/// What the operating system says.
fn reason(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}

fn load(path: &Path) -> Result<Handle, LoadError> {
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    unsafe { Handle::new(path) }.map_err(|error| {
        let message = reason(&error);
        let python = message
            .split("undefined symbol: ")
            .nth(1)
            .is_some_and(|symbol| symbol.trim_start_matches('_').starts_with("Py"));
        let hint = if python { PYTHON } else { "" };
        LoadError::Refused { path: path.to_owned(), message, hint }
    })
}

/// Loads `library` for the rest of the process, on Unix with its symbols visible to all that come
/// later.
///
/// # Errors
///
/// [`LoadError::Refused`] where the operating system does not find or accept it.
pub fn preload(library: &OsStr) -> Result<(), LoadError> {
    #[cfg(unix)]
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    let opened = unsafe {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};
        Library::open(Some(library), RTLD_NOW | RTLD_GLOBAL)
    };
    #[cfg(not(unix))]
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    let opened = unsafe { Handle::new(library) };
    match opened {
        Ok(handle) => {
            std::mem::forget(handle);
            Ok(())
        }
        Err(error) => Err(LoadError::Refused {
            path: PathBuf::from(library),
            message: reason(&error),
            hint: "",
        }),
    }
}

/// Asks the library at `path`, which `fmi2::export!` made, for its model description.
///
/// # Errors
///
/// Where it cannot be loaded, was not made by `fmi2`, or refuses `resources`.
pub fn describe(path: &Path, resources: &Path) -> Result<String, LoadError> {
    unsafe extern "C" fn sink(context: *mut c_void, text: *const c_char, length: usize) {
        // SAFETY: `context` is the buffer below; the library gives `length` bytes.
        unsafe {
            let text = std::slice::from_raw_parts(text.cast::<u8>(), length);
            (*context.cast::<Vec<u8>>()).extend_from_slice(text);
        }
    }
    type Describe = unsafe extern "C" fn(*const c_char, *mut c_void, DescribeSink) -> c_int;
    let handle = load(path)?;
    // SAFETY: `fmi2::export!` gives this name this signature.
    let describe = unsafe { handle.get::<Describe>(DESCRIBE.as_bytes()) }
        .map_err(|_| LoadError::Missing { path: path.to_owned(), function: DESCRIBE.to_owned() })?;
    let folder = c_string(&resources.display().to_string());
    let mut text = Vec::<u8>::new();
    // SAFETY: a terminated path, and a sink that fits its context.
    let status = unsafe { describe(folder.as_ptr(), (&raw mut text).cast(), sink) };
    let text = String::from_utf8_lossy(&text).into_owned();
    if status == 0 {
        Ok(text)
    } else {
        Err(LoadError::Describe { path: path.to_owned(), message: text })
    }
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

/// The callback of `logger.c`.
fn logger() -> fmi2CallbackLogger {
    // SAFETY: both are pointers to functions; C calls it with the logger's signature.
    unsafe { std::mem::transmute::<unsafe extern "C" fn(), fmi2CallbackLogger>(master_logger) }
}

/// `fmi2Type`: what an instance is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// `fmi2ModelExchange`: the master integrates the states.
    ModelExchange,
    /// `fmi2CoSimulation`: the FMU integrates its states.
    CoSimulation,
}

/// A loaded library with the functions of FMI 2.0.
pub(crate) struct Library {
    common: Common,
    simulation: Option<CoSimulation>,
    exchange: Option<ModelExchange>,
    snapshot: Option<Snapshot>,
    directional: Option<Directional>,
    path: PathBuf,
    _handle: Handle,
}

impl Library {
    /// Loads the library and resolves the functions: those of `interface` must be there.
    pub(crate) fn open(path: &Path, interface: Interface) -> Result<Self, LoadError> {
        let handle = load(path)?;
        let common = Common::load(&handle, path)?;
        // SAFETY: takes no argument and returns a static string.
        let version = unsafe { (common.get_version)().as_ref().map(|text| CStr::from_ptr(text)) };
        let found = version.map(CStr::to_string_lossy).unwrap_or_default();
        if found != "2.0" {
            let found = found.into_owned();
            return Err(LoadError::Version { path: path.to_owned(), found });
        }
        let simulation = CoSimulation::load(&handle, path);
        let exchange = ModelExchange::load(&handle, path);
        let (simulation, exchange) = match interface {
            Interface::CoSimulation => (Some(simulation?), exchange.ok()),
            Interface::ModelExchange => (simulation.ok(), Some(exchange?)),
        };
        Ok(Self {
            common,
            simulation,
            exchange,
            snapshot: Snapshot::load(&handle, path).ok(),
            directional: Directional::load(&handle, path).ok(),
            path: path.to_owned(),
            _handle: handle,
        })
    }

    /// `fmi2Instantiate` for `interface`.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        interface: Interface,
        name: &str,
        guid: &str,
        resources: &str,
    ) -> Result<Component, LoadError> {
        let sink = Arc::new(Sink { receive, messages: Mutex::default() });
        let callbacks = Rc::new(fmi2CallbackFunctions {
            logger: Some(logger()),
            allocate_memory: Some(calloc),
            free_memory: Some(free),
            step_finished: None,
            component_environment: Arc::as_ptr(&sink).cast_mut().cast(),
        });
        let (c_name, c_guid, c_resources) = (c_string(name), c_string(guid), c_string(resources));
        let kind = match interface {
            Interface::ModelExchange => MODEL_EXCHANGE,
            Interface::CoSimulation => CO_SIMULATION,
        };
        // SAFETY: terminated strings, callbacks that outlive the instance.
        let pointer = unsafe {
            (self.common.instantiate)(
                c_name.as_ptr(),
                kind,
                c_guid.as_ptr(),
                c_resources.as_ptr(),
                Rc::as_ptr(&callbacks),
                0,
                0,
            )
        };
        let component = Component {
            pointer,
            library: self.clone(),
            sink,
            _callbacks: callbacks,
            ones: vec![],
            saved: std::ptr::null_mut(),
        };
        if pointer.is_null() {
            let reason = component.messages().join("; ");
            let (path, instance) = (self.path.clone(), name.to_owned());
            return Err(LoadError::Instantiate { path, instance, reason });
        }
        Ok(component)
    }
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

/// An instance, freed with its last use; the library stays loaded as long.
pub(crate) struct Component {
    pointer: fmi2Component,
    library: Arc<Library>,
    /// Shared with the FMU, which has their addresses.
    sink: Arc<Sink>,
    _callbacks: Rc<fmi2CallbackFunctions>,
    /// First order, as often as needed.
    ones: Vec<fmi2Integer>,
    /// The FMU state that `save` keeps; null before.
    saved: fmi2FMUstate,
}

impl Drop for Component {
    fn drop(&mut self) {
        if self.pointer.is_null() {
            return;
        }
        if let (Some(snapshot), false) = (&self.library.snapshot, self.saved.is_null()) {
            // SAFETY: the instance is alive, the state is its own.
            unsafe { (snapshot.free)(self.pointer, &raw mut self.saved) };
        }
        // SAFETY: the instance is alive and not used again.
        unsafe { (self.library.common.free_instance)(self.pointer) };
    }
}

impl Component {
    /// The messages since this was last asked.
    fn messages(&self) -> Vec<String> {
        self.sink.messages.lock().map(|mut list| std::mem::take(&mut *list)).unwrap_or_default()
    }

    fn check(&self, function: &'static str, status: fmi2Status) -> Result<(), CallError> {
        if status == Status::OK as fmi2Status || status == Status::Warning as fmi2Status {
            return Ok(());
        }
        let messages = self.messages();
        Err(CallError { function, status: Status::from_c(status), messages })
    }
}
