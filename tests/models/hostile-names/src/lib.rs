//! A model whose module defines names that `fmu::export!` could confuse: names of the standard
//! library's prelude, of primitive types, of the crate's own types, functions and macros, and of
//! arguments.
#![forbid(unsafe_code)]
#![expect(dead_code, unused_macros, reason = "the names alone matter")]
#![expect(
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals,
    reason = "names of types, functions and arguments"
)]

mod model;

/// Unit structs: each defines the name of a type and of a value.
macro_rules! structs {
    ($($name:ident)*) => { $(struct $name;)* };
}

macro_rules! functions {
    ($($name:ident)*) => { $(fn $name() {})* };
}

macro_rules! constants {
    ($($name:ident)*) => { $(const $name: ::core::primitive::u8 = 0;)* };
}

macro_rules! modules {
    ($($name:ident)*) => { $(mod $name {})* };
}

structs! { Status Result Option Vec String Box Some None Ok Err Default Clone Send Sync Drop Fn }
structs! { Model Failure Instance Snapshot Component Step State Variable Function Interface Path }
structs! { fmi2Component fmi2Status fmi2Real fmi2String fmi2Boolean fmi2Integer fmi2ValueReference }
structs! { fmi2FMUstate fmi2Byte fmi2Type fmi2EventInfo fmi2StatusKind fmi2CallbackFunctions }
structs! { DescribeSink size_t void usize u32 i32 f64 bool char str }
functions! { reset step do_step instantiate free_instance describe version types_platform terminate }
functions! { get_real set_real get_integer set_integer get_boolean set_boolean get_string set_string }
functions! { get_fmu_state set_fmu_state free_fmu_state set_time get_status cancel_step door }
functions! { fmi2Reset fmi2DoStep fmi2Instantiate fmi2GetReal fmuDescribe main }
constants! { c n vr on name value values state size start bytes info kind order x z known unknown }
constants! { resources context sink guid functions visible model argument function result }
modules! { core std alloc fmi2 ffi abi signature fmi2_entry_points }

// The expansions of these macros do not matter, only their names.
macro_rules! assert {
    ($($any:tt)*) => {
        compile_error!("the model's own assert")
    };
}

macro_rules! cfg {
    ($($any:tt)*) => {
        compile_error!("the model's own cfg")
    };
}

macro_rules! entry_points {
    ($($any:tt)*) => {
        compile_error!("the model's own entry_points")
    };
}

::fmu::export!(model::HostileNames);
