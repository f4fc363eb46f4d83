//! The C types of FMI 1.0 for co-simulation: `fmiPlatformTypes.h` and `fmiFunctions.h`.
//!
//! A library exports each function with the model identifier and an underscore before its name:
//! `model_fmiDoStep`.
#![expect(non_camel_case_types, reason = "the names of the C headers")]

use std::ffi::{c_char, c_int, c_uint, c_void};

/// `fmiComponent`.
pub type fmiComponent = *mut c_void;
/// `fmiValueReference`.
pub type fmiValueReference = c_uint;
/// `fmiReal`.
pub type fmiReal = f64;
/// `fmiInteger`.
pub type fmiInteger = c_int;
/// `fmiBoolean`: zero is false, anything else true.
pub type fmiBoolean = c_char;
/// `fmiString`: zero-terminated UTF-8.
pub type fmiString = *const c_char;
/// `fmiStatus` as an integer. The values are those of [`abi::Status`](crate::abi::Status).
pub type fmiStatus = c_int;
/// `fmiStatusKind`: 0 `fmiDoStepStatus`, 1 `fmiPendingStatus`, 2 `fmiLastSuccessfulTime`. The values are
/// those of [`abi::StatusKind`](crate::abi::StatusKind), which has one more.
pub type fmiStatusKind = c_int;

/// `fmiTrue`.
pub const TRUE: fmiBoolean = 1;
/// `fmiFalse`.
pub const FALSE: fmiBoolean = 0;
/// `fmiUndefinedValueReference`.
pub const UNDEFINED_VALUE_REFERENCE: fmiValueReference = c_uint::MAX;
/// The result of `fmiGetTypesPlatform` for the default types.
pub const TYPES_PLATFORM: &std::ffi::CStr = c"standard32";
/// The result of `fmiGetVersion`.
pub const VERSION: &std::ffi::CStr = c"1.0";
/// The value of `mimeType` for an FMU of the kind stand-alone.
pub const MIME_TYPE: &std::ffi::CStr = c"application/x-fmu-sharedlibrary";

/// The names of all functions of a library for co-simulation, without the prefix.
pub const FUNCTIONS: [&str; 25] = [
    "fmiGetTypesPlatform",
    "fmiGetVersion",
    "fmiSetDebugLogging",
    "fmiInstantiateSlave",
    "fmiInitializeSlave",
    "fmiTerminateSlave",
    "fmiResetSlave",
    "fmiFreeSlaveInstance",
    "fmiGetReal",
    "fmiGetInteger",
    "fmiGetBoolean",
    "fmiGetString",
    "fmiSetReal",
    "fmiSetInteger",
    "fmiSetBoolean",
    "fmiSetString",
    "fmiSetRealInputDerivatives",
    "fmiGetRealOutputDerivatives",
    "fmiDoStep",
    "fmiCancelStep",
    "fmiGetStatus",
    "fmiGetRealStatus",
    "fmiGetIntegerStatus",
    "fmiGetBooleanStatus",
    "fmiGetStringStatus",
];

/// `fmiCallbackLogger`: component, instance name, status, category, message in the style of `printf`.
pub type fmiCallbackLogger =
    unsafe extern "C" fn(fmiComponent, fmiString, fmiStatus, fmiString, fmiString, ...);
/// `fmiCallbackAllocateMemory`.
pub type fmiCallbackAllocateMemory = unsafe extern "C" fn(usize, usize) -> *mut c_void;
/// `fmiCallbackFreeMemory`.
pub type fmiCallbackFreeMemory = unsafe extern "C" fn(*mut c_void);
/// `fmiStepFinished`.
pub type fmiStepFinished = unsafe extern "C" fn(fmiComponent, fmiStatus);

/// `fmiCallbackFunctions` of co-simulation. `fmiInstantiateSlave` takes it by value.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct fmiCallbackFunctions {
    /// `logger`.
    pub logger: Option<fmiCallbackLogger>,
    /// `allocateMemory`.
    pub allocate_memory: Option<fmiCallbackAllocateMemory>,
    /// `freeMemory`.
    pub free_memory: Option<fmiCallbackFreeMemory>,
    /// `stepFinished`; null: `fmiDoStep` must not return `fmiPending`.
    pub step_finished: Option<fmiStepFinished>,
}

/// Reads values: component, value references, their number, values.
pub type GetValues<T> =
    unsafe extern "C" fn(fmiComponent, *const fmiValueReference, usize, *mut T) -> fmiStatus;
