//! The first test of a model, and its results.

use std::path::Path;

use fmu::{Model, Simulation};

use super::StateSpace;

/// An importer that reads the description in one pass knows the extents of each array.
#[test]
fn the_structural_parameters_precede_the_arrays_that_they_size() {
    let description = fmu::describe_3::<StateSpace>(Path::new("resources")).unwrap();
    let names: Vec<_> =
        description.variables.iter().map(|variable| variable.name.as_str()).collect();
    assert_eq!(names[..5], ["time", "n", "m", "p", "A"]);
}

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<StateSpace>(Path::new("resources")), Ok(vec![]));
}

#[test]
fn the_oscillator_is_a_cosine() {
    let mut simulation = Simulation::<StateSpace>::new(Path::new("resources")).unwrap();
    simulation.step(3.0).unwrap();
    assert!((simulation.model().y[0] - 3.0_f64.cos()).abs() < 1e-5);
}

#[test]
fn larger_arrays_keep_their_elements_in_place() {
    let mut model = StateSpace::new(Path::new("resources")).unwrap();
    (model.n, model.m) = (3, 2);
    model.resize().unwrap();
    assert_eq!(model.a, [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(model.b, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    (model.n, model.m) = (1, 1);
    model.resize().unwrap();
    assert_eq!((model.a, model.b, model.c), (vec![0.0], vec![0.0], vec![1.0]));
}
