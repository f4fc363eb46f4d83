//! The first test of a model, and its results.

use std::path::Path;

use fmu::Simulation;

use super::VanDerPol;

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<VanDerPol>(Path::new("resources")), Ok(vec![]));
}

#[test]
fn the_oscillator_reaches_its_limit_cycle() {
    // The amplitude of the limit cycle for mu = 1 is 2.00862 (Strogatz, Nonlinear Dynamics and Chaos,
    // and tables since van der Pol's paper).
    let mut simulation = Simulation::<VanDerPol>::new(Path::new("resources")).unwrap();
    let mut largest: f64 = 0.0;
    for k in 0..4000 {
        simulation.step(0.01).unwrap();
        if k > 2000 {
            largest = largest.max(simulation.model().x0);
        }
    }
    assert!((largest - 2.00862).abs() < 2e-5, "{largest}");
}
