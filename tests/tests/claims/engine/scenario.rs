//! Scenarios in a simulation.

use std::path::Path;
use std::sync::Arc;

use master::{Algorithm, Extrapolation, Method, Simulation, StepControl, System};
use study::scenario::{Scenario, Setup};
use tests::linear::{ABLE, Block};
use tests::network::Network;

use crate::engine::until;

#[derive(serde::Deserialize)]
struct File {
    scenario: Scenario,
}

/// `a`: `x' = u0` from 2; `b`: `x' = u0 + u1` from 0, with u1 unconnected. b.u0 is a's x, a.u0 is
/// b's x.
fn network() -> Network {
    let first = Block::new(&[&[0.0]], &[&[0.0]], &[&[1.0]], &[&[0.0]], &[2.0]);
    let second = Block::new(&[&[0.0]], &[&[1.0, 1.0]], &[&[1.0]], &[&[0.0, 0.0]], &[0.0]);
    Network { blocks: vec![first, second], links: vec![((0, 0), (1, 0)), ((1, 0), (0, 0))] }
}

fn simulate(text: &str, algorithm: &Algorithm) -> Simulation {
    let system: System = network().system(ABLE, &Arc::default());
    let file: File = toml::from_str(text).unwrap();
    let setup = Setup { folder: Path::new("."), start: 0.0, step: algorithm.step, tables: &[] };
    let prepared = file.scenario.resolve(&system, &setup).unwrap().scenario;
    Simulation::with_scenario(system, algorithm, &until(2.0), prepared).unwrap()
}

fn result(simulation: &mut Simulation) -> f64 {
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    network().outputs(simulation.system())[1]
}

/// a holds 2, so b integrates 2 and reaches 4 at 2 s; a bias of 3 from 0.5 s on adds 4.5.
#[test]
fn a_fault_on_a_connection_affects_the_input() {
    let text = r#"
        [[scenario.fault]]
        connection = "b.u0"
        bias = { value = 3, from = 0.5 }"#;
    for sweep in [Method::Jacobi, Method::GaussSeidel] {
        let mut simulation = simulate(text, &Algorithm::fixed(sweep, Extrapolation::Linear, 0.125));
        assert!((result(&mut simulation) - 8.5).abs() < 1e-12);
    }
}

/// The signal `t` on the unconnected input adds 2 from 0 to 2 s; a adds 4.
#[test]
fn an_unconnected_input_follows_its_signal() {
    let text = r#"
        [[scenario.signal]]
        variable = "b.u1"
        points = [[0, 0], [2, 2]]"#;
    for control in [StepControl::Fixed, StepControl::Doubling, StepControl::Embedded] {
        let algorithm =
            Algorithm { control, ..Algorithm::fixed(Method::Jacobi, Extrapolation::Linear, 0.125) };
        let actual = result(&mut simulate(text, &algorithm));
        assert!((actual - 6.0).abs() < 1e-12, "{}: {actual}", control.name());
    }
}

/// Zero until 0.7 s, then 1: adds exactly 1.3, because chosen steps end where the slope changes.
#[test]
fn chosen_steps_end_where_the_slope_of_a_signal_changes() {
    let text = r#"
        [[scenario.signal]]
        variable = "b.u1"
        steps = [[0, 0], [0.7, 1]]"#;
    for control in [StepControl::Doubling, StepControl::Embedded, StepControl::Increment] {
        let algorithm = Algorithm {
            control,
            relative_tolerance: 0.1,
            ..Algorithm::fixed(Method::Jacobi, Extrapolation::Linear, 0.125)
        };
        let mut simulation = simulate(text, &algorithm);
        let mut times = Vec::new();
        while !simulation.is_finished() {
            simulation.step().unwrap();
            times.push(simulation.time());
        }
        assert!(times.contains(&0.7), "{}: {times:?}", control.name());
        let actual = result(&mut simulation);
        assert!((actual - 5.3).abs() < 1e-9, "{}: {actual}", control.name());
    }
}
