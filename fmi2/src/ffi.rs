//! The C ABI of an exported model: the one place of the crate where pointers are followed.
//!
//! Every entry point that has an instance goes through `door`; what stands behind it is safe.
#![expect(unsafe_code, reason = "the boundary to C")]

mod exports;

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::{Path, PathBuf};

use crate::abi::{
    self, DescribeSink, Status, StatusKind, fmi2Boolean, fmi2Byte, fmi2CallbackFunctions,
    fmi2Component, fmi2FMUstate, fmi2Integer, fmi2Real, fmi2Status, fmi2StatusKind, fmi2String,
    fmi2Type, fmi2ValueReference,
};
use crate::call_order::Function;
use crate::instance::{Instance, Snapshot, guarded};
use crate::interface::Interface;
use crate::location::path_from_uri;
use crate::model::{Experiment, Failure, Model};

/// What an instance keeps of the importer's callbacks.
#[derive(Clone)]
pub(crate) struct Callbacks {
    functions: fmi2CallbackFunctions,
    instance_name: CString,
}

// SAFETY: the standard has the environment's callbacks usable from whatever thread calls the FMU;
// the instance only hands the environment pointer back.
unsafe impl Send for Callbacks {}

impl Callbacks {
    /// No importer behind it.
    #[cfg(test)]
    pub(crate) fn silent() -> Self {
        let functions = fmi2CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: std::ptr::null_mut(),
        };
        Self { functions, instance_name: CString::default() }
    }

    /// Hands a message to the importer's logger, once formatted: the format string is `%s`, and
    /// `#`, by which the standard marks value references, is doubled.
    pub(crate) fn log(&self, status: Status, category: &str, message: &str) {
        let Some(logger) = self.functions.logger else { return };
        let c_string = |text: &str| CString::new(text.replace('\0', "")).unwrap_or_default();
        let (category, message) = (c_string(category), c_string(&message.replace('#', "##")));
        // SAFETY: the logger has this signature by the standard; all strings outlive the call.
        unsafe {
            logger(
                self.functions.component_environment,
                self.instance_name.as_ptr(),
                status as fmi2Status,
                category.as_ptr(),
                c"%s".as_ptr(),
                message.as_ptr(),
            );
        }
    }
}

/// Null check, call order, panic fence, error to message and status: see [`Instance::call`].
unsafe fn door<M: Model>(
    component: fmi2Component,
    function: Function,
    body: impl FnOnce(&mut Instance<M>) -> Result<(), Failure>,
) -> fmi2Status {
    // SAFETY: a component that is not null is an instance that `instantiate` made for this `M`.
    let instance = unsafe { component.cast::<Instance<M>>().as_mut() };
    instance.map_or(Status::Error, |instance| instance.call(function, body)) as fmi2Status
}

fn missing(what: &str) -> Failure {
    Failure::Error(format!("{what} is null or misaligned"))
}

/// `count` elements to read; a null pointer is fine when there are none.
unsafe fn read<'a, T>(pointer: *const T, count: usize) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() || !pointer.is_aligned() || count > isize::MAX as usize / size_of::<T>() {
        return Err(missing("an array to read"));
    }
    // SAFETY: not null, aligned, and the caller gives `count` elements.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// `count` elements to write; a null pointer is fine when there are none.
