//! The C ABI of an exported model: the only module of the crate that dereferences pointers.
//!
//! Every entry point with an instance calls `dispatch`, which calls safe code.
#![expect(unsafe_code, reason = "the boundary to C")]

mod entry;
mod exports;
pub mod fmi3;

use std::cell::UnsafeCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use fmu_description::abi::{
    self, DescribeSink, Status, fmi2Boolean, fmi2CallbackFunctions, fmi2Component, fmi2FMUstate,
    fmi2Integer, fmi2Status, fmi2String, fmi2Type,
};

pub use entry::*;
pub use exports::signature;

use crate::callbacks::Callbacks;
use crate::fence::{HookGuard, guarded};
use crate::instance::{Function, Instance, Snapshot};
use crate::model::{Failure, Model};
use crate::room::Room;
use fmu_description::ModelDescription;
use fmu_description::call_order::InterfaceType;
use fmu_description::location::{NO_FOLDER, path_from_uri};

/// Asks the importer to set the inputs at the middle and the end of the coming step of `fmi3DoStep`, if the importer
/// uses intermediate update ([`Instance::begin_intermediate`]). During the callbacks `busy` is false, so that the
/// importer can set inputs.
unsafe fn ask_for_inputs<M: Model>(component: fmi2Component, start: f64, size: f64) {
    // SAFETY: a component that is not null is one that `instantiate` made for this `M`.
    let Some(component) = (unsafe { component.cast::<Component<M>>().as_ref() }) else { return };
    if component.busy.load(Ordering::Relaxed) || component.asking.load(Ordering::Relaxed) {
        return;
    }
    // SAFETY: `busy` is false, and the reference does not outlive the statement.
    let Some(update) = (unsafe { &mut *component.instance.get() }).begin_intermediate(size) else {
        return;
    };
    component.asking.store(true, Ordering::Relaxed);
    for (place, time) in [(1, start + 0.5 * size), (2, start + size)] {
        update.ask(time);
        // SAFETY: as above.
        unsafe { &mut *component.instance.get() }.record_intermediate(place);
    }
    component.asking.store(false, Ordering::Relaxed);
    // SAFETY: as above.
    unsafe { &mut *component.instance.get() }.end_intermediate(size);
}

/// The target of `fmi2Component` and `fmi3Instance`: an instance that allows one call at a time.
struct Component<M: Model> {
    busy: AtomicBool,
    /// Whether the importer is setting inputs within a step: the instance must not be freed then.
    asking: AtomicBool,
    instance: UnsafeCell<Instance<M>>,
}

/// Runs a call of an instance: checks for null and for a call in progress, then calls
/// [`Instance::call`] (call order, panic fence, message and status).
///
/// A call from a callback during another call of the same instance returns an error without effect
/// (for a synchronous slave this is the state stepInProgress). Simultaneous calls from several threads,
/// which section 2.1 forbids, are detected in most cases only: an atomic exchange would double the
/// cost of reading one value.
unsafe fn dispatch<M: Model, F: Function>(
    component: fmi2Component,
    function: F,
    body: impl FnOnce(&mut Instance<M>) -> Result<(), Failure>,
) -> fmi2Status {
    // SAFETY: a component that is not null is one that `instantiate` made for this `M`.
    let Some(component) = (unsafe { component.cast::<Component<M>>().as_ref() }) else {
        return Status::Error as fmi2Status;
    };
    if component.busy.load(Ordering::Relaxed) {
        return Status::Error as fmi2Status;
    }
    component.busy.store(true, Ordering::Relaxed);
    // SAFETY: one thread at a time uses an instance (section 2.1); `busy` was false, so this
    // thread is not inside another call.
    let status = unsafe { &mut *component.instance.get() }.call(function, body);
    component.busy.store(false, Ordering::Relaxed);
    status as fmi2Status
}

fn null_pointer(what: &str) -> Failure {
    Failure::Error(format!("{what} is null or misaligned"))
}

/// Borrows `count` elements to read; the pointer may be null if `count` is 0.
unsafe fn read<'a, T>(pointer: *const T, count: usize) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() || !pointer.is_aligned() || count > isize::MAX as usize / size_of::<T>() {
        return Err(null_pointer("an array to read"));
    }
    // SAFETY: not null, aligned, and the caller gives `count` elements.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Borrows memory for `count` elements, possibly uninitialised; the pointer may be null if `count` is
/// 0.
unsafe fn borrow_output<'a, T>(pointer: *mut T, count: usize) -> Result<&'a mut Room<T>, Failure> {
    if count == 0 {
        return Ok(&mut []);
    }
    if pointer.is_null() || !pointer.is_aligned() || count > isize::MAX as usize / size_of::<T>() {
        return Err(null_pointer("an array to write"));
    }
    // SAFETY: not null, aligned, and the caller provides memory for `count` elements, which may be
    // uninitialised.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), count) })
}

