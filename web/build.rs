//! Reads the design of the controller FMU, so that the page needs no code that reads TOML, and sets an option
//! of the linker.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

use controller::AsoController;

fn main() -> Result<(), Box<dyn Error>> {
    let file = "../fmu-controller/resources/design.toml";
    println!("cargo:rerun-if-changed={file}");
    let design = AsoController::bytes_of_design(&fs::read_to_string(file)?)?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("design"), design)?;
    if env::var("CARGO_CFG_TARGET_FAMILY")? == "wasm" {
        // Indices of functions and addresses in as few bytes as each needs.
        println!("cargo:rustc-cdylib-link-arg=--compress-relocations");
    }
    Ok(())
}
