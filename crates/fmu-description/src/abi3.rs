//! The C types of `fmi3PlatformTypes.h` and `fmi3FunctionTypes.h` (FMI 3.0.2).
//!
//! `fmi3Boolean` and `fmi3Clock` are `bool` in C and `u8` here, because an FMU or importer may pass a byte that is
//! neither 0 nor 1, which is no valid `bool`. The C ABIs of all platforms pass both types in the same way.
#![expect(non_camel_case_types, missing_docs, reason = "the names of the C headers")]

use std::ffi::{c_char, c_int, c_void};

use crate::abi::c_enumeration;
use crate::call_order3::Function;

pub type fmi3Instance = *mut c_void;
pub type fmi3InstanceEnvironment = *mut c_void;
pub type fmi3FMUState = *mut c_void;
pub type fmi3ValueReference = u32;
pub type fmi3Float32 = f32;
pub type fmi3Float64 = f64;
pub type fmi3Int8 = i8;
pub type fmi3UInt8 = u8;
pub type fmi3Int16 = i16;
pub type fmi3UInt16 = u16;
pub type fmi3Int32 = i32;
pub type fmi3UInt32 = u32;
pub type fmi3Int64 = i64;
pub type fmi3UInt64 = u64;
pub type fmi3Char = c_char;
pub type fmi3Byte = u8;
/// `fmi3Boolean`: 0 is false, 1 is true.
pub type fmi3Boolean = u8;
/// `fmi3String`: zero-terminated UTF-8.
pub type fmi3String = *const fmi3Char;
/// `fmi3Binary`: bytes whose length is a separate argument.
pub type fmi3Binary = *const fmi3Byte;
/// `fmi3Clock`: 0 is inactive, 1 is active.
pub type fmi3Clock = u8;
/// `fmi3Status` as an integer; see [`Status`].
pub type fmi3Status = c_int;
/// `fmi3DependencyKind` as an integer; see [`DependencyKind`].
pub type fmi3DependencyKind = c_int;
/// `fmi3IntervalQualifier` as an integer; see [`IntervalQualifier`].
pub type fmi3IntervalQualifier = c_int;

/// The result of `fmi3GetVersion`, for every 3.0.x.
pub const VERSION: &std::ffi::CStr = c"3.0";

/// Returns the names of all functions in `fmi3Functions.h`, in this order; a library exports all of them (section 2.5).
pub fn functions() -> impl Iterator<Item = &'static str> {
    let first = [
        "fmi3GetVersion",
        "fmi3SetDebugLogging",
        "fmi3InstantiateModelExchange",
        "fmi3InstantiateCoSimulation",
        "fmi3InstantiateScheduledExecution",
    ];
    let others = Function::EVERY.iter().map(|function| function.name());
    first.into_iter().chain(others.filter(|name| *name != "fmi3SetDebugLogging"))
}

c_enumeration! {
    /// The values of `fmi3Status` (section 2.2.4).
    Status: fmi3Status, "fmi3" { OK = 0, Warning = 1, Discard = 2, Error = 3, Fatal = 4, }
}

c_enumeration! {
    /// The values of `fmi3DependencyKind` (section 2.2.9).
    DependencyKind: fmi3DependencyKind, "fmi3" {
        Independent = 0, Constant = 1, Fixed = 2, Tunable = 3, Discrete = 4, Dependent = 5,
    }
}

c_enumeration! {
    /// The values of `fmi3IntervalQualifier` (section 2.2.8.4).
    IntervalQualifier: fmi3IntervalQualifier, "fmi3Interval" {
        NotYetKnown = 0, Unchanged = 1, Changed = 2,
    }
}

pub type fmi3LogMessageCallback =
    unsafe extern "C" fn(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
pub type fmi3ClockUpdateCallback = unsafe extern "C" fn(fmi3InstanceEnvironment);
/// `fmi3IntermediateUpdateCallback`: environment, `intermediateUpdateTime`,
/// `intermediateVariableSetRequested`, `intermediateVariableGetAllowed`, `intermediateStepFinished`,
/// `canReturnEarly`, `earlyReturnRequested`, `earlyReturnTime`.
pub type fmi3IntermediateUpdateCallback = unsafe extern "C" fn(
    fmi3InstanceEnvironment,
    fmi3Float64,
    fmi3Boolean,
    fmi3Boolean,
    fmi3Boolean,
    fmi3Boolean,
    *mut fmi3Boolean,
    *mut fmi3Float64,
);
pub type fmi3LockPreemptionCallback = unsafe extern "C" fn();
pub type fmi3UnlockPreemptionCallback = unsafe extern "C" fn();

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_the_enumerations_are_those_of_the_header() {
        for (value, name) in
            (0..).zip(["fmi3OK", "fmi3Warning", "fmi3Discard", "fmi3Error", "fmi3Fatal"])
        {
            assert_eq!(Status::from_c(value).map(Status::name), Some(name));
        }
        assert_eq!((Status::from_c(5), Status::from_c(-1)), (None, None));
        assert_eq!(IntervalQualifier::from_c(2), Some(IntervalQualifier::Changed));
        assert_eq!(IntervalQualifier::from_c(3), None);
        assert_eq!(DependencyKind::from_c(5), Some(DependencyKind::Dependent));
        assert_eq!(DependencyKind::from_c(6), None);
    }
}
