//! The C functions of FMI 3.0: names and signatures.
//!
//! `fmi3Boolean` and `fmi3Clock` are read as bytes: an FMU may write other values than 0 and 1, which a
//! Rust `bool` does not allow.

use std::ffi::{c_char, c_int, c_void};

use super::super::table::functions;
use super::Interface;

/// `fmi3Instance`.
pub(super) type Instance = *mut c_void;
/// `fmi3FMUState`.
pub(super) type State = *mut c_void;
type Status = c_int;
type References = *const u32;
type Text = *const c_char;
/// `fmi3LogMessageCallback`.
pub(super) type LogMessage = unsafe extern "C" fn(*mut c_void, Status, Text, Text);
/// `fmi3IntermediateUpdateCallback`.
pub(super) type IntermediateUpdate =
    unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64);

/// `fmi3ClockUpdateCallback`.
pub(super) type ClockUpdate = unsafe extern "C" fn(*mut c_void);
/// `fmi3LockPreemptionCallback`, `fmi3UnlockPreemptionCallback`.
pub(super) type Preemption = unsafe extern "C" fn();

functions! {
    "3.0" = "fmi3GetVersion";
    set_debug_logging = "fmi3SetDebugLogging":
        fn(Instance, bool, usize, *const Text) -> Status;
    instantiate = "fmi3InstantiateCoSimulation": fn(Text, Text, Text, bool, bool, bool, bool,
        References, usize, *mut c_void, Option<LogMessage>, Option<IntermediateUpdate>) -> Instance;
    instantiate_equations = "fmi3InstantiateModelExchange":
        fn(Text, Text, Text, bool, bool, *mut c_void, Option<LogMessage>) -> Instance;
    instantiate_scheduled = "fmi3InstantiateScheduledExecution": fn(Text, Text, Text, bool, bool,
        *mut c_void, Option<LogMessage>, Option<ClockUpdate>, Option<Preemption>, Option<Preemption>)
        -> Instance;
    free_instance = "fmi3FreeInstance": fn(Instance);
    enter_initialization_mode = "fmi3EnterInitializationMode":
        fn(Instance, bool, f64, f64, bool, f64) -> Status;
    exit_initialization_mode = "fmi3ExitInitializationMode": fn(Instance) -> Status;
    enter_event_mode = "fmi3EnterEventMode": fn(Instance) -> Status;
    enter_step_mode = "fmi3EnterStepMode": fn(Instance) -> Status;
    terminate = "fmi3Terminate": fn(Instance) -> Status;
    enter_configuration_mode = "fmi3EnterConfigurationMode": fn(Instance) -> Status;
    exit_configuration_mode = "fmi3ExitConfigurationMode": fn(Instance) -> Status;
    get_float32 = "fmi3GetFloat32": fn(Instance, References, usize, *mut f32, usize) -> Status;
    get_float64 = "fmi3GetFloat64": fn(Instance, References, usize, *mut f64, usize) -> Status;
    get_int8 = "fmi3GetInt8": fn(Instance, References, usize, *mut i8, usize) -> Status;
    get_uint8 = "fmi3GetUInt8": fn(Instance, References, usize, *mut u8, usize) -> Status;
    get_int16 = "fmi3GetInt16": fn(Instance, References, usize, *mut i16, usize) -> Status;
    get_uint16 = "fmi3GetUInt16": fn(Instance, References, usize, *mut u16, usize) -> Status;
    get_int32 = "fmi3GetInt32": fn(Instance, References, usize, *mut i32, usize) -> Status;
    get_uint32 = "fmi3GetUInt32": fn(Instance, References, usize, *mut u32, usize) -> Status;
    get_int64 = "fmi3GetInt64": fn(Instance, References, usize, *mut i64, usize) -> Status;
    get_uint64 = "fmi3GetUInt64": fn(Instance, References, usize, *mut u64, usize) -> Status;
    get_boolean = "fmi3GetBoolean": fn(Instance, References, usize, *mut u8, usize) -> Status;
    get_string = "fmi3GetString": fn(Instance, References, usize, *mut Text, usize) -> Status;
    get_binary = "fmi3GetBinary":
        fn(Instance, References, usize, *mut usize, *mut *const u8, usize) -> Status;
    get_clock = "fmi3GetClock": fn(Instance, References, usize, *mut u8) -> Status;
    set_float32 = "fmi3SetFloat32": fn(Instance, References, usize, *const f32, usize) -> Status;
    set_float64 = "fmi3SetFloat64": fn(Instance, References, usize, *const f64, usize) -> Status;
    set_int8 = "fmi3SetInt8": fn(Instance, References, usize, *const i8, usize) -> Status;
    set_uint8 = "fmi3SetUInt8": fn(Instance, References, usize, *const u8, usize) -> Status;
    set_int16 = "fmi3SetInt16": fn(Instance, References, usize, *const i16, usize) -> Status;
    set_uint16 = "fmi3SetUInt16": fn(Instance, References, usize, *const u16, usize) -> Status;
    set_int32 = "fmi3SetInt32": fn(Instance, References, usize, *const i32, usize) -> Status;
    set_uint32 = "fmi3SetUInt32": fn(Instance, References, usize, *const u32, usize) -> Status;
    set_int64 = "fmi3SetInt64": fn(Instance, References, usize, *const i64, usize) -> Status;
    set_uint64 = "fmi3SetUInt64": fn(Instance, References, usize, *const u64, usize) -> Status;
    set_boolean = "fmi3SetBoolean": fn(Instance, References, usize, *const u8, usize) -> Status;
    set_string = "fmi3SetString": fn(Instance, References, usize, *const Text, usize) -> Status;
    set_binary = "fmi3SetBinary":
        fn(Instance, References, usize, *const usize, *const *const u8, usize) -> Status;
    set_clock = "fmi3SetClock": fn(Instance, References, usize, *const u8) -> Status;
    get_state = "fmi3GetFMUState": fn(Instance, *mut State) -> Status;
    set_state = "fmi3SetFMUState": fn(Instance, State) -> Status;
    free_state = "fmi3FreeFMUState": fn(Instance, *mut State) -> Status;
    serialized_state_size = "fmi3SerializedFMUStateSize":
        fn(Instance, State, *mut usize) -> Status;
    serialize_state = "fmi3SerializeFMUState": fn(Instance, State, *mut u8, usize) -> Status;
    deserialize_state = "fmi3DeserializeFMUState":
        fn(Instance, *const u8, usize, *mut State) -> Status;
    directional_derivative = "fmi3GetDirectionalDerivative": fn(Instance, References, usize,
        References, usize, *const f64, usize, *mut f64, usize) -> Status;
    get_output_derivatives = "fmi3GetOutputDerivatives":
        fn(Instance, References, usize, *const i32, *mut f64, usize) -> Status;
    get_interval_decimal = "fmi3GetIntervalDecimal":
        fn(Instance, References, usize, *mut f64, *mut c_int) -> Status;
    get_shift_decimal = "fmi3GetShiftDecimal":
        fn(Instance, References, usize, *mut f64) -> Status;
    update_discrete_states = "fmi3UpdateDiscreteStates": fn(Instance, *mut u8, *mut u8, *mut u8,
        *mut u8, *mut u8, *mut f64) -> Status;
    activate_model_partition = "fmi3ActivateModelPartition": fn(Instance, u32, f64) -> Status;
    do_step = "fmi3DoStep": fn(Instance, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64)
        -> Status;
    enter_continuous_time_mode = "fmi3EnterContinuousTimeMode": fn(Instance) -> Status;
    completed_integrator_step = "fmi3CompletedIntegratorStep":
        fn(Instance, bool, *mut u8, *mut u8) -> Status;
    set_time = "fmi3SetTime": fn(Instance, f64) -> Status;
    set_continuous_states = "fmi3SetContinuousStates": fn(Instance, *const f64, usize) -> Status;
    get_continuous_states = "fmi3GetContinuousStates": fn(Instance, *mut f64, usize) -> Status;
    get_derivatives = "fmi3GetContinuousStateDerivatives":
        fn(Instance, *mut f64, usize) -> Status;
    get_event_indicators = "fmi3GetEventIndicators": fn(Instance, *mut f64, usize) -> Status;
    get_nominals_of_continuous_states = "fmi3GetNominalsOfContinuousStates": fn(Instance, *mut f64, usize) -> Status;
    get_number_of_states = "fmi3GetNumberOfContinuousStates": fn(Instance, *mut usize) -> Status;
    get_number_of_indicators = "fmi3GetNumberOfEventIndicators":
        fn(Instance, *mut usize) -> Status;
}

/// The functions without which no FMU can run.
const REQUIRED: [&str; 3] =
    ["fmi3FreeInstance", "fmi3EnterInitializationMode", "fmi3ExitInitializationMode"];

/// The functions that `interface` cannot do without.
pub(super) fn required(interface: Interface) -> [&'static [&'static str]; 2] {
    let more: &[_] = match interface {
        Interface::CoSimulation => &["fmi3InstantiateCoSimulation", "fmi3DoStep"],
        Interface::ModelExchange => &[
            "fmi3InstantiateModelExchange",
            "fmi3SetTime",
            "fmi3UpdateDiscreteStates",
            "fmi3EnterContinuousTimeMode",
        ],
        Interface::ScheduledExecution => {
            &["fmi3InstantiateScheduledExecution", "fmi3ActivateModelPartition"]
        }
    };
    [&REQUIRED, more]
}
