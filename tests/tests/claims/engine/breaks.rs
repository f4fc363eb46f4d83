//! Steps that are chosen end where a fault on a connection begins or ends.

use std::path::Path;
use std::sync::Arc;

use master::{Algorithm, Simulation, StepControl};
use study::scenario::{Scenario, Setup};
use tests::linear::ABLE;
use tests::problems;

use crate::engine::until;

const FAULT: &str = r#"
[[scenario.fault]]
connection = "b.u0"
bias = { value = 0.01, from = 0.3333, until = 0.6667 }
"#;

#[derive(serde::Deserialize)]
struct File {
    scenario: Scenario,
}

/// Not the control by energy: while the fault lasts it takes it for energy that the connection makes,
/// and its steps stay small.
#[test]
fn chosen_steps_end_where_a_fault_on_a_connection_begins_and_ends() {
    let network = problems::two_masses(20.0, 0.5);
    for control in [StepControl::Doubling, StepControl::Embedded, StepControl::Increment] {
        let system = network.system(ABLE, &Arc::default());
        let algorithm = Algorithm { control, relative_tolerance: 1e-2, ..Algorithm::new(0.01) };
        let file: File = toml::from_str(FAULT).unwrap();
        let setup = Setup { folder: Path::new("."), start: 0.0, step: 0.01 };
        let scenario = file.scenario.resolve(&system, &setup).unwrap().scenario;
        let mut simulation =
            Simulation::with_scenario(system, &algorithm, &until(1.0), scenario).unwrap();
        let mut times = Vec::new();
        while !simulation.is_finished() {
            simulation.step().unwrap();
            times.push(simulation.time());
        }
        for edge in [0.3333, 0.6667] {
            let found = times.iter().any(|time| (time - edge).abs() < 1e-12);
            assert!(found, "{}: {edge} is not in {times:?}", control.name());
        }
    }
}
