//! The functions of the standard by name and signature, in tables: one that every library has, one
//! for each interface, and one for each capability.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::path::Path;

use fmi2::abi::{
    fmi2Boolean, fmi2CallbackFunctions, fmi2Component, fmi2EventInfo, fmi2FMUstate, fmi2Integer,
    fmi2Real, fmi2Status, fmi2String, fmi2Type, fmi2ValueReference,
};
use libloading::Library as Handle;

use crate::error::LoadError;

/// Declares a table of functions and its loading.
macro_rules! functions {
    ($(#[$doc:meta])* $table:ident {
        $($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(super) struct $table {
            $(pub(super) $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl $table {
            pub(super) fn load(handle: &Handle, path: &Path) -> Result<Self, LoadError> {
                Ok(Self { $($field: {
                    // SAFETY: the standard gives this name this signature.
                    let symbol = unsafe { handle.get(concat!($name, "\0").as_bytes()) };
                    *symbol.map_err(|_| LoadError::Missing {
                        path: path.to_owned(),
                        function: $name.to_owned(),
                    })?
                },)* })
            }
        }
    };
}

type References = *const fmi2ValueReference;

functions! {
    /// What both interfaces have.
    Common {
        get_version = "fmi2GetVersion": fn() -> fmi2String;
        instantiate = "fmi2Instantiate": fn(fmi2String, fmi2Type, fmi2String, fmi2String,
            *const fmi2CallbackFunctions, fmi2Boolean, fmi2Boolean) -> fmi2Component;
        free_instance = "fmi2FreeInstance": fn(fmi2Component);
        setup_experiment = "fmi2SetupExperiment": fn(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real,
            fmi2Boolean, fmi2Real) -> fmi2Status;
        enter_initialization_mode = "fmi2EnterInitializationMode": fn(fmi2Component) -> fmi2Status;
        exit_initialization_mode = "fmi2ExitInitializationMode": fn(fmi2Component) -> fmi2Status;
        terminate = "fmi2Terminate": fn(fmi2Component) -> fmi2Status;
        get_real = "fmi2GetReal":
            fn(fmi2Component, References, usize, *mut fmi2Real) -> fmi2Status;
        get_integer = "fmi2GetInteger":
            fn(fmi2Component, References, usize, *mut fmi2Integer) -> fmi2Status;
        get_boolean = "fmi2GetBoolean":
            fn(fmi2Component, References, usize, *mut fmi2Boolean) -> fmi2Status;
        set_real = "fmi2SetReal":
            fn(fmi2Component, References, usize, *const fmi2Real) -> fmi2Status;
        set_integer = "fmi2SetInteger":
            fn(fmi2Component, References, usize, *const fmi2Integer) -> fmi2Status;
        set_boolean = "fmi2SetBoolean":
            fn(fmi2Component, References, usize, *const fmi2Boolean) -> fmi2Status;
        set_string = "fmi2SetString":
            fn(fmi2Component, References, usize, *const fmi2String) -> fmi2Status;
    }
}

functions! {
    /// Co-simulation.
    CoSimulation {
        set_real_input_derivatives = "fmi2SetRealInputDerivatives": fn(fmi2Component, References,
            usize, *const fmi2Integer, *const fmi2Real) -> fmi2Status;
        get_real_output_derivatives = "fmi2GetRealOutputDerivatives": fn(fmi2Component, References,
            usize, *const fmi2Integer, *mut fmi2Real) -> fmi2Status;
        do_step = "fmi2DoStep":
            fn(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean) -> fmi2Status;
    }
}

functions! {
    /// Model exchange.
    ModelExchange {
        enter_event_mode = "fmi2EnterEventMode": fn(fmi2Component) -> fmi2Status;
        new_discrete_states = "fmi2NewDiscreteStates":
            fn(fmi2Component, *mut fmi2EventInfo) -> fmi2Status;
        enter_continuous_time_mode = "fmi2EnterContinuousTimeMode": fn(fmi2Component) -> fmi2Status;
        set_continuous_states = "fmi2SetContinuousStates":
            fn(fmi2Component, *const fmi2Real, usize) -> fmi2Status;
        get_continuous_states = "fmi2GetContinuousStates":
            fn(fmi2Component, *mut fmi2Real, usize) -> fmi2Status;
        get_derivatives = "fmi2GetDerivatives":
            fn(fmi2Component, *mut fmi2Real, usize) -> fmi2Status;
        get_nominals = "fmi2GetNominalsOfContinuousStates":
            fn(fmi2Component, *mut fmi2Real, usize) -> fmi2Status;
    }
}

functions! {
    /// `canGetAndSetFMUstate`.
    Snapshot {
        get = "fmi2GetFMUstate":
            fn(fmi2Component, *mut fmi2FMUstate) -> fmi2Status;
        set = "fmi2SetFMUstate": fn(fmi2Component, fmi2FMUstate) -> fmi2Status;
        free = "fmi2FreeFMUstate":
            fn(fmi2Component, *mut fmi2FMUstate) -> fmi2Status;
    }
}

functions! {
    /// `providesDirectionalDerivative`.
    Directional {
        get_directional_derivative = "fmi2GetDirectionalDerivative": fn(fmi2Component, References,
            usize, References, usize, *const fmi2Real, *mut fmi2Real) -> fmi2Status;
    }
}
