//! The fuzz targets: those of `fmi2/tests/robustness`, and one for the controller's design file.

#[path = "../../fmi2/tests/robustness/array.rs"]
mod array;
#[path = "../../fmi2/tests/robustness/calls/mod.rs"]
mod calls;
#[path = "../../fmi2/tests/robustness/choice.rs"]
mod choice;
#[path = "../../fmi2/tests/robustness/importer.rs"]
mod importer;
#[path = "../../fmi2/tests/robustness/machine.rs"]
mod machine;
#[path = "../../fmi2/tests/robustness/prediction.rs"]
mod prediction;
#[path = "../../fmi2/tests/robustness/sequence.rs"]
mod sequence;
#[path = "../../fmi2/tests/robustness/targets.rs"]
mod targets;

mod design;

/// Runs a target and says why it failed: an instance of a model silences the messages of panics.
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
}