/// Borrows the importer's FMU state pointer, which the importer has initialised (section 2.1.8).
unsafe fn borrow_state<'a>(pointer: *mut fmi2FMUstate) -> Result<&'a mut fmi2FMUstate, Failure> {
    if !pointer.is_aligned() {
        return Err(null_pointer("FMUstate"));
    }
    // SAFETY: null or aligned, and initialised by the importer.
    unsafe { pointer.as_mut() }.ok_or_else(|| null_pointer("FMUstate"))
}

/// Returns the snapshot to which an FMU state points; an error for null.
unsafe fn snapshot<'a, M: Model>(state: fmi2FMUstate) -> Result<&'a Snapshot<M>, Failure> {
    // SAFETY: a state that is not null is a snapshot that this library made.
    unsafe { state.cast::<Snapshot<M>>().as_ref() }.ok_or_else(|| null_pointer("FMUstate"))
}

/// Overwrites the snapshot to which the FMU state in `place` points; allocates a snapshot if the state is null.
unsafe fn store<M: Model>(place: &mut fmi2FMUstate, snapshot: Snapshot<M>) {
    // SAFETY: a state that is not null is a snapshot that this library made.
    if let Some(old) = unsafe { place.cast::<Snapshot<M>>().as_mut() } {
        *old = snapshot;
    } else {
        *place = Box::into_raw(Box::new(snapshot)).cast();
    }
}

/// Frees the snapshot in `place`, if there is one, and sets the FMU state to null.
unsafe fn free_state<M: Model>(place: &mut fmi2FMUstate) {
    if !place.is_null() {
        let state = std::mem::replace(place, std::ptr::null_mut());
        // SAFETY: a state that is not null is a snapshot that this library made.
        drop(unsafe { Box::from_raw(state.cast::<Snapshot<M>>()) });
    }
}

/// Copies a string; an error for null or invalid UTF-8.
unsafe fn text(pointer: fmi2String, what: &str) -> Result<String, Failure> {
    if pointer.is_null() {
        return Err(null_pointer(what));
    }
    // SAFETY: not null, and zero-terminated by the standard.
    let text = unsafe { CStr::from_ptr(pointer) };
    let utf8 = text.to_str().map_err(|_| Failure::Error(format!("{what} is not UTF-8")))?;
    Ok(utf8.to_owned())
}

unsafe fn texts(pointer: *const fmi2String, count: usize) -> Result<Vec<String>, Failure> {
    // SAFETY: the caller gives `count` strings.
    unsafe { read(pointer, count)?.iter().map(|&pointer| text(pointer, "a string")).collect() }
}

unsafe fn write_one<T>(target: *mut T, value: T) -> Result<(), Failure> {
    // SAFETY: the caller gives a place for one value.
    unsafe { borrow_output(target, 1)?[0].write(value) };
    Ok(())
}

#[must_use]
pub fn types_platform<M: Model>() -> fmi2String {
    abi::TYPES_PLATFORM.as_ptr()
}

#[must_use]
pub fn version<M: Model>() -> fmi2String {
    abi::VERSION.as_ptr()
}

/// Copies the path or URI of a folder; `None` for null or an empty text.
unsafe fn folder(pointer: fmi2String, what: &str) -> Result<Option<String>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, and zero-terminated by the standard.
    Ok(Some(unsafe { text(pointer, what)? }).filter(|folder| !folder.is_empty()))
}

/// Returns the folder named by `fmuResourceLocation`; [`NO_FOLDER`] for null or an empty text, an error for a text that
/// is no URI of a file.
unsafe fn resources(location: fmi2String) -> Result<PathBuf, Failure> {
    // SAFETY: null or zero-terminated by the standard.
    match unsafe { folder(location, "fmuResourceLocation")? } {
        None => Ok(PathBuf::from(NO_FOLDER)),
        Some(uri) => path_from_uri(&uri)
            .map_err(|error| Failure::Error(format!("fmuResourceLocation: {error}"))),
    }
}

