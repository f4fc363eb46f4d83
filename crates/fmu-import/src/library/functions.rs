//! The C functions of FMI 2.0: names and signatures.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::{c_char, c_int};

use fmu_description::abi::{
    fmi2Boolean as Boolean, fmi2CallbackFunctions, fmi2Component as Component, fmi2EventInfo,
    fmi2FMUstate as State, fmi2Status as Status, fmi2String as Text,
};

use super::Interface;
use super::table::functions;

type References = *const u32;

functions! {
    "2.0" = "fmi2GetVersion";
    instantiate = "fmi2Instantiate":
        fn(Text, c_int, Text, Text, *const fmi2CallbackFunctions, Boolean, Boolean) -> Component;
    free_instance = "fmi2FreeInstance": fn(Component);
    set_debug_logging = "fmi2SetDebugLogging": fn(Component, Boolean, usize, *const Text) -> Status;
    setup_experiment = "fmi2SetupExperiment":
        fn(Component, Boolean, f64, f64, Boolean, f64) -> Status;
    enter_initialization_mode = "fmi2EnterInitializationMode": fn(Component) -> Status;
    exit_initialization_mode = "fmi2ExitInitializationMode": fn(Component) -> Status;
    terminate = "fmi2Terminate": fn(Component) -> Status;
    get_real = "fmi2GetReal": fn(Component, References, usize, *mut f64) -> Status;
    get_integer = "fmi2GetInteger": fn(Component, References, usize, *mut c_int) -> Status;
    get_boolean = "fmi2GetBoolean": fn(Component, References, usize, *mut Boolean) -> Status;
    get_string = "fmi2GetString": fn(Component, References, usize, *mut Text) -> Status;
    set_real = "fmi2SetReal": fn(Component, References, usize, *const f64) -> Status;
    set_integer = "fmi2SetInteger": fn(Component, References, usize, *const c_int) -> Status;
    set_boolean = "fmi2SetBoolean": fn(Component, References, usize, *const Boolean) -> Status;
    set_string = "fmi2SetString": fn(Component, References, usize, *const Text) -> Status;
    get_state = "fmi2GetFMUstate": fn(Component, *mut State) -> Status;
    set_state = "fmi2SetFMUstate": fn(Component, State) -> Status;
    free_state = "fmi2FreeFMUstate": fn(Component, *mut State) -> Status;
    serialized_state_size = "fmi2SerializedFMUstateSize":
        fn(Component, State, *mut usize) -> Status;
    serialize_state = "fmi2SerializeFMUstate": fn(Component, State, *mut c_char, usize) -> Status;
    deserialize_state = "fmi2DeSerializeFMUstate":
        fn(Component, *const c_char, usize, *mut State) -> Status;
    directional_derivative = "fmi2GetDirectionalDerivative":
        fn(Component, References, usize, References, usize, *const f64, *mut f64) -> Status;
    set_input_derivatives = "fmi2SetRealInputDerivatives":
        fn(Component, References, usize, *const c_int, *const f64) -> Status;
    get_output_derivatives = "fmi2GetRealOutputDerivatives":
        fn(Component, References, usize, *const c_int, *mut f64) -> Status;
    do_step = "fmi2DoStep": fn(Component, f64, f64, Boolean) -> Status;
    cancel_step = "fmi2CancelStep": fn(Component) -> Status;
    get_status = "fmi2GetStatus": fn(Component, c_int, *mut Status) -> Status;
    get_real_status = "fmi2GetRealStatus": fn(Component, c_int, *mut f64) -> Status;
    get_boolean_status = "fmi2GetBooleanStatus": fn(Component, c_int, *mut Boolean) -> Status;
    enter_event_mode = "fmi2EnterEventMode": fn(Component) -> Status;
    new_discrete_states = "fmi2NewDiscreteStates": fn(Component, *mut fmi2EventInfo) -> Status;
    enter_continuous_time_mode = "fmi2EnterContinuousTimeMode": fn(Component) -> Status;
    set_continuous_states = "fmi2SetContinuousStates": fn(Component, *const f64, usize) -> Status;
    get_continuous_states = "fmi2GetContinuousStates": fn(Component, *mut f64, usize) -> Status;
    get_derivatives = "fmi2GetDerivatives": fn(Component, *mut f64, usize) -> Status;
    get_nominals_of_continuous_states = "fmi2GetNominalsOfContinuousStates": fn(Component, *mut f64, usize) -> Status;
    set_time = "fmi2SetTime": fn(Component, f64) -> Status;
    get_event_indicators = "fmi2GetEventIndicators": fn(Component, *mut f64, usize) -> Status;
    completed_integrator_step = "fmi2CompletedIntegratorStep":
        fn(Component, Boolean, *mut Boolean, *mut Boolean) -> Status;
}

/// `fmi2SetReal`.
pub(super) type SetReal = unsafe extern "C" fn(Component, References, usize, *const f64) -> Status;
/// `fmi2GetReal`.
pub(super) type GetReal = unsafe extern "C" fn(Component, References, usize, *mut f64) -> Status;
/// `fmi2DoStep`.
pub(super) type DoStep = unsafe extern "C" fn(Component, f64, f64, Boolean) -> Status;

/// The functions that both interfaces require.
const COMMON: [&str; 5] = [
    "fmi2Instantiate",
    "fmi2FreeInstance",
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
];

impl Functions {
    /// Removes the functions of co-simulation: an instance for model exchange refuses them as missing.
    pub(super) fn without_co_simulation(self) -> Self {
        Self { do_step: None, set_input_derivatives: None, get_output_derivatives: None, ..self }
    }
}

/// The functions that `interface` cannot do without.
pub(super) fn required(interface: Interface) -> [&'static [&'static str]; 2] {
    let more: &[_] = match interface {
        Interface::CoSimulation => &["fmi2DoStep"],
        Interface::ModelExchange => {
            &["fmi2NewDiscreteStates", "fmi2GetDerivatives", "fmi2SetContinuousStates"]
        }
    };
    [&COMMON, more]
}
