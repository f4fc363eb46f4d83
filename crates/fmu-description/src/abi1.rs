//! The functions of FMI 1.0 for co-simulation (`fmiFunctions.h`).
//!
//! A library exports each function with the model identifier and an underscore before its name:
//! `model_fmiDoStep`.

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