/// Sets values: component, value references, their number, values.
pub type SetValues<T> =
    unsafe extern "C" fn(fmiComponent, *const fmiValueReference, usize, *const T) -> fmiStatus;
/// A function with the component as its only argument.
pub type OfComponent = unsafe extern "C" fn(fmiComponent) -> fmiStatus;
/// Reads a status of an asynchronous step: component, kind, value.
pub type GetStatus<T> = unsafe extern "C" fn(fmiComponent, fmiStatusKind, *mut T) -> fmiStatus;

/// `fmiGetTypesPlatform`.
pub type fmiGetTypesPlatformTYPE = unsafe extern "C" fn() -> *const c_char;
/// `fmiGetVersion`.
pub type fmiGetVersionTYPE = unsafe extern "C" fn() -> *const c_char;
/// `fmiSetDebugLogging`: component, `loggingOn`.
pub type fmiSetDebugLoggingTYPE = unsafe extern "C" fn(fmiComponent, fmiBoolean) -> fmiStatus;
/// `fmiInstantiateSlave`: `instanceName`, `fmuGUID`, `fmuLocation`, `mimeType`, `timeout` in ms, `visible`,
/// `interactive`, `functions`, `loggingOn`.
pub type fmiInstantiateSlaveTYPE = unsafe extern "C" fn(
    fmiString,
    fmiString,
    fmiString,
    fmiString,
    fmiReal,
    fmiBoolean,
    fmiBoolean,
    fmiCallbackFunctions,
    fmiBoolean,
) -> fmiComponent;
/// `fmiInitializeSlave`: component, `tStart`, `StopTimeDefined`, `tStop`.
pub type fmiInitializeSlaveTYPE =
    unsafe extern "C" fn(fmiComponent, fmiReal, fmiBoolean, fmiReal) -> fmiStatus;
/// `fmiTerminateSlave`.
pub type fmiTerminateSlaveTYPE = OfComponent;
/// `fmiResetSlave`.
pub type fmiResetSlaveTYPE = OfComponent;
/// `fmiFreeSlaveInstance`.
pub type fmiFreeSlaveInstanceTYPE = unsafe extern "C" fn(fmiComponent);
/// `fmiGetReal`.
pub type fmiGetRealTYPE = GetValues<fmiReal>;
/// `fmiGetInteger`.
pub type fmiGetIntegerTYPE = GetValues<fmiInteger>;
/// `fmiGetBoolean`.
pub type fmiGetBooleanTYPE = GetValues<fmiBoolean>;
/// `fmiGetString`.
pub type fmiGetStringTYPE = GetValues<fmiString>;
/// `fmiSetReal`.
pub type fmiSetRealTYPE = SetValues<fmiReal>;
/// `fmiSetInteger`.
pub type fmiSetIntegerTYPE = SetValues<fmiInteger>;
/// `fmiSetBoolean`.
pub type fmiSetBooleanTYPE = SetValues<fmiBoolean>;
/// `fmiSetString`.
pub type fmiSetStringTYPE = SetValues<fmiString>;
/// `fmiSetRealInputDerivatives`: component, value references, their number, orders, values.
pub type fmiSetRealInputDerivativesTYPE = unsafe extern "C" fn(
    fmiComponent,
    *const fmiValueReference,
    usize,
    *const fmiInteger,
    *const fmiReal,
) -> fmiStatus;
/// `fmiGetRealOutputDerivatives`: component, value references, their number, orders, values.
pub type fmiGetRealOutputDerivativesTYPE = unsafe extern "C" fn(
    fmiComponent,
    *const fmiValueReference,
    usize,
    *const fmiInteger,
    *mut fmiReal,
) -> fmiStatus;
/// `fmiDoStep`: component, `currentCommunicationPoint`, `communicationStepSize`, `newStep`.
pub type fmiDoStepTYPE =
    unsafe extern "C" fn(fmiComponent, fmiReal, fmiReal, fmiBoolean) -> fmiStatus;
/// `fmiCancelStep`.
pub type fmiCancelStepTYPE = OfComponent;
/// `fmiGetStatus`.
pub type fmiGetStatusTYPE = GetStatus<fmiStatus>;
/// `fmiGetRealStatus`.
pub type fmiGetRealStatusTYPE = GetStatus<fmiReal>;
/// `fmiGetIntegerStatus`.
pub type fmiGetIntegerStatusTYPE = GetStatus<fmiInteger>;
/// `fmiGetBooleanStatus`.
pub type fmiGetBooleanStatusTYPE = GetStatus<fmiBoolean>;
/// `fmiGetStringStatus`.
pub type fmiGetStringStatusTYPE = GetStatus<fmiString>;
