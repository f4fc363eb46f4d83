//! The functions of FMI 1.0 for co-simulation (`fmiFunctions.h`).
//!
//! A library exports each function with the model identifier and an underscore before its name:
//! `model_fmiDoStep`.

macro_rules! functions {
    ($($name:ident)*) => { [$(concat!("fmi", stringify!($name))),*] };
}

/// The names of all functions of a library for co-simulation, without the prefix `model_`.
pub const FUNCTIONS: [&str; 25] = functions! {
    GetTypesPlatform GetVersion SetDebugLogging
    InstantiateSlave InitializeSlave TerminateSlave ResetSlave FreeSlaveInstance
    GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean SetString
    SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep
    GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus
};
