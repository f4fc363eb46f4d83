//! The shared library of an FMU: loading, symbols, calls. Only this module of the crate calls C
//! functions of an FMU and passes pointers to them.
#![expect(unsafe_code, reason = "the boundary to C")]

mod base;
mod calls;
mod canary;
mod foreign;
mod functions;
mod load;
mod log;
mod python;
mod states;
mod step;
#[cfg(target_os = "linux")]
mod surroundings;
mod table;
#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
mod unresolved;
pub(crate) mod v1;
pub(crate) mod v3;

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;
use std::sync::Arc;

use fmu_description::Version;
use fmu_description::abi::{
    CO_SIMULATION, DESCRIBE, DESCRIBE_3, DescribeSink, MODEL_EXCHANGE, fmi2CallbackFunctions,
    fmi2Component,
};

use crate::crash::{Place, Slot};
use crate::error::LoadError;
use base::{Base, Loaded, instantiate};
pub(crate) use canary::check_number;
use functions::Functions;
pub use load::preload;
pub(crate) use load::{Binding, Loading};
pub(crate) use log::Names;
use log::Sink;
#[cfg(target_os = "linux")]
pub(crate) use log::log_message;
#[cfg(target_os = "linux")]
pub(crate) use surroundings::Surroundings;

/// Returns the model description of FMI 2.0 that a library exported by `fmu::export!` generates. `resources` is the
/// folder of its resources.
///
/// # Errors
///
/// [`LoadError`] if the library does not load, was not exported by the crate `fmu`
/// ([`LoadError::Missing`]), or rejects `resources` ([`LoadError::Describe`]).
pub fn describe(path: &Path, resources: &Path) -> Result<String, LoadError> {
    describe_as(path, resources, Version::V2)
}

/// Like [`describe`], but the description is of FMI 3.0 if `version` is [`Version::V3`].
pub(crate) fn describe_as(
    path: &Path,
    resources: &Path,
    version: Version,
) -> Result<String, LoadError> {
    unsafe extern "C" fn sink(context: *mut c_void, text: *const c_char, length: usize) {
        // SAFETY: `context` is the buffer below; the library gives `length` bytes.
        unsafe {
            let text = std::slice::from_raw_parts(text.cast::<u8>(), length);
            (*context.cast::<Vec<u8>>()).extend_from_slice(text);
        }
    }
    type Describe = unsafe extern "C" fn(*const c_char, *mut c_void, DescribeSink) -> c_int;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let handle = Loading { path, fmu: &name, binding: Binding::Lenient }.load()?;
    let name = if version == Version::V3 { DESCRIBE_3 } else { DESCRIBE };
    // SAFETY: `fmu::export!` gives this name this signature.
    let describe = unsafe { handle.get::<Describe>(name.as_bytes()) }
        .map_err(|_| LoadError::Missing { path: path.to_owned(), function: name.to_owned() })?;
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

/// Returns the names of the C functions of all versions.
#[cfg(target_os = "linux")]
pub(crate) fn function_names() -> impl Iterator<Item = &'static str> {
    let names =
        [Functions::NAMES, v1::functions::Functions::NAMES, v3::functions::Functions::NAMES];
    names.into_iter().flatten().copied()
}

/// Returns a C string of a text without its NUL characters.
fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

/// Copies the strings that an FMU returned; null is an empty string.
///
/// # Safety
///
/// The pointers are null or point to terminated strings.
unsafe fn copy_strings(pointers: &[*const c_char], values: &mut [String]) {
    for (value, pointer) in values.iter_mut().zip(pointers) {
        value.clear();
        // SAFETY: the caller guarantees it.
        if let Some(text) = unsafe { pointer.as_ref().map(|text| CStr::from_ptr(text)) } {
            value.push_str(&text.to_string_lossy());
        }
    }
}

/// Checks the version of FMI that `get_version` returns; errors call it `function`. The version must start with
/// `expected` without trailing zeros: `2.1` passes as `2.0`. A library may lack the function.
fn check_version(
    path: &Path,
    get_version: Option<unsafe extern "C" fn() -> *const c_char>,
    function: &'static str,
    expected: &'static str,
) -> Result<(), LoadError> {
    let Some(get_version) = get_version else { return Ok(()) };
    // SAFETY: takes no argument and returns null or a static string.
    let version = unsafe { get_version().as_ref().map(|text| CStr::from_ptr(text)) };
    let version = version.map(CStr::to_string_lossy).unwrap_or_default();
    if version.starts_with(expected.trim_end_matches('0')) {
        return Ok(());
    }
    Err(LoadError::Version {
        path: path.to_owned(),
        function,
        actual: version.into_owned(),
        expected,
    })
}

