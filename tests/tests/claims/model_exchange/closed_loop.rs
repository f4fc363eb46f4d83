//! The paper's plant and controller as model-exchange FMUs in one system.

use fmu_import::Fmu;
use integrate::{Integrated, Options};
use master::{Algorithm, System};
use tests::{Table, dist, root, simulation};

fn pair() -> System {
    let mut system = System::default();
    for (name, file) in [("plant", "FrictionPendulum.fmu"), ("controller", "AsoController.fmu")] {
        let fmu = Fmu::open_any(&dist().join(file)).unwrap();
        let equations = fmu.instantiate_equations(name).unwrap();
        system.add(name, Box::new(Integrated::new(equations, Options::default()))).unwrap();
    }
    assert_eq!(system.connect_equal_names().unwrap(), 3);
    system
}

#[test]
fn the_first_5_s_of_the_pair_are_those_of_scipy() {
    let reference = Table::read(&root().join("tests/data/closed_loop_paper.csv"));
    let signals = [("plant.x_p", "x_p"), ("plant.theta", "theta"), ("controller.u", "u")];
    let names = signals.map(|(name, _)| name);
    let step = 5e-5;
    let (mut simulation, mut probe) = simulation(pair(), &Algorithm::new(step), &names);
    let columns = signals.map(|(_, column)| reference.column(column));
    let (mut differences, mut values) = ([0.0_f64; 3], [0.0; 3]);
    let times = reference.column("t");
    let count = times.iter().filter(|time| **time <= 5.0).count();
    for (row, time) in times.iter().enumerate().take(count) {
        while simulation.time() < time - 0.5 * step {
            simulation.step().unwrap();
        }
        probe.read(simulation.system(), *time, &mut values).unwrap();
        for ((difference, value), column) in differences.iter_mut().zip(&values).zip(&columns) {
            *difference = difference.max((value - column[row]).abs());
        }
    }
    for (difference, column) in differences.iter_mut().zip(&columns) {
        let size = column[..count].iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        *difference /= size;
    }
    assert!(differences.iter().all(|difference| *difference < 5e-3), "{differences:?}");
}

#[test]
fn the_residual_of_the_pair_is_that_of_the_paper() {
    let names = ["plant.x_p"];
    let step = 1e-3;
    let (mut simulation, mut probe) = simulation(pair(), &Algorithm::new(step), &names);
    let (mut low, mut high, mut value) = (f64::INFINITY, f64::NEG_INFINITY, [0.0]);
    while simulation.time() < 80.0 {
        simulation.step().unwrap();
        let time = simulation.time();
        if time > 60.0 {
            probe.read(simulation.system(), time, &mut value).unwrap();
            (low, high) = (low.min(value[0]), high.max(value[0]));
        }
    }
    let residual = 500.0 * (high - low);
    assert!((residual - 0.962).abs() < 0.01, "{residual} mm");
}
