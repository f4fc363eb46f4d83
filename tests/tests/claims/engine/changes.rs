//! A scenario that is changed during a run, against one that has the change from the start.

use std::path::Path;
use std::sync::Arc;

use master::{Algorithm, Coupling, Extrapolation, Method, Simulation, StepControl, System};
use study::scenario::{Scenario, Setup};
use tests::linear::ABLE;
use tests::problems;

use crate::engine::until;

#[derive(serde::Deserialize)]
struct File {
    scenario: Scenario,
}

/// What the run has from its start.
const FIRST: &str = r#"
[[scenario.fault]]
connection = "b.u0"
bias = { value = 0.01, from = 0.11 }
"#;

fn resolve(text: &str, system: &System, step: f64) -> master::Scenario {
    let file: File = toml::from_str(text).unwrap();
    let setup = Setup { folder: Path::new("."), start: 0.0, step, tables: &[] };
    file.scenario.resolve(system, &setup).unwrap().scenario
}

fn simulation(text: &str, algorithm: &Algorithm) -> Simulation {
    let system = problems::two_masses(20.0, 0.5).system(ABLE, &Arc::default());
    let scenario = resolve(text, &system, algorithm.step);
    Simulation::with_scenario(system, algorithm, &until(1.0), scenario).unwrap()
}

/// Largest number of points that are compared: chosen steps become small after a jump.
const POINTS: usize = 150;

/// Bits of time and outputs at a communication point.
type Point = Vec<u64>;

fn point(simulation: &mut Simulation) -> Point {
    let time = simulation.time();
    let outputs = problems::two_masses(20.0, 0.5).outputs(simulation.system());
    std::iter::once(time).chain(outputs).map(f64::to_bits).collect()
}

/// Steps to the end, or over the first points; before the step number `number`, counted from 0, it adds `added` from the time
/// of the next change on. Returns all points and the complete scenario.
fn changed(algorithm: &Algorithm, added: &str, number: usize) -> (Vec<Point>, String) {
    let (mut simulation, mut text) = (simulation(FIRST, algorithm), FIRST.to_owned());
    let mut points = Vec::new();
    while !simulation.is_finished() && points.len() < POINTS {
        if points.len() == number
            && let Some(from) = simulation.next_change()
        {
            text.push_str(&added.replace("NOW", &format!("{from:?}")));
            let scenario = resolve(&text, simulation.system(), algorithm.step);
            simulation.change_scenario(scenario).unwrap();
        }
        simulation.step().unwrap();
        points.push(point(&mut simulation));
    }
    (points, text)
}

#[test]
fn a_run_with_a_change_is_that_with_the_change_from_the_start_bit_for_bit() {
    let fault = |kind: &str| format!("[[scenario.fault]]\nconnection = \"b.u0\"\n{kind}\n");
    let added = [
        fault("bias = { value = 5, from = NOW }"),
        fault("stuck = { from = NOW }"),
        fault("dropout = { from = NOW, period = 0.1, lost = 0.04 }"),
    ];
    let fixed = |method, extrapolation| Algorithm::fixed(method, extrapolation, 0.01);
    let varied = |control| Algorithm { control, relative_tolerance: 1e-2, ..Algorithm::new(0.01) };
    let algorithms = [
        fixed(Method::Jacobi, Extrapolation::Hold),
        fixed(Method::GaussSeidel, Extrapolation::Hold),
        fixed(Method::GaussSeidel, Extrapolation::Limited),
        fixed(Method::Jacobi, Extrapolation::Quadratic),
        Algorithm { multiples: vec![1, 4], ..fixed(Method::GaussSeidel, Extrapolation::Hold) },
        Algorithm { coupling: Coupling::Newton, ..fixed(Method::Jacobi, Extrapolation::Linear) },
        varied(StepControl::Doubling),
        varied(StepControl::Embedded),
        varied(StepControl::Increment),
    ];
    let mut compared = 0;
    for algorithm in &algorithms {
        for added in &added {
            for number in [0, 1, 3, 8, 21, 40] {
                let (points, text) = changed(algorithm, added, number);
                let mut again = simulation(&text, algorithm);
                for actual in &points {
                    again.step().unwrap();
                    assert_eq!(*actual, point(&mut again), "{algorithm:?}, {text}");
                }
                compared += usize::from(text.len() > FIRST.len());
            }
        }
    }
    assert!(compared > 100, "{compared} runs had a change");
}