/// `fmi2Type`: the interface of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// `fmi2ModelExchange`: the importer integrates the states.
    ModelExchange,
    /// `fmi2CoSimulation`: the FMU integrates its states.
    CoSimulation,
}

impl Interface {
    fn to_c(self) -> c_int {
        match self {
            Interface::ModelExchange => MODEL_EXCHANGE,
            Interface::CoSimulation => CO_SIMULATION,
        }
    }
}

/// A loaded library with the functions of FMI 2.0.
pub(crate) type Library = Loaded<Functions>;

impl Library {
    /// Loads the library, and checks its version and that it has the required functions of `interface`.
    pub(crate) fn open(
        loading: &Loading<'_>,
        interface: Interface,
    ) -> Result<Arc<Self>, LoadError> {
        Functions::open(loading, "", &functions::required(interface))
    }

    /// Calls `fmi2Instantiate` for `interface`. `resources` is the URI of the resources.
    pub(crate) fn instantiate(
        self: &Arc<Self>,
        interface: Interface,
        name: &str,
        guid: &str,
        resources: &str,
        names: Names,
    ) -> Result<Component, LoadError> {
        const NAME: &str = "fmi2Instantiate";
        let place = Place::new(name);
        let sink = Sink::new(&place, Some(names));
        let callbacks = callbacks(&sink);
        let (c_name, c_guid, c_resources) = (c_string(name), c_string(guid), c_string(resources));
        let kind = interface.to_c();
        let pointer = instantiate(&place, &NAME, &sink, |logging| {
            // SAFETY: terminated strings, callbacks that outlive the instance.
            self.functions.instantiate.map_or(std::ptr::null_mut(), |function| unsafe {
                function(
                    c_name.as_ptr(),
                    kind,
                    c_guid.as_ptr(),
                    c_resources.as_ptr(),
                    Arc::as_ptr(&callbacks),
                    0,
                    logging.into(),
                )
            })
        });
        let slot = place.slot();
        let mut base = Base::new(self, pointer, NAME, place, sink, Version::V2)?;
        base.callbacks = Some(callbacks);
        if interface == Interface::ModelExchange {
            base.functions = self.functions.without_co_simulation();
        }
        let Functions { set_real, do_step, get_real, .. } = base.functions;
        Ok(Component { hot: Hot { pointer, set_real, do_step, get_real, place: slot }, base })
    }
}

/// Returns the callback functions of an instance; `sink` receives its messages.
#[expect(clippy::arc_with_non_send_sync, reason = "see the implementation of Send for Component")]
fn callbacks(sink: &Arc<Sink>) -> Arc<fmi2CallbackFunctions> {
    Arc::new(fmi2CallbackFunctions {
        logger: Some(log::logger()),
        allocate_memory: Some(calloc),
        free_memory: Some(free),
        step_finished: None,
        component_environment: Arc::as_ptr(sink).cast_mut().cast(),
    })
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

/// The pointers that every step needs, in one cache line.
#[repr(C, align(64))]
struct Hot {
    pointer: fmi2Component,
    set_real: Option<functions::SetReal>,
    do_step: Option<functions::DoStep>,
    get_real: Option<functions::GetReal>,
    place: &'static Slot,
}

/// An FMU instance and its C functions. Dropping it calls `fmi2FreeInstance`; the library stays
/// loaded until then.
///
/// Each call returns a [`slave::CallError`] if the library lacks the function, if its status is neither `fmi2OK` nor
/// `fmi2Warning`, or if it writes outside a guarded array ([`Base::guard_arrays`]).
pub(crate) struct Component {
    /// The pointers for [`Component::pass`], which does not record warnings and does not guard arrays.
    hot: Hot,
    pub(crate) base: Base<Functions>,
}

// SAFETY: any thread may use an instance, one at a time (FMI 2.0.5, section 2.1); the pointers lead to
// the instance, its states, and data shared with it through `Arc`.
unsafe impl Send for Component {}

impl Drop for Component {
    fn drop(&mut self) {
        if !self.base.may_be_freed() {
            return;
        }
        self.free_states();
        if let Some(free_instance) = self.base.functions.free_instance {
            self.base.place.enter(&"fmi2FreeInstance");
            // SAFETY: the instance is alive and not used again.
            unsafe { free_instance(self.base.pointer) };
            self.base.place.leave();
        }
    }
}
