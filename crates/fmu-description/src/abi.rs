//! The C types of `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`.
#![expect(non_camel_case_types, reason = "the names of the C headers")]

use std::ffi::{c_char, c_int, c_void};

/// `fmi2Component`.
pub type fmi2Component = *mut c_void;
/// `fmi2ComponentEnvironment`.
pub type fmi2ComponentEnvironment = *mut c_void;
/// `fmi2FMUstate`.
pub type fmi2FMUstate = *mut c_void;
/// `fmi2ValueReference`.
pub type fmi2ValueReference = u32;
/// `fmi2Real`.
pub type fmi2Real = f64;
/// `fmi2Integer`.
pub type fmi2Integer = c_int;
/// `fmi2Boolean`: zero is false, anything else true.
pub type fmi2Boolean = c_int;
/// `fmi2String`: zero-terminated UTF-8.
pub type fmi2String = *const c_char;
/// `fmi2Byte`.
pub type fmi2Byte = c_char;
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
/// The result of `fmi2GetTypesPlatform` for the default types.
pub const TYPES_PLATFORM: &std::ffi::CStr = c"default";
/// `fmi2GetVersion`.
pub const VERSION: &std::ffi::CStr = c"2.0";

/// The values of `fmi2Status` (section 2.1.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i32)]
pub enum Status {
    /// `fmi2OK`.
    OK = 0,
    /// `fmi2Warning`.
    Warning = 1,
    /// `fmi2Discard`.
    Discard = 2,
    /// `fmi2Error`.
    Error = 3,
    /// `fmi2Fatal`.
    Fatal = 4,
    /// `fmi2Pending`.
    Pending = 5,
}

impl Status {
    /// Converts a C value to a status; `None` if it is no `fmi2Status`.
    #[must_use]
    pub fn from_c(status: fmi2Status) -> Option<Self> {
        use Status::{Discard, Error, Fatal, OK, Pending, Warning};
        [OK, Warning, Discard, Error, Fatal, Pending]
            .into_iter()
            .find(|known| *known as fmi2Status == status)
    }

    /// Returns the name in the C header.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Status::OK => "fmi2OK",
            Status::Warning => "fmi2Warning",
            Status::Discard => "fmi2Discard",
            Status::Error => "fmi2Error",
            Status::Fatal => "fmi2Fatal",
            Status::Pending => "fmi2Pending",
        }
    }
}

/// The values of `fmi2StatusKind` (section 4.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum StatusKind {
    /// `fmi2DoStepStatus`.
    DoStepStatus = 0,
    /// `fmi2PendingStatus`.
    PendingStatus = 1,
    /// `fmi2LastSuccessfulTime`.
    LastSuccessfulTime = 2,
    /// `fmi2Terminated`.
    Terminated = 3,
}

/// `fmi2EventInfo`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct fmi2EventInfo {
    /// `newDiscreteStatesNeeded`.
    pub new_discrete_states_needed: fmi2Boolean,
    /// `terminateSimulation`.
    pub terminate_simulation: fmi2Boolean,
    /// `nominalsOfContinuousStatesChanged`.
    pub nominals_of_continuous_states_changed: fmi2Boolean,
    /// `valuesOfContinuousStatesChanged`.
    pub values_of_continuous_states_changed: fmi2Boolean,
    /// `nextEventTimeDefined`.
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
/// `fmi2CallbackAllocateMemory`.
pub type fmi2CallbackAllocateMemory = unsafe extern "C" fn(usize, usize) -> *mut c_void;
/// `fmi2CallbackFreeMemory`.
pub type fmi2CallbackFreeMemory = unsafe extern "C" fn(*mut c_void);
/// `fmi2StepFinished`.
pub type fmi2StepFinished = unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2Status);

/// `fmi2CallbackFunctions`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct fmi2CallbackFunctions {
    /// `logger`; may be null.
    pub logger: Option<fmi2CallbackLogger>,
    /// `allocateMemory`.
    pub allocate_memory: Option<fmi2CallbackAllocateMemory>,
    /// `freeMemory`.
    pub free_memory: Option<fmi2CallbackFreeMemory>,
    /// `stepFinished`.
    pub step_finished: Option<fmi2StepFinished>,
    /// `componentEnvironment`, passed back with every callback.
    pub component_environment: fmi2ComponentEnvironment,
}

/// Callback that receives text from `fmuDescribe`: context, bytes (not terminated), length.
pub type DescribeSink = unsafe extern "C" fn(*mut c_void, *const c_char, usize);

/// Name of the function that renders the model description of FMI 2.0 of a library. It and
/// [`DESCRIBE_3`] are the only ones beyond the standard.
///
/// `int fmuDescribe(const char *resources, void *context, void (*sink)(void *context, const char
/// *text, size_t length))` passes the XML to `sink` and returns 0, or passes an error message and
/// returns 1.
pub const DESCRIBE: &str = "fmuDescribe";

/// Name of the function that renders the model description of FMI 3.0; the signature is the one of
/// [`DESCRIBE`].
pub const DESCRIBE_3: &str = "fmuDescribe3";
