//! Loads an FMU and steps it for 10 s.
use fmu_description::Experiment;
use fmu_import::Fmu;
use slave::Slave as _;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("expected an FMU")?;
    let fmu = Fmu::open(path.as_ref())?;
    let cart = fmu.description().variable("x_p").ok_or("no x_p")?.value_reference;
    let mut plant = fmu.instantiate("plant")?;
    plant.setup_experiment(&Experiment { stop_time: Some(10.0), ..Experiment::default() })?;
    plant.enter_initialization_mode()?;
    plant.exit_initialization_mode()?;
    let mut x_p = [0.0];
    for step in 0..10_000 {
        plant.do_step(1e-3 * f64::from(step), 1e-3, true)?;
    }
    plant.get_real(&[cart], &mut x_p)?;
    println!("{}", x_p[0]);
    Ok(plant.terminate()?)
}