#[test]
fn a_run_that_returns_to_a_kept_state_has_the_faults_of_then() {
    let algorithm = Algorithm::new(0.01);
    let (mut with_change, mut without) =
        (simulation(FIRST, &algorithm), simulation(FIRST, &algorithm));
    for _ in 0..20 {
        with_change.step().unwrap();
        without.step().unwrap();
    }
    let state = with_change.keep(0).unwrap();
    let text =
        format!("{FIRST}[[scenario.fault]]\nconnection = \"b.u0\"\nstuck = {{ from = 0.205 }}\n");
    let scenario = resolve(&text, with_change.system(), algorithm.step);
    with_change.change_scenario(scenario).unwrap();
    for _ in 0..10 {
        with_change.step().unwrap();
    }
    let disturbed = point(&mut with_change);
    with_change.return_to(&state).unwrap();
    for _ in 0..10 {
        with_change.step().unwrap();
        without.step().unwrap();
        assert_eq!(point(&mut with_change), point(&mut without));
    }
    assert_ne!(disturbed, point(&mut without));
}

#[test]
fn what_the_run_has_cannot_be_taken_away_or_changed() {
    let mut simulation = simulation(FIRST, &Algorithm::new(0.01));
    simulation.step().unwrap();
    for other in ["scenario = {}".to_owned(), FIRST.replace("0.01", "0.02")] {
        let scenario = resolve(&other, simulation.system(), 0.01);
        let error = simulation.change_scenario(scenario).unwrap_err().to_string();
        assert!(error.contains("the new scenario lacks"), "{error}");
    }
    let scenario = resolve(FIRST, simulation.system(), 0.01);
    simulation.change_scenario(scenario).unwrap();
}

#[test]
fn a_fault_without_a_connection_leaves_all_faults_as_they_are() {
    let mut simulation = simulation(FIRST, &Algorithm::new(0.01));
    let added = "[[scenario.fault]]\nconnection = \"a.u0\"\nstuck = { from = 0.5 }\n";
    let mut scenario = resolve(&format!("{FIRST}{added}"), simulation.system(), 0.01);
    let output = simulation.system().port("a.y0").unwrap();
    let (_, chain) = scenario.faults[1].clone();
    scenario.faults.push((output, chain));
    let error = simulation.change_scenario(scenario).unwrap_err().to_string();
    assert!(error.contains("a.y0 has a fault"), "{error}");
    // A fault that had stayed on a.u0 would be missing here.
    let scenario = resolve(FIRST, simulation.system(), 0.01);
    simulation.change_scenario(scenario).unwrap();
}

#[test]
fn a_second_chain_of_faults_of_one_input_is_named() {
    let mut simulation = simulation(FIRST, &Algorithm::new(0.01));
    let mut scenario = resolve(FIRST, simulation.system(), 0.01);
    let chain = scenario.faults[0].clone();
    scenario.faults.push(chain);
    let error = simulation.change_scenario(scenario).unwrap_err().to_string();
    assert!(error.contains("b.u0 has two chains of faults"), "{error}");
}

#[test]
fn there_is_no_next_change_in_the_last_step() {
    let mut simulation = simulation(FIRST, &Algorithm::new(0.25));
    let mut actual = Vec::new();
    while !simulation.is_finished() {
        actual.push(simulation.next_change());
        simulation.step().unwrap();
    }
    // The first step ends at 0.11 s, where the fault starts.
    assert_eq!(actual, [Some(0.25), Some(0.25), Some(0.5), Some(0.75), None]);
    assert_eq!(simulation.next_change(), None);
}
