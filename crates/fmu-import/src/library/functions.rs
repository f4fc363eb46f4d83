//! The C functions of FMI 2.0: names and signatures.
#![expect(unsafe_code, reason = "the boundary to C")]

use fmu_description::abi::{
    fmi2Boolean, fmi2Byte, fmi2CallbackFunctions, fmi2Component, fmi2EventInfo, fmi2FMUstate,
    fmi2Integer, fmi2Real, fmi2Status, fmi2StatusKind, fmi2String, fmi2Type, fmi2ValueReference,
};

use super::Interface;
use super::table::functions;

type References = *const fmi2ValueReference;
type Component = fmi2Component;

functions! {
    get_version = "fmi2GetVersion": fn() -> fmi2String;
    instantiate = "fmi2Instantiate": fn(fmi2String, fmi2Type, fmi2String, fmi2String,
        *const fmi2CallbackFunctions, fmi2Boolean, fmi2Boolean) -> Component;
    free_instance = "fmi2FreeInstance": fn(Component);
    set_debug_logging = "fmi2SetDebugLogging":
        fn(Component, fmi2Boolean, usize, *const fmi2String) -> fmi2Status;
    setup_experiment = "fmi2SetupExperiment": fn(Component, fmi2Boolean, fmi2Real, fmi2Real,
        fmi2Boolean, fmi2Real) -> fmi2Status;
    enter_initialization_mode = "fmi2EnterInitializationMode": fn(Component) -> fmi2Status;
    exit_initialization_mode = "fmi2ExitInitializationMode": fn(Component) -> fmi2Status;
    terminate = "fmi2Terminate": fn(Component) -> fmi2Status;
    get_real = "fmi2GetReal": fn(Component, References, usize, *mut fmi2Real) -> fmi2Status;
    get_integer = "fmi2GetInteger":
        fn(Component, References, usize, *mut fmi2Integer) -> fmi2Status;
    get_boolean = "fmi2GetBoolean":
        fn(Component, References, usize, *mut fmi2Boolean) -> fmi2Status;
    get_string = "fmi2GetString": fn(Component, References, usize, *mut fmi2String) -> fmi2Status;
    set_real = "fmi2SetReal": fn(Component, References, usize, *const fmi2Real) -> fmi2Status;
    set_integer = "fmi2SetInteger":
        fn(Component, References, usize, *const fmi2Integer) -> fmi2Status;
    set_boolean = "fmi2SetBoolean":
        fn(Component, References, usize, *const fmi2Boolean) -> fmi2Status;
    set_string = "fmi2SetString":
        fn(Component, References, usize, *const fmi2String) -> fmi2Status;
    get_state = "fmi2GetFMUstate": fn(Component, *mut fmi2FMUstate) -> fmi2Status;
    set_state = "fmi2SetFMUstate": fn(Component, fmi2FMUstate) -> fmi2Status;
    free_state = "fmi2FreeFMUstate": fn(Component, *mut fmi2FMUstate) -> fmi2Status;
    serialized_state_size = "fmi2SerializedFMUstateSize":
        fn(Component, fmi2FMUstate, *mut usize) -> fmi2Status;
    serialize_state = "fmi2SerializeFMUstate":
        fn(Component, fmi2FMUstate, *mut fmi2Byte, usize) -> fmi2Status;
    deserialize_state = "fmi2DeSerializeFMUstate":
        fn(Component, *const fmi2Byte, usize, *mut fmi2FMUstate) -> fmi2Status;
    get_directional_derivative = "fmi2GetDirectionalDerivative": fn(Component, References,
        usize, References, usize, *const fmi2Real, *mut fmi2Real) -> fmi2Status;
    set_real_input_derivatives = "fmi2SetRealInputDerivatives": fn(Component, References,
        usize, *const fmi2Integer, *const fmi2Real) -> fmi2Status;
    get_real_output_derivatives = "fmi2GetRealOutputDerivatives": fn(Component, References,
        usize, *const fmi2Integer, *mut fmi2Real) -> fmi2Status;
    do_step = "fmi2DoStep": fn(Component, fmi2Real, fmi2Real, fmi2Boolean) -> fmi2Status;
    cancel_step = "fmi2CancelStep": fn(Component) -> fmi2Status;
    get_status = "fmi2GetStatus": fn(Component, fmi2StatusKind, *mut fmi2Status) -> fmi2Status;
    get_real_status = "fmi2GetRealStatus":
        fn(Component, fmi2StatusKind, *mut fmi2Real) -> fmi2Status;
    get_boolean_status = "fmi2GetBooleanStatus":
        fn(Component, fmi2StatusKind, *mut fmi2Boolean) -> fmi2Status;
    enter_event_mode = "fmi2EnterEventMode": fn(Component) -> fmi2Status;
    new_discrete_states = "fmi2NewDiscreteStates":
        fn(Component, *mut fmi2EventInfo) -> fmi2Status;
    enter_continuous_time_mode = "fmi2EnterContinuousTimeMode": fn(Component) -> fmi2Status;
    set_continuous_states = "fmi2SetContinuousStates":
        fn(Component, *const fmi2Real, usize) -> fmi2Status;
    get_continuous_states = "fmi2GetContinuousStates":
        fn(Component, *mut fmi2Real, usize) -> fmi2Status;
    get_derivatives = "fmi2GetDerivatives": fn(Component, *mut fmi2Real, usize) -> fmi2Status;
    get_nominals = "fmi2GetNominalsOfContinuousStates":
        fn(Component, *mut fmi2Real, usize) -> fmi2Status;
    set_time = "fmi2SetTime": fn(Component, fmi2Real) -> fmi2Status;
    get_event_indicators = "fmi2GetEventIndicators":
        fn(Component, *mut fmi2Real, usize) -> fmi2Status;
    completed_integrator_step = "fmi2CompletedIntegratorStep":
        fn(Component, fmi2Boolean, *mut fmi2Boolean, *mut fmi2Boolean) -> fmi2Status;
}

/// `fmi2SetReal`.
pub(super) type SetReal =
    unsafe extern "C" fn(Component, References, usize, *const fmi2Real) -> fmi2Status;
/// `fmi2GetReal`.
pub(super) type GetReal =
    unsafe extern "C" fn(Component, References, usize, *mut fmi2Real) -> fmi2Status;
/// `fmi2DoStep`.
pub(super) type DoStep =
    unsafe extern "C" fn(Component, fmi2Real, fmi2Real, fmi2Boolean) -> fmi2Status;

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
        Self {
            do_step: None,
            set_real_input_derivatives: None,
            get_real_output_derivatives: None,
            ..self
        }
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
