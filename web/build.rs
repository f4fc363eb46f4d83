//! Writes the design of a package as Rust, so that its WebAssembly module needs no parser for a design. The design is
//! `design.toml` in the folder of the package or, without this file, that of the controller FMU.

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
        // Encodes indices of functions and addresses in the least number of bytes.
        println!("cargo:rustc-cdylib-link-arg=--compress-relocations");
    }
    Ok(())
}

/// Returns the design as a Rust expression: its debug text, with lists as `Vec`s, limits as arrays and texts as
/// `String`s. Anything else would not compile.
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
