//! Writes the design of a package as Rust, so that its module needs no code that reads a design, and sets an option
//! of the linker. The design is `design.toml` in the folder of the package, or else the one of the controller FMU.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

use aso_controller::Design;

fn main() -> Result<(), Box<dyn Error>> {
    let files = ["design.toml", "../fmu-controller/resources/design.toml"];
    let file = files
        .into_iter()
        .find(|file| Path::new(file).exists())
        .ok_or("design.toml: no such file")?;
    println!("cargo:rerun-if-changed={file}");
    let design = Design::parse(&fs::read_to_string(file)?, file)?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("design.rs"), expression(&design))?;
    if env::var("CARGO_CFG_TARGET_FAMILY")? == "wasm" {
        // Indices of functions and addresses in as few bytes as each needs.
        println!("cargo:rustc-cdylib-link-arg=--compress-relocations");
    }
    Ok(())
}

/// The design as a Rust expression: its debug text, in which lists are `Vec`s, limits arrays and texts `String`s. What
/// is neither does not compile.
fn expression(design: &Design) -> String {
    let text = format!("{design:?}");
    let parts = text.split('"').enumerate().map(|(k, part)| {
        if k % 2 == 1 {
            format!("\"{part}\".to_owned()")
        } else {
            part.replace('[', "vec![").replace("limits: Some(vec![", "limits: Some([")
        }
    });
    parts.collect()
}
