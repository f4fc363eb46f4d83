//! The C types of `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`.
#![expect(non_camel_case_types, missing_docs, reason = "the names of the C headers")]

use std::ffi::{c_char, c_int, c_void};

/// Declares an enumeration of a C header. In C the names of its values start with `$prefix`.
macro_rules! c_enumeration {
    ($(#[$meta:meta])* $name:ident: $type:ty, $prefix:literal { $($variant:ident = $value:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(i32)]
        pub enum $name {
            $(#[doc = concat!("`", $prefix, stringify!($variant), "`.")] $variant = $value,)*
        }

        impl $name {
            /// Converts a C value; `None` if the header does not define it.
            #[must_use]
            pub fn from_c(value: $type) -> Option<Self> {
                match value {
                    $($value => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// Returns the name in the C header.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => concat!($prefix, stringify!($variant)),)*
                }
            }
        }
    };
}
pub(crate) use c_enumeration;

pub type fmi2Component = *mut c_void;
pub type fmi2ComponentEnvironment = *mut c_void;
pub type fmi2FMUstate = *mut c_void;
pub type fmi2ValueReference = u32;
pub type fmi2Real = f64;
pub type fmi2Integer = c_int;
pub type fmi2Byte = c_char;
/// `fmi2Boolean`: zero is false, anything else true.
pub type fmi2Boolean = c_int;
/// `fmi2String`: zero-terminated UTF-8.
pub type fmi2String = *const c_char;
/// `fmi2Status` as an integer; see [`Status`].
pub type fmi2Status = c_int;
/// `fmi2Type`: 0 model exchange, 1 co-simulation.
pub type fmi2Type = c_int;
/// `fmi2StatusKind`; see [`StatusKind`].
pub type fmi2StatusKind = c_int;

/// `fmi2ModelExchange`.
pub const MODEL_EXCHANGE: fmi2Type = 0;
/// `fmi2CoSimulation`.
pub const CO_SIMULATION: fmi2Type = 1;
/// The result of `fmi2GetTypesPlatform`: the types of this module.
pub const TYPES_PLATFORM: &std::ffi::CStr = c"default";
/// The result of `fmi2GetVersion`, for every 2.0.x.
pub const VERSION: &std::ffi::CStr = c"2.0";

c_enumeration! {
    /// The values of `fmi2Status` (section 2.1.3).
    Status: fmi2Status, "fmi2" { OK = 0, Warning = 1, Discard = 2, Error = 3, Fatal = 4, Pending = 5, }
}

c_enumeration! {
    /// The values of `fmi2StatusKind` (section 4.2.3).
    StatusKind: fmi2StatusKind, "fmi2" {
        DoStepStatus = 0, PendingStatus = 1, LastSuccessfulTime = 2, Terminated = 3,
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct fmi2EventInfo {
    pub new_discrete_states_needed: fmi2Boolean,
    pub terminate_simulation: fmi2Boolean,
    pub nominals_of_continuous_states_changed: fmi2Boolean,
    pub values_of_continuous_states_changed: fmi2Boolean,
    pub next_event_time_defined: fmi2Boolean,
    /// `nextEventTime` in s.
    pub next_event_time: fmi2Real,
}

/// `fmi2CallbackLogger`: variadic, `printf` style.
pub type fmi2CallbackLogger = unsafe extern "C" fn(
    fmi2ComponentEnvironment,
    fmi2String,
    fmi2Status,
    fmi2String,
    fmi2String,
    ...
);
pub type fmi2CallbackAllocateMemory = unsafe extern "C" fn(usize, usize) -> *mut c_void;
pub type fmi2CallbackFreeMemory = unsafe extern "C" fn(*mut c_void);
pub type fmi2StepFinished = unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2Status);

#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct fmi2CallbackFunctions {
    /// `logger`; may be null.
    pub logger: Option<fmi2CallbackLogger>,
    pub allocate_memory: Option<fmi2CallbackAllocateMemory>,
    pub free_memory: Option<fmi2CallbackFreeMemory>,
    pub step_finished: Option<fmi2StepFinished>,
    /// `componentEnvironment`, passed back with every callback.
    pub component_environment: fmi2ComponentEnvironment,
}

/// Callback that receives text from `fmuDescribe`: context, bytes (not terminated), length.
pub type DescribeSink = unsafe extern "C" fn(*mut c_void, *const c_char, usize);

/// Name of the function of a library that renders its model description in FMI 2.0. Neither this function nor
/// [`DESCRIBE_3`] is part of the standard.
///
/// `int fmuDescribe(const char *resources, void *context, void (*sink)(void *context, const char
/// *text, size_t length))` passes the XML to `sink` and returns 0, or passes an error message and
/// returns 1.
pub const DESCRIBE: &str = "fmuDescribe";

/// Name of the function that renders the model description in FMI 3.0, with the signature of [`DESCRIBE`].
pub const DESCRIBE_3: &str = "fmuDescribe3";
