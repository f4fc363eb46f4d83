//! Slaves that make one step for several communication steps, as the others see them.

use fmu_description::Experiment;
use master::{Algorithm, Extrapolation, Method, Readout, Simulation, Value};

use crate::engine::puppet::{system, whole};
use crate::engine::typed::ring;
use crate::engine::until;

/// The input of a, which makes every step, from p, which makes four at once and has the output 1 +
/// 2 t, over 12 steps of 0.25 s.
fn inputs(sweep: Method) -> Vec<f64> {
    let (system, _) = system([|time| 1.0 + 2.0 * time; 2], whole);
    let multiples = vec![4, 1];
    let algorithm = Algorithm { multiples, ..Algorithm::fixed(sweep, Extrapolation::Hold, 0.25) };
    let mut simulation = Simulation::new(system, &algorithm, &until(3.0)).unwrap();
    let input = simulation.system().port("a.u0").unwrap();
    let mut readout = Readout::new(simulation.system(), &[input]);
    let mut values = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        let time = simulation.time();
        readout.read(simulation.system(), time).unwrap();
        values.push(readout.reals[0]);
    }
    values
}

#[test]
fn a_slave_that_steps_first_is_read_at_the_time_of_the_reader_and_not_at_its_own_end() {
    let ends = (1..=12).map(|count| 1.0 + 2.0 * 0.25 * f64::from(count));
    assert_eq!(inputs(Method::GaussSeidel), ends.collect::<Vec<_>>());
}

#[test]
fn a_slave_that_steps_at_the_same_time_is_read_at_the_start_of_its_step() {
    let begins = (0..12).map(|count| 1.0 + 2.0 * f64::from(count / 4));
    assert_eq!(inputs(Method::Jacobi), begins.collect::<Vec<_>>());
}

/// The Integers of a ring of slaves, the first of which makes two steps at once, over 20 steps of 0.04 s.
fn integers(start_time: f64) -> Vec<Value> {
    let algorithm = Algorithm {
        multiples: vec![2, 1, 1],
        ..Algorithm::fixed(Method::GaussSeidel, Extrapolation::Hold, 0.04)
    };
    let experiment = Experiment { start_time, ..until(start_time + 0.8) };
    let mut simulation = Simulation::new(ring(), &algorithm, &experiment).unwrap();
    let outputs = ["a.out1", "b.out1", "c.out1"];
    let ports = outputs.map(|output| simulation.system().port(output).unwrap());
    let mut values = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        values.extend(ports.map(|port| simulation.system().get_value(port).unwrap()));
    }
    values
}

/// There, 0.04 s after the third point is one unit in the last place, 2.4e-7 s, before the fourth one.
#[test]
fn a_slave_that_steps_first_has_its_integer_at_its_own_end_in_seconds_since_1970() {
    assert_eq!(integers(1.7e9), integers(0.0));
}

/// A slave that ends a step of several communication steps early would be asked for the same step for ever.
#[test]
fn multiples_of_steps_that_are_repeated_are_refused() {
    let (system, _) = system([f64::sin; 2], whole);
    let algorithm = Algorithm { multiples: vec![4, 1], rollback: true, ..Algorithm::new(0.25) };
    let message = Simulation::new(system, &algorithm, &until(1.0)).err().unwrap().to_string();
    assert!(message.ends_with("step-control fixed, coupling once, no rollback"), "{message}");
}