#[must_use]
pub unsafe fn instantiate<M: Model>(
    instance_name: fmi2String,
    fmu_type: fmi2Type,
    guid: fmi2String,
    resource_location: fmi2String,
    functions: *const fmi2CallbackFunctions,
    _visible: fmi2Boolean,
    logging_on: fmi2Boolean,
) -> fmi2Component {
    // SAFETY: the callbacks are readable during this call; only a copy is kept.
    let Ok([functions]) = (unsafe { read(functions, 1) }) else { return std::ptr::null_mut() };
    let functions = *functions;
    let mut callbacks = Callbacks::Version2 { functions, instance_name: CString::default() };
    // SAFETY: strings as the standard demands them.
    let instance = unsafe { text(instance_name, "instanceName") }.and_then(|name| {
        if name.is_empty() {
            return Err(Failure::Error("instanceName is empty".to_owned()));
        }
        let instance_name = CString::new(name).unwrap_or_default();
        callbacks = Callbacks::Version2 { functions, instance_name };
        let interface_type = match fmu_type {
            abi::MODEL_EXCHANGE => InterfaceType::ModelExchange,
            abi::CO_SIMULATION => InterfaceType::CoSimulation,
            other => {
                return Err(Failure::Error(format!(
                    "fmuType is {other}, expected fmi2ModelExchange (0) or fmi2CoSimulation (1)"
                )));
            }
        };
        // SAFETY: strings as the standard demands them.
        let (guid, folder) = unsafe { (text(guid, "fmuGUID")?, resources(resource_location)?) };
        let mut instance = Instance::<M>::new(interface_type, &folder, &guid, callbacks.clone())?;
        instance.set_logging_on(logging_on != 0);
        Ok(instance)
    });
    into_component("fmi2Instantiate", instance, &callbacks)
}

/// Passes an instance to the importer, or logs why `function` failed and returns null.
fn into_component<M: Model>(
    function: &str,
    instance: Result<Instance<M>, Failure>,
    callbacks: &Callbacks,
) -> fmi2Component {
    let mut instance = match instance {
        Ok(instance) => instance,
        Err(failure) => {
            callbacks.log(Status::Error, "logStatusError", &format!("{function}: {failure}"));
            return std::ptr::null_mut();
        }
    };
    instance.send_messages();
    let instance = UnsafeCell::new(instance);
    Box::into_raw(Box::new(Component {
        busy: AtomicBool::new(false),
        asking: AtomicBool::new(false),
        instance,
    }))
    .cast()
}

/// Frees the instance. Does nothing for null, during another call of the instance (stepInProgress), and while the
/// importer sets inputs within a step.
pub unsafe fn free_instance<M: Model>(component: fmi2Component) {
    let component = component.cast::<Component<M>>();
    // SAFETY: a component that is not null is one that `instantiate` made for this `M`.
    let Some(shared) = (unsafe { component.as_ref() }) else { return };
    if !shared.busy.load(Ordering::Relaxed) && !shared.asking.load(Ordering::Relaxed) {
        shared.busy.store(true, Ordering::Relaxed);
        // SAFETY: not in use and, by the standard, freed once. `busy` stays set while `free` logs a
        // panic of a destructor, because the logger may call the instance.
        unsafe {
            shared.instance.get().read().free();
            drop(Box::from_raw(component.cast::<MaybeUninit<Component<M>>>()));
        }
    }
}

/// Renders a description. An error if the description breaks rules of the standard.
fn render(description: &ModelDescription) -> Result<String, Failure> {
    let problems = description.problems();
    if problems.is_empty() {
        return Ok(description.to_xml());
    }
    let list: Vec<_> = problems.iter().map(ToString::to_string).collect();
    Err(Failure::Error(format!("the model's variables break rules: {}", list.join("; "))))
}

/// Passes the model description that `make` returns, or an error message, to `sink`. Returns 0 for a description and 1
/// for an error.
unsafe fn pass_description(
    resources: *const c_char,
    context: *mut c_void,
    sink: DescribeSink,
    make: impl FnOnce(&Path) -> Result<ModelDescription, Failure>,
) -> fmi2Integer {
    let hook_guard = HookGuard::new();
    // SAFETY: the caller gives a zero-terminated path.
    let described = unsafe { text(resources, "resources") }.and_then(|folder| {
        let folder = if folder.is_empty() { NO_FOLDER } else { &folder };
        guarded(|| make(Path::new(folder)).and_then(|description| render(&description)))
    });
    drop(hook_guard);
    let (status, answer) = match described {
        Ok(xml) => (0, xml),
        Err(failure) => (1, failure.to_string()),
    };
    // SAFETY: the caller gives a sink that reads the text during the call.
    unsafe { sink(context, answer.as_ptr().cast(), answer.len()) };
    status
}

/// [`abi::DESCRIBE`]: passes the model description of FMI 2.0, or an error message, to `sink`.
pub unsafe fn describe<M: Model>(
    resources: *const c_char,
    context: *mut c_void,
    sink: DescribeSink,
) -> fmi2Integer {
    // SAFETY: the arguments are passed on unchanged.
    unsafe { pass_description(resources, context, sink, crate::interface::describe::<M>) }
}
