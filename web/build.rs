//! Reads the design of the controller FMU, so that the page needs no code that reads TOML.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

use controller::AsoController;

fn main() -> Result<(), Box<dyn Error>> {
    let file = "../fmu-controller/resources/design.toml";
    println!("cargo:rerun-if-changed={file}");
    let design = AsoController::bytes_of_design(&fs::read_to_string(file)?)?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("design"), design)?;
    Ok(())
}
