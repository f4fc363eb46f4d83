//! Writes the augmented plant of the controller FMU as Rust, so that the module needs no parser for a design.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

use aso_controller::Design;
use control::aso::FaultyPlant;
use controller::AsoController;

fn main() -> Result<(), Box<dyn Error>> {
    let file = "../../fmu-controller/resources/design.toml";
    println!("cargo:rerun-if-changed={file}");
    let design = Design::parse(&fs::read_to_string(file)?, file)?;
    let [a, b, c, f_a] = AsoController::of_design(design).plant();
    let plant = FaultyPlant::with_constant_faults(a, b, c, f_a);
    // Checked here, so that the module needs no code for a plant without an observer.
    plant.check_observer_exists()?;
    let (dynamics, output) = (plant.augmented_dynamics(), plant.augmented_output());
    let text = format!(
        "const STATES: usize = {};\nconst FAULTS: usize = {};\nconst MEASUREMENTS: usize = {};\n\
         const DYNAMICS: [f64; {}] = {:?};\nconst OUTPUT: [f64; {}] = {:?};\n",
        plant.a.nrows(),
        plant.f_a.ncols(),
        output.nrows(),
        dynamics.len(),
        dynamics.as_slice(),
        output.len(),
        output.as_slice()
    );
    fs::write(Path::new(&env::var("OUT_DIR")?).join("plant.rs"), text)?;
    Ok(())
}
