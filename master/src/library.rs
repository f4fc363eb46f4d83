//! The shared library of an FMU: loading, symbols, calls. The one place of the crate where C is
//! called and pointers are handed out.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::{CStr, CString, OsStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use fmi2::abi::{
    CO_SIMULATION, DESCRIBE, DescribeSink, Status, fmi2Boolean, fmi2CallbackFunctions,
    fmi2CallbackLogger, fmi2Component, fmi2Integer, fmi2Real, fmi2Status, fmi2String, fmi2Type,
    fmi2ValueReference,
};
use libloading::Library as Handle;

use crate::error::LoadError;
use crate::slave::CallError;

const PYTHON: &str = "\nThe library expects Python to be in the process already, as those that \
    PythonFMU exports do: load it first with --preload, for example --preload libpython3.11.so.1.0";

/// Declares the table of functions and its loading.
macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        #[derive(Clone, Copy)]
        struct Functions { $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)* }

        impl Functions {
            fn load(handle: &Handle, path: &Path) -> Result<Self, LoadError> {
                Ok(Self { $($field: {
                    // SAFETY: the standard gives this name this signature.
                    let symbol = unsafe { handle.get(concat!($name, "\0").as_bytes()) };
                    *symbol.map_err(|_| LoadError::Missing {
                        path: path.to_owned(),
                        function: $name.to_owned(),
                    })?
                },)* })
            }
        }
    };
}

type References = *const fmi2ValueReference;

functions! {
    get_version = "fmi2GetVersion": fn() -> fmi2String;
    instantiate = "fmi2Instantiate": fn(fmi2String, fmi2Type, fmi2String, fmi2String,
        *const fmi2CallbackFunctions, fmi2Boolean, fmi2Boolean) -> fmi2Component;
    free_instance = "fmi2FreeInstance": fn(fmi2Component);
    setup_experiment = "fmi2SetupExperiment": fn(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real,
        fmi2Boolean, fmi2Real) -> fmi2Status;
    enter_initialization_mode = "fmi2EnterInitializationMode": fn(fmi2Component) -> fmi2Status;
    exit_initialization_mode = "fmi2ExitInitializationMode": fn(fmi2Component) -> fmi2Status;
    terminate = "fmi2Terminate": fn(fmi2Component) -> fmi2Status;
    get_real = "fmi2GetReal": fn(fmi2Component, References, usize, *mut fmi2Real) -> fmi2Status;
    get_integer = "fmi2GetInteger":
        fn(fmi2Component, References, usize, *mut fmi2Integer) -> fmi2Status;
    get_boolean = "fmi2GetBoolean":
        fn(fmi2Component, References, usize, *mut fmi2Boolean) -> fmi2Status;
    set_real = "fmi2SetReal": fn(fmi2Component, References, usize, *const fmi2Real) -> fmi2Status;
    set_integer = "fmi2SetInteger":
        fn(fmi2Component, References, usize, *const fmi2Integer) -> fmi2Status;
    set_boolean = "fmi2SetBoolean":
        fn(fmi2Component, References, usize, *const fmi2Boolean) -> fmi2Status;
    set_string = "fmi2SetString":
        fn(fmi2Component, References, usize, *const fmi2String) -> fmi2Status;
    set_real_input_derivatives = "fmi2SetRealInputDerivatives": fn(fmi2Component, References,
        usize, *const fmi2Integer, *const fmi2Real) -> fmi2Status;
    get_real_output_derivatives = "fmi2GetRealOutputDerivatives": fn(fmi2Component, References,
        usize, *const fmi2Integer, *mut fmi2Real) -> fmi2Status;
    do_step = "fmi2DoStep": fn(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean) -> fmi2Status;
}

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

/// A loaded library with the functions of FMI 2.0 co-simulation.
pub(crate) struct Library {
    functions: Functions,
    path: PathBuf,
    _handle: Handle,
}

impl Library {
    /// Loads the library and resolves its functions.
    pub(crate) fn open(path: &Path) -> Result<Self, LoadError> {
        let handle = load(path)?;
        let functions = Functions::load(&handle, path)?;
        // SAFETY: takes no argument and returns a static string.
        let version =
            unsafe { (functions.get_version)().as_ref().map(|text| CStr::from_ptr(text)) };
        let found = version.map(CStr::to_string_lossy).unwrap_or_default();
        if found != "2.0" {
            let found = found.into_owned();
            return Err(LoadError::Version { path: path.to_owned(), found });
        }
        Ok(Self { functions, path: path.to_owned(), _handle: handle })
    }

    /// `fmi2Instantiate` for co-simulation.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        name: &str,
        guid: &str,
        resources: &str,
    ) -> Result<Component, LoadError> {
        let sink = Arc::new(Sink { receive, messages: Mutex::default() });
        // SAFETY: both are pointers to functions; C calls it with the logger's signature.
        let logger = unsafe {
            std::mem::transmute::<unsafe extern "C" fn(), fmi2CallbackLogger>(master_logger)
        };
        let callbacks = Rc::new(fmi2CallbackFunctions {
            logger: Some(logger),
            allocate_memory: Some(calloc),
            free_memory: Some(free),
            step_finished: None,
            component_environment: Arc::as_ptr(&sink).cast_mut().cast(),
        });
        let (c_name, c_guid, c_resources) = (c_string(name), c_string(guid), c_string(resources));
        // SAFETY: terminated strings, callbacks that outlive the instance.
        let pointer = unsafe {
            (self.functions.instantiate)(
                c_name.as_ptr(),
                CO_SIMULATION,
                c_guid.as_ptr(),
                c_resources.as_ptr(),
                Rc::as_ptr(&callbacks),
                0,
                0,
            )
        };
        let component =
            Component { pointer, library: self.clone(), sink, _callbacks: callbacks, ones: vec![] };
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
}