unsafe fn write<'a, T>(pointer: *mut T, count: usize) -> Result<&'a mut [T], Failure> {
    if count == 0 {
        return Ok(&mut []);
    }
    if pointer.is_null() || !pointer.is_aligned() || count > isize::MAX as usize / size_of::<T>() {
        return Err(missing("an array to write"));
    }
    // SAFETY: not null, aligned, and the caller gives `count` elements.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

unsafe fn text(pointer: fmi2String, what: &str) -> Result<String, Failure> {
    if pointer.is_null() {
        return Err(missing(what));
    }
    // SAFETY: not null, and zero-terminated by the standard.
    let text = unsafe { CStr::from_ptr(pointer) };
    let utf8 = text.to_str().map_err(|_| Failure::Error(format!("{what} is not UTF-8")))?;
    Ok(utf8.to_owned())
}

unsafe fn texts(pointer: *const fmi2String, count: usize) -> Result<Vec<String>, Failure> {
    // SAFETY: the caller gives `count` strings.
    unsafe { read(pointer, count)?.iter().map(|&each| text(each, "a string")).collect() }
}

unsafe fn put<T>(target: *mut T, value: T) -> Result<(), Failure> {
    // SAFETY: the caller gives a place for one value.
    unsafe { write(target, 1)?[0] = value };
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

/// The folder that `fmuResourceLocation` names; an empty path when it is null or empty.
unsafe fn resources(location: fmi2String) -> Result<PathBuf, Failure> {
    if location.is_null() {
        return Ok(PathBuf::new());
    }
    // SAFETY: not null, and zero-terminated by the standard.
    let uri = unsafe { text(location, "fmuResourceLocation")? };
    if uri.is_empty() {
        return Ok(PathBuf::new());
    }
    path_from_uri(&uri).map_err(|error| Failure::Error(format!("fmuResourceLocation: {error}")))
}

#[must_use]
pub unsafe fn instantiate<M: Model>(
    instance_name: fmi2String,
    fmu_type: fmi2Type,
    guid: fmi2String,
    resource_location: fmi2String,
    functions: *const fmi2CallbackFunctions,
    _visible: fmi2Boolean,
    _logging_on: fmi2Boolean,
) -> fmi2Component {
    silence_panics();
    // SAFETY: the callbacks are readable during this call; only a copy is kept.
    let Ok([functions]) = (unsafe { read(functions, 1) }) else { return std::ptr::null_mut() };
    let mut callbacks = Callbacks { functions: *functions, instance_name: CString::default() };
    // SAFETY: strings as the standard demands them.
    let made = unsafe { text(instance_name, "instanceName") }.and_then(|name| {
        callbacks.instance_name = CString::new(name).unwrap_or_default();
        if callbacks.instance_name.is_empty() {
            return Err(Failure::Error("instanceName is empty".to_owned()));
        }
        if fmu_type != abi::CO_SIMULATION {
            let message = "fmuType is not fmi2CoSimulation, which is all this FMU offers";
            return Err(Failure::Error(message.to_owned()));
        }
        // SAFETY: strings as the standard demands them.
        let (guid, folder) = unsafe { (text(guid, "fmuGUID")?, resources(resource_location)?) };
        Instance::<M>::new(&folder, &guid, callbacks.clone())
    });
    match made {
        Ok(instance) => Box::into_raw(Box::new(instance)).cast(),
        Err(failure) => {
            let message = format!("fmi2Instantiate: {failure}");
            callbacks.log(Status::Error, "logStatusError", &message);
            std::ptr::null_mut()
        }
    }
}

pub unsafe fn free_instance<M: Model>(component: fmi2Component) {
    if !component.is_null() {
        // SAFETY: made by `instantiate` for this `M` and, by the standard, freed once.
        let instance = unsafe { Box::from_raw(component.cast::<Instance<M>>()) };
        drop(guarded(|| {
            drop(instance);
            Ok(())
        }));
    }
}

/// Defines functions that pass through the door: C arguments, then what happens behind it.
macro_rules! behind_the_door {
    ($($name:ident = $function:ident($($argument:ident: $type:ty),*), $instance:ident => $body:expr;)*) => {
        $(pub unsafe fn $name<M: Model>(component: fmi2Component, $($argument: $type),*) -> fmi2Status {
            // SAFETY: pointers and lengths are as the standard demands them; null is handled.
            unsafe { door::<M>(component, Function::$function, |$instance| $body) }
        })*
    };
}

behind_the_door! {
    set_debug_logging = SetDebugLogging(_on: fmi2Boolean, n: usize, categories: *const fmi2String),
        instance => instance.set_debug_logging(texts(categories, n)?);
    setup_experiment = SetupExperiment(
        tolerance_defined: fmi2Boolean, tolerance: fmi2Real, start_time: fmi2Real,
        stop_time_defined: fmi2Boolean, stop_time: fmi2Real
    ), instance => instance.setup_experiment(Experiment {
        start_time,
        stop_time: (stop_time_defined != 0).then_some(stop_time),
        tolerance: (tolerance_defined != 0).then_some(tolerance),
    });
    enter_initialization_mode = EnterInitializationMode(),
        instance => instance.enter_initialization_mode();
    exit_initialization_mode = ExitInitializationMode(),
        instance => instance.exit_initialization_mode();
    terminate = Terminate(), instance => { instance.terminate(); Ok(()) };
    reset = Reset(), instance => { instance.reset(); Ok(()) };
    get_real = GetReal(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Real),
        instance => instance.get_real(read(vr, n)?, write(value, n)?);
    get_integer = GetInteger(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Integer),
        instance => instance.get_integer(read(vr, n)?, write(value, n)?);
    get_boolean = GetBoolean(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2Boolean),
        instance => instance.get_boolean(read(vr, n)?, write(value, n)?);
    get_string = GetString(vr: *const fmi2ValueReference, n: usize, value: *mut fmi2String),
        instance => instance.get_string(read(vr, n)?, write(value, n)?);
    set_real = SetReal(vr: *const fmi2ValueReference, n: usize, value: *const fmi2Real),
        instance => instance.set_real(read(vr, n)?, read(value, n)?);
    set_integer = SetInteger(vr: *const fmi2ValueReference, n: usize, value: *const fmi2Integer),
        instance => instance.set_integer(read(vr, n)?, read(value, n)?);
    set_boolean = SetBoolean(vr: *const fmi2ValueReference, n: usize, value: *const fmi2Boolean),
        instance => instance.set_boolean(read(vr, n)?, read(value, n)?);
    set_string = SetString(vr: *const fmi2ValueReference, n: usize, value: *const fmi2String),
        instance => instance.set_string(read(vr, n)?, &texts(value, n)?);
    set_real_input_derivatives = SetRealInputDerivatives(
        vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer, value: *const fmi2Real
    ), instance => instance.set_real_input_derivatives(read(vr, n)?, read(order, n)?, read(value, n)?);
    get_real_output_derivatives = GetRealOutputDerivatives(
        vr: *const fmi2ValueReference, n: usize, order: *const fmi2Integer, value: *mut fmi2Real
    ), instance => instance.get_real_output_derivatives(read(vr, n)?, read(order, n)?, write(value, n)?);
    do_step = DoStep(start: fmi2Real, size: fmi2Real, _no_set_fmu_state: fmi2Boolean),
        instance => instance.do_step(start, size);
    cancel_step = CancelStep(), _instance => Ok(());
    get_directional_derivative = GetDirectionalDerivative(
        _unknown: *const fmi2ValueReference, _n_unknown: usize,
        _known: *const fmi2ValueReference, _n_known: usize,
        _known_delta: *const fmi2Real, _unknown_delta: *mut fmi2Real
    ), _instance => Err(Failure::Error(
        "not offered: providesDirectionalDerivative is false".to_owned()
    ));
    get_fmu_state = GetFMUstate(state: *mut fmi2FMUstate), instance => {
        let [place] = write(state, 1)? else { return Err(missing("FMUstate")) };
        if let Some(snapshot) = place.cast::<Snapshot<M>>().as_mut() {
            *snapshot = instance.snapshot();
        } else {
            *place = Box::into_raw(Box::new(instance.snapshot())).cast();
        }
        Ok(())
    };
    set_fmu_state = SetFMUstate(state: fmi2FMUstate), instance =>
        instance.restore(state.cast::<Snapshot<M>>().as_ref().ok_or_else(|| missing("FMUstate"))?);
    free_fmu_state = FreeFMUstate(state: *mut fmi2FMUstate), _instance => {
        let [place] = write(state, 1)? else { return Err(missing("FMUstate")) };
        if !place.is_null() {
            drop(Box::from_raw(place.cast::<Snapshot<M>>()));
            *place = std::ptr::null_mut();
        }
        Ok(())
    };
    serialized_fmu_state_size = SerializedFMUstateSize(state: fmi2FMUstate, size: *mut usize),
        _instance => {
            let state = state.cast::<Snapshot<M>>().as_ref().ok_or_else(|| missing("FMUstate"))?;
            put(size, state.to_bytes()?.len())
        };
    serialize_fmu_state = SerializeFMUstate(state: fmi2FMUstate, bytes: *mut fmi2Byte, size: usize),
        _instance => {
            let state = state.cast::<Snapshot<M>>().as_ref().ok_or_else(|| missing("FMUstate"))?;
            let serialized = state.to_bytes()?;
            write(bytes.cast::<u8>(), size)?
                .get_mut(..serialized.len())
                .ok_or_else(|| Failure::Error(format!(
                    "{size} bytes given, {} needed", serialized.len()
                )))?
                .copy_from_slice(&serialized);
            Ok(())
        };
    de_serialize_fmu_state = DeSerializeFMUstate(
        bytes: *const fmi2Byte, size: usize, state: *mut fmi2FMUstate
    ), instance => {
        let snapshot = Snapshot::<M>::from_bytes(read(bytes.cast::<u8>(), size)?, instance.guid())?;
        let [place] = write(state, 1)? else { return Err(missing("FMUstate")) };
        if let Some(old) = place.cast::<Snapshot<M>>().as_mut() {
            *old = snapshot;
        } else {
            *place = Box::into_raw(Box::new(snapshot)).cast();
        }
        Ok(())
    };
    get_status = GetStatus(kind: fmi2StatusKind, _value: *mut fmi2Status),
        _instance => Err(unavailable(kind));
    get_real_status = GetRealStatus(kind: fmi2StatusKind, value: *mut fmi2Real), instance =>
        if kind == StatusKind::LastSuccessfulTime as fmi2StatusKind {
            put(value, instance.last_successful_time())
        } else {
            Err(unavailable(kind))
        };
    get_integer_status = GetIntegerStatus(kind: fmi2StatusKind, _value: *mut fmi2Integer),
        _instance => Err(unavailable(kind));
    get_boolean_status = GetBooleanStatus(kind: fmi2StatusKind, value: *mut fmi2Boolean),
        _instance => if kind == StatusKind::Terminated as fmi2StatusKind {
            put(value, 0)
        } else {
            Err(unavailable(kind))
        };
    get_string_status = GetStringStatus(kind: fmi2StatusKind, _value: *mut fmi2String),
        _instance => Err(unavailable(kind));
}

/// A status that a synchronous slave cannot give is answered by `fmi2Discard` (section 4.2.3).
fn unavailable(kind: fmi2StatusKind) -> Failure {
    Failure::Discard(format!("no step is pending, the status kind {kind} cannot be given"))
}

/// The description of `M`, which must break no rule of the standard.
fn description_of<M: Model>(resources: &Path) -> Result<String, Failure> {
    let (_, description) = Interface::new(&mut M::new(resources)?)?;
    let problems = description.problems();
    if problems.is_empty() {
        return Ok(description.to_xml());
    }
    let list: Vec<_> = problems.iter().map(ToString::to_string).collect();
    Err(Failure::Error(format!("the model's variables break rules: {}", list.join("; "))))
}

/// [`abi::DESCRIBE`]: gives the model description, or why there is none, to `sink`.
pub unsafe fn describe<M: Model>(
    resources: *const c_char,
    context: *mut c_void,
    sink: DescribeSink,
) -> fmi2Integer {
    // SAFETY: the caller gives a zero-terminated path.
    let described = unsafe { text(resources, "resources") }
        .and_then(|folder| guarded(|| description_of::<M>(Path::new(&folder))));
    let (status, answer) = match described {
        Ok(xml) => (0, xml),
        Err(failure) => (1, failure.to_string()),
    };
    // SAFETY: the caller gives a sink that reads the text during the call.
    unsafe { sink(context, answer.as_ptr().cast(), answer.len()) };
    status
}

/// Keeps panics off stderr: their message goes to the importer's logger. The hook is that of the
/// copy of the standard library inside the model's library, not the importer's.
fn silence_panics() {
    std::panic::set_hook(Box::new(|_| {}));
}
