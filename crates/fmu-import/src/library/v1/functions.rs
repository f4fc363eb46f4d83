//! The C functions of FMI 1.0: names and signatures.

use std::ffi::{c_char, c_int, c_void};

use fmu_description::abi::{
    fmi2CallbackAllocateMemory, fmi2CallbackFreeMemory, fmi2CallbackLogger,
};

use super::super::Interface;
use super::super::table::functions;

/// `fmiComponent`.
pub(super) type Instance = *mut c_void;
type Status = c_int;
type References = *const u32;
type Text = *const c_char;
/// `fmiBoolean`: a `char`, 0 is false.
type Boolean = c_char;

/// `fmiCallbackFunctions` of model exchange, passed by value; the structure of co-simulation starts with the same
/// fields. The functions have the types of FMI 2.0; the first argument of the logger is the component.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct ModelCallbacks {
    pub(super) logger: Option<fmi2CallbackLogger>,
    pub(super) allocate_memory: Option<fmi2CallbackAllocateMemory>,
    pub(super) free_memory: Option<fmi2CallbackFreeMemory>,
}

/// `fmiCallbackFunctions` of co-simulation, passed by value.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct Callbacks {
    pub(super) functions: ModelCallbacks,
    pub(super) step_finished: Option<unsafe extern "C" fn(Instance, Status)>,
}

/// `fmiEventInfo`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct EventInfo {
    pub(super) iteration_converged: Boolean,
    pub(super) state_value_references_changed: Boolean,
    pub(super) state_values_changed: Boolean,
    pub(super) terminate_simulation: Boolean,
    pub(super) upcoming_time_event: Boolean,
    pub(super) next_event_time: f64,
}

functions! {
    "1.0" = "fmiGetVersion";
    instantiate = "fmiInstantiateSlave": fn(Text, Text, Text, Text, f64, Boolean, Boolean,
        Callbacks, Boolean) -> Instance;
    free_instance = "fmiFreeSlaveInstance": fn(Instance);
    set_debug_logging = "fmiSetDebugLogging": fn(Instance, Boolean) -> Status;
    initialize = "fmiInitializeSlave": fn(Instance, f64, Boolean, f64) -> Status;
    terminate_slave = "fmiTerminateSlave": fn(Instance) -> Status;
    get_real = "fmiGetReal": fn(Instance, References, usize, *mut f64) -> Status;
    get_integer = "fmiGetInteger": fn(Instance, References, usize, *mut c_int) -> Status;
    get_boolean = "fmiGetBoolean": fn(Instance, References, usize, *mut Boolean) -> Status;
    get_string = "fmiGetString": fn(Instance, References, usize, *mut Text) -> Status;
    set_real = "fmiSetReal": fn(Instance, References, usize, *const f64) -> Status;
    set_integer = "fmiSetInteger": fn(Instance, References, usize, *const c_int) -> Status;
    set_boolean = "fmiSetBoolean": fn(Instance, References, usize, *const Boolean) -> Status;
    set_string = "fmiSetString": fn(Instance, References, usize, *const Text) -> Status;
    set_input_derivatives = "fmiSetRealInputDerivatives":
        fn(Instance, References, usize, *const c_int, *const f64) -> Status;
    get_output_derivatives = "fmiGetRealOutputDerivatives":
        fn(Instance, References, usize, *const c_int, *mut f64) -> Status;
    do_step = "fmiDoStep": fn(Instance, f64, f64, Boolean) -> Status;
    cancel_step = "fmiCancelStep": fn(Instance) -> Status;
    get_status = "fmiGetStatus": fn(Instance, c_int, *mut Status) -> Status;
    get_real_status = "fmiGetRealStatus": fn(Instance, c_int, *mut f64) -> Status;
    instantiate_model = "fmiInstantiateModel": fn(Text, Text, ModelCallbacks, Boolean) -> Instance;
    free_model = "fmiFreeModelInstance": fn(Instance);
    initialize_model = "fmiInitialize": fn(Instance, Boolean, f64, *mut EventInfo) -> Status;
    terminate_model = "fmiTerminate": fn(Instance) -> Status;
    set_time = "fmiSetTime": fn(Instance, f64) -> Status;
    set_continuous_states = "fmiSetContinuousStates": fn(Instance, *const f64, usize) -> Status;
    get_continuous_states = "fmiGetContinuousStates": fn(Instance, *mut f64, usize) -> Status;
    get_derivatives = "fmiGetDerivatives": fn(Instance, *mut f64, usize) -> Status;
    get_event_indicators = "fmiGetEventIndicators": fn(Instance, *mut f64, usize) -> Status;
    get_nominals_of_continuous_states = "fmiGetNominalContinuousStates": fn(Instance, *mut f64, usize) -> Status;
    completed_integrator_step = "fmiCompletedIntegratorStep":
        fn(Instance, *mut Boolean) -> Status;
    event_update = "fmiEventUpdate": fn(Instance, Boolean, *mut EventInfo) -> Status;
}

/// The functions that `interface` cannot do without.
pub(super) fn required(interface: Interface) -> &'static [&'static str] {
    match interface {
        Interface::CoSimulation => {
            &["fmiInstantiateSlave", "fmiFreeSlaveInstance", "fmiInitializeSlave", "fmiDoStep"]
        }
        Interface::ModelExchange => &[
            "fmiInstantiateModel",
            "fmiFreeModelInstance",
            "fmiInitialize",
            "fmiSetTime",
            "fmiEventUpdate",
        ],
    }
}