impl Drop for Component {
    fn drop(&mut self) {
        if !self.pointer.is_null() {
            // SAFETY: the instance is alive and not used again.
            unsafe { (self.library.functions.free_instance)(self.pointer) };
        }
    }
}

/// Defines a method for each function: its arguments, and the C arguments made of them.
macro_rules! calls {
    ($($method:ident($($argument:ident: $type:ty),*) = $name:literal($($c:expr),*);)*) => {
        impl Component {
            $(pub(crate) fn $method(&mut self, $($argument: $type),*) -> Result<(), CallError> {
                // SAFETY: the instance is alive; slices that belong together are equally long.
                let status = unsafe { (self.library.functions.$method)(self.pointer, $($c),*) };
                self.check($name, status)
            })*
        }
    };
}

calls! {
    enter_initialization_mode() = "fmi2EnterInitializationMode"();
    exit_initialization_mode() = "fmi2ExitInitializationMode"();
    terminate() = "fmi2Terminate"();
    get_real(references: &[u32], values: &mut [f64]) =
        "fmi2GetReal"(references.as_ptr(), same_length(references, values), values.as_mut_ptr());
    set_real(references: &[u32], values: &[f64]) =
        "fmi2SetReal"(references.as_ptr(), same_length(references, values), values.as_ptr());
    get_integer(references: &[u32], values: &mut [i32]) =
        "fmi2GetInteger"(references.as_ptr(), same_length(references, values), values.as_mut_ptr());
    set_integer(references: &[u32], values: &[i32]) =
        "fmi2SetInteger"(references.as_ptr(), same_length(references, values), values.as_ptr());
    get_boolean(references: &[u32], values: &mut [i32]) =
        "fmi2GetBoolean"(references.as_ptr(), same_length(references, values), values.as_mut_ptr());
    set_boolean(references: &[u32], values: &[i32]) =
        "fmi2SetBoolean"(references.as_ptr(), same_length(references, values), values.as_ptr());
    do_step(time: f64, size: f64) = "fmi2DoStep"(time, size, 1);
}

/// The length that both slices have.
fn same_length<A, B>(references: &[A], values: &[B]) -> usize {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    references.len()
}

impl Component {
    /// `fmi2SetupExperiment`.
    pub(crate) fn setup_experiment(&mut self, e: &fmi2::Experiment) -> Result<(), CallError> {
        let (tolerance, stop) = (e.tolerance.unwrap_or(0.0), e.stop_time.unwrap_or(0.0));
        let (has_tolerance, has_stop) =
            (fmi2Boolean::from(e.tolerance.is_some()), fmi2Boolean::from(e.stop_time.is_some()));
        // SAFETY: the instance is alive.
        let status = unsafe {
            (self.library.functions.setup_experiment)(
                self.pointer,
                has_tolerance,
                tolerance,
                e.start_time,
                has_stop,
                stop,
            )
        };
        self.check("fmi2SetupExperiment", status)
    }

    /// `fmi2SetString` of one variable.
    pub(crate) fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError> {
        let value = c_string(value);
        // SAFETY: the instance is alive; one reference, one terminated string.
        let status = unsafe {
            let pointer = value.as_ptr();
            (self.library.functions.set_string)(
                self.pointer,
                &raw const reference,
                1,
                &raw const pointer,
            )
        };
        self.check("fmi2SetString", status)
    }

    /// `fmi2SetRealInputDerivatives` of first order.
    pub(crate) fn set_input_slopes(&mut self, to: &[u32], slopes: &[f64]) -> Result<(), CallError> {
        self.ones.resize(self.ones.len().max(same_length(to, slopes)), 1);
        let function = self.library.functions.set_real_input_derivatives;
        // SAFETY: the instance is alive; the arrays have `to.len()` elements.
        let status = unsafe {
            function(self.pointer, to.as_ptr(), to.len(), self.ones.as_ptr(), slopes.as_ptr())
        };
        self.check("fmi2SetRealInputDerivatives", status)
    }

    /// `fmi2GetRealOutputDerivatives` of first order.
    pub(crate) fn get_output_slopes(
        &mut self,
        from: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), CallError> {
        self.ones.resize(self.ones.len().max(same_length(from, slopes)), 1);
        let function = self.library.functions.get_real_output_derivatives;
        // SAFETY: the instance is alive; the arrays have `from.len()` elements.
        let status = unsafe {
            function(
                self.pointer,
                from.as_ptr(),
                from.len(),
                self.ones.as_ptr(),
                slopes.as_mut_ptr(),
            )
        };
        self.check("fmi2GetRealOutputDerivatives", status)
    }

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
