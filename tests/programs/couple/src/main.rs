//! Couples the plant and the controller for 10 s.
use fmu_description::Experiment;
use fmu_import::Fmu;
use master::{Algorithm, Probe, Simulation, System};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<_> = std::env::args().skip(1).collect();
    let mut system = System::default();
    for (name, file) in ["plant", "controller"].into_iter().zip(&files) {
        system.add(name, Box::new(Fmu::open(file.as_ref())?.instantiate(name)?))?;
    }
    system.connect("plant.x_p", "controller.x_p")?;
    system.connect("plant.theta", "controller.theta")?;
    system.connect("controller.u", "plant.u")?;
    let cart = system.port("plant.x_p")?;
    let mut probe = Probe::new(&system, &[cart]);
    let experiment = Experiment { stop_time: Some(10.0), ..Experiment::default() };
    let mut simulation = Simulation::new(system, &Algorithm::new(1e-3), &experiment)?;
    while !simulation.is_finished() {
        simulation.step()?;
    }
    let (time, mut x_p) = (simulation.time(), [0.0]);
    probe.read(simulation.system(), time, &mut x_p)?;
    println!("{}", x_p[0]);
    Ok(())
}
