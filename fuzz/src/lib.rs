//! The fuzz targets of the crate `robustness`, and one for the controller's design file.

use robustness::{exporter, system_files, system_toml};

mod design;

/// Runs a target; if it panics, prints the message and ends the process.
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
    serialized_state: exporter::serialized_state;
    resource_location: exporter::resource_location;
    model_description: exporter::model_description;
    package: exporter::package;
    call_sequence: exporter::call_sequence;
    call_sequence_3: robustness::sequence3::run;
    design_file: design::design_file;
    system_structure: system_files::system_structure;
    parameter_values: system_files::parameter_values;
    parameter_mapping: system_files::parameter_mapping;
    signal_dictionary: system_files::signal_dictionary;
    signal_table: system_files::signal_table;
    system_toml: system_toml::system_toml;
}
