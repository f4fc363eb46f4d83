//! The fuzz targets: those of `crates/fmu/tests/robustness` and of `crates/study/tests/robustness`, one for the
//! controller's design file and one for `system.toml`.

#[path = "../../crates/fmu/tests/robustness/array.rs"]
mod array;
#[path = "../../crates/fmu/tests/robustness/calls/mod.rs"]
mod calls;
#[path = "../../crates/fmu/tests/robustness/choice.rs"]
mod choice;
#[path = "../../crates/fmu/tests/robustness/importer.rs"]
mod importer;
#[path = "../../crates/fmu/tests/robustness/machine.rs"]
mod machine;
#[path = "../../crates/study/tests/robustness/targets.rs"]
mod master_files;
#[path = "../../crates/fmu/tests/robustness/prediction.rs"]
mod prediction;
#[path = "../../crates/fmu/tests/robustness/sequence.rs"]
mod sequence;
#[path = "../../crates/fmu/tests/robustness/targets.rs"]
mod targets;

mod design;

/// Runs a target; where it panics, prints the message and ends the process.
fn spoken(body: impl FnOnce()) {
    let Err(payload) = std::panic::catch_unwind(std::panic::AssertUnwindSafe(body)) else { return };
    let text = payload.downcast_ref::<String>().map(String::as_str);
    eprintln!("{}", text.or(payload.downcast_ref::<&str>().copied()).unwrap_or("no message"));
    std::process::abort();
}

macro_rules! targets {
    ($($(#[$meta:meta])* $name:ident: $body:path;)*) => {
        $($(#[$meta])* pub fn $name(data: &[u8]) { spoken(|| $body(data)); })*
    };
}

targets! {
    /// See `targets.rs`.
    serialized_state: targets::serialized_state;
    /// See `targets.rs`.
    resource_location: targets::resource_location;
    /// See `targets.rs`.
    model_description: targets::model_description;
    /// See `targets.rs`.
    package: targets::package;
    /// See `targets.rs`.
    call_sequence: targets::call_sequence;
    /// See `design.rs`.
    design_file: design::design_file;
    /// See `crates/study/tests/robustness/targets.rs`.
    system_structure: master_files::system_structure;
    /// See `crates/study/tests/robustness/targets.rs`.
    parameter_values: master_files::parameter_values;
    /// See `crates/study/tests/robustness/targets.rs`.
    parameter_mapping: master_files::parameter_mapping;
    /// See `crates/study/tests/robustness/targets.rs`.
    signal_dictionary: master_files::signal_dictionary;
    /// See `crates/study/tests/robustness/targets.rs`.
    signal_table: master_files::signal_table;
    /// See `cli/src/config/tests/target.rs`.
    system_toml: command::system_toml;
}
