//! A run resumed from a checkpoint continues with the same bits.

use std::path::Path;
use std::sync::Arc;

use master::algorithm::PowerBond;
use master::{
    Algorithm, Checkpoint, Coupling, Extrapolation, Method, Simulation, StepControl, System, Value,
};
use study::scenario::{Scenario, Setup};
use tests::linear::{ABLE, Abilities, Block};
use tests::network::Network;
use tests::problems;

use crate::engine::until;

const FAULTS: &str = r#"
[[scenario.fault]]
connection = "b.u0"
delay = { seconds = 0.07, from = 0.05 }
[[scenario.fault]]
connection = "a.u0"
noise = { deviation = 0.01, seed = 7 }
"#;

#[derive(serde::Deserialize)]
struct File {
    scenario: Scenario,
}

fn prepared(text: &str, system: &System) -> master::Scenario {
    if text.is_empty() {
        return master::Scenario::default();
    }
    let file: File = toml::from_str(text).unwrap();
    let setup = Setup { folder: Path::new("."), start: 0.0, step: 0.01, tables: &[] };
    file.scenario.resolve(system, &setup).unwrap().scenario
}

/// Times and outputs of `steps` steps, as bits.
fn bits(simulation: &mut Simulation, network: &Network, steps: usize) -> Vec<u64> {
    let mut all = Vec::new();
    for _ in 0..steps {
        simulation.step().unwrap();
        all.push(simulation.time().to_bits());
        all.extend(network.outputs(simulation.system()).iter().map(|value| value.to_bits()));
    }
    all
}

fn verify(label: &str, able: Abilities, algorithm: &Algorithm, scenario: &str) {
    let network = problems::two_masses(20.0, 0.5);
    let new = || {
        let system = network.system(able, &Arc::default());
        let scenario = prepared(scenario, &system);
        (system, scenario)
    };
    let (system, scenario) = new();
    let mut whole = Simulation::with_scenario(system, algorithm, &until(100.0), scenario).unwrap();
    bits(&mut whole, &network, 13);
    let bytes = postcard::to_stdvec(&whole.checkpoint().unwrap()).unwrap();
    let checkpoint: Checkpoint = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(checkpoint.time(), whole.time());
    let expected = bits(&mut whole, &network, 20);
    let (system, scenario) = new();
    let resumed = Simulation::resume(system, algorithm, &until(100.0), scenario, &checkpoint);
    let resumed_bits = bits(&mut resumed.unwrap(), &network, 20);
    assert_eq!(resumed_bits, expected, "{label}");
}

#[test]
fn fixed_steps_continue_bit_by_bit() {
    let past = Abilities { derivatives: 0, ..ABLE };
    for sweep in [Method::Jacobi, Method::GaussSeidel] {
        for extrapolation in [
            Extrapolation::Hold,
            Extrapolation::Limited,
            Extrapolation::Linear,
            Extrapolation::Quadratic,
        ] {
            for multiples in [vec![], vec![1, 4], vec![3, 1]] {
                let label = format!("{} {} {multiples:?}", sweep.name(), extrapolation.name());
                let algorithm =
                    Algorithm { multiples, ..Algorithm::fixed(sweep, extrapolation, 0.01) };
                verify(&label, ABLE, &algorithm, "");
                verify(&label, past, &algorithm, FAULTS);
            }
        }
    }
}

#[test]
fn iterated_steps_continue_bit_by_bit() {
    for coupling in [Coupling::Newton, Coupling::Anderson, Coupling::QuasiNewton] {
        for control in [StepControl::Fixed, StepControl::Doubling] {
            let algorithm = Algorithm { coupling, control, ..Algorithm::new(0.01) };
            verify(coupling.name(), ABLE, &algorithm, "");
            verify(coupling.name(), ABLE, &algorithm, FAULTS);
        }
    }
}

#[test]
fn chosen_steps_continue_bit_by_bit() {
    let system = problems::two_masses(20.0, 0.5).system(ABLE, &Arc::default());
    let port = |name: &str| system.port(name).unwrap();
    let bonds = vec![PowerBond { first: port("b.u1"), second: port("a.u0") }];
    for control in
        [StepControl::Doubling, StepControl::Embedded, StepControl::Increment, StepControl::Energy]
    {
        let (bonds, relative_tolerance) = (bonds.clone(), 1e-2);
        let algorithm = Algorithm { control, bonds, relative_tolerance, ..Algorithm::new(0.01) };
        verify(control.name(), ABLE, &algorithm, "");
    }
}

#[test]
fn a_checkpoint_of_another_step_or_algorithm_is_refused_by_name() {
    let network = problems::two_masses(20.0, 0.5);
    let system = || network.system(ABLE, &Arc::default());
    let iterated = Algorithm { coupling: Coupling::Anderson, ..Algorithm::new(0.01) };
    let mut one = Simulation::new(system(), &iterated, &until(1.0)).unwrap();
    one.step().unwrap();
    let checkpoint = one.checkpoint().unwrap();
    let resume = |algorithm: &Algorithm, experiment: &fmu_description::Experiment| {
        let none = master::Scenario::default();
        let resumed = Simulation::resume(system(), algorithm, experiment, none, &checkpoint);
        resumed.err().map(|error| error.to_string())
    };
    let refused = |other: Algorithm, said: &str| {
        let message = resume(&other, &until(1.0)).unwrap();
        assert_eq!(message, format!("the checkpoint was taken with {said} is not possible"));
    };
    let base = || iterated.clone();
    refused(Algorithm { step: 0.02, ..base() }, "step 0.01 s; step 0.02 s");
    let control = StepControl::Doubling;
    refused(Algorithm { control, ..base() }, "step-control fixed; step-control doubling");
    let sweep = Method::Jacobi;
    refused(Algorithm { method: sweep, ..base() }, "method gauss-seidel; method jacobi");
    refused(
        Algorithm { extrapolation: Extrapolation::Hold, ..base() },
        "extrapolation limited; extrapolation hold",
    );
    let coupling = Coupling::Newton;
    refused(Algorithm { coupling, ..base() }, "coupling anderson; coupling newton");
    refused(Algorithm { iterations: 7, ..base() }, "iterations 50; iterations 7");
    let once = Algorithm { coupling: Coupling::Once, ..base() };
    refused(once, "coupling anderson; coupling once");
    let later = fmu_description::Experiment { start_time: 0.5, ..until(1.0) };
    let message = resume(&base(), &later).unwrap();
    assert!(message.contains("start-time 0 s; start-time 0.5 s"), "{message}");
    let mut other =
        Simulation::new(system(), &Algorithm { step: 0.02, ..base() }, &until(1.0)).unwrap();
    let message = other.restore(&checkpoint).unwrap_err().to_string();
    assert!(message.ends_with("step 0.01 s; step 0.02 s is not possible"), "{message}");
    // Settings that do not affect the state may differ.
    assert_eq!(resume(&Algorithm { jobs: 2, ..base() }, &until(2.0)), None);
}

/// Returns the error of a run of the second input and scenario that is resumed from a checkpoint of the first ones. The
/// inputs of `a` have the numbers 0 to 2; the one given is connected to `b.y0`.
fn resumed(first: (usize, &str), second: (usize, &str)) -> Option<String> {
    let algorithm = Algorithm::new(0.25);
    let new = |(input, text): (usize, &str)| {
        let receiver = Block::new(&[&[0.0]], &[&[1.0; 3]], &[&[1.0]], &[&[0.0; 3]], &[0.0]);
        let sender = Block::new(&[&[0.0]], &[&[1.0]], &[&[1.0]], &[&[0.0]], &[1.0]);
        let links = vec![((1, 0), (0, input))];
        let network = Network { blocks: vec![receiver, sender], links };
        let system = network.system(ABLE, &Arc::default());
        let scenario = prepared(text, &system);
        (system, scenario)
    };
    let (system, scenario) = new(first);
    let mut run = Simulation::with_scenario(system, &algorithm, &until(1.0), scenario).unwrap();
    run.step().unwrap();
    let checkpoint = run.checkpoint().unwrap();
    let (system, scenario) = new(second);
    let run = Simulation::resume(system, &algorithm, &until(1.0), scenario, &checkpoint);
    run.err().map(|error| error.to_string())
}

#[test]
fn a_checkpoint_of_other_connections_faults_or_driven_variables_is_refused_by_name() {
    let of = |saved: &str, present: &str| {
        let rule = "the same connections and driven variables in the same order";
        Some(format!("the checkpoint has {saved} in place of {present}, expected {rule}"))
    };
    let signal =
        |input: &str| format!("[[scenario.signal]]\nvariable = \"a.{input}\"\nconstant = 1\n");
    let (one, two) = (signal("u1"), signal("u2"));
    let expected = of("the driven variable a.u1", "the driven variable a.u2");
    assert_eq!(resumed((0, &one), (0, &two)), expected);
    let both = format!("{one}{two}");
    assert_eq!(resumed((0, &both), (0, &one)), of("the driven variable a.u2", "nothing"));
    let expected = of("the connection of b.y0 to a.u0", "the connection of b.y0 to a.u1");
    assert_eq!(resumed((0, ""), (1, "")), expected);
    let fault = |input: &str, kind: &str| {
        format!("[[scenario.fault]]\nconnection = \"a.{input}\"\n{kind}\n")
    };
    let bias = fault("u0", "bias = { value = 1 }");
    let other = |name: &str| {
        Some(format!(
            "{name} has other faults than in the checkpoint at t = 0.25 s: only faults that begin later may differ, \
             delays only if they begin later by more than their length"
        ))
    };
    assert_eq!(resumed((0, &bias), (0, "")), other("a.u0"));
    let larger = fault("u0", "bias = { value = 2 }");
    assert_eq!(resumed((0, &bias), (0, &larger)), other("a.u0"));
    let delayed = fault("u0", "delay = { seconds = 0.25, from = 0.5 }");
    assert_eq!(resumed((0, ""), (0, &delayed)), other("a.u0"));
    let [stuck, gain] =
        ["stuck = {}", "gain = { factor = 2 }"].map(|kind| format!("{one}{}", fault("u1", kind)));
    assert_eq!(resumed((0, &stuck), (0, &gain)), other("a.u1"));
    // The signal itself may have another future.
    assert_eq!(resumed((0, &one), (0, &one.replace("= 1", "= 2"))), None);
}

/// The run with the other faults from its start is the oracle.
#[test]
fn a_checkpoint_goes_on_with_other_faults_that_begin_later_bit_by_bit() {
    let receiver = Block::new(&[&[-1.0]], &[&[1.0, 2.0]], &[&[1.0]], &[&[0.0; 2]], &[0.0]);
    let sender = Block::new(&[&[-3.0]], &[&[1.0]], &[&[1.0]], &[&[0.0]], &[1.0]);
    let network = Network { blocks: vec![receiver, sender], links: vec![((1, 0), (0, 0))] };
    let algorithm = Algorithm::new(0.01);
    let new = |text: &str| {
        let system = network.system(ABLE, &Arc::default());
        let scenario = prepared(text, &system);
        (system, scenario)
    };
    let steps = |text: &str| {
        let (system, scenario) = new(text);
        let run = Simulation::with_scenario(system, &algorithm, &until(1.0), scenario);
        let mut run = run.unwrap();
        bits(&mut run, &network, 13);
        run
    };
    let begun = r#"
        [[scenario.signal]]
        variable = "a.u1"
        ramp = { from = 0, until = 1, begin = 0, end = 5 }
        [[scenario.fault]]
        connection = "a.u0"
        delay = { seconds = 0.07, from = 0.05 }
        "#;
    let more = r#"
        [[scenario.fault]]
        connection = "a.u0"
        dropout = { from = 0.25 }
        [[scenario.fault]]
        connection = "a.u0"
        delay = { seconds = 0.05, from = 0.2 }
        [[scenario.fault]]
        connection = "a.u1"
        stuck = { from = 0.2 }"#;
    let faults = format!("{begun}{more}");
    let later = faults.replace("from = 0.2 ", "from = 0.22 ");
    let (faults, later) = (faults.as_str(), later.as_str());
    for (first, second) in [(begun, faults), (faults, begun), (faults, later)] {
        let checkpoint = steps(first).checkpoint().unwrap();
        let (system, scenario) = new(second);
        let resumed = Simulation::resume(system, &algorithm, &until(1.0), scenario, &checkpoint);
        let actual = bits(&mut resumed.unwrap(), &network, 20);
        let mut whole = steps(second);
        assert_eq!(actual, bits(&mut whole, &network, 20), "{first} {second}");
        // A state of its own: faults that have begun since then have no memory.
        whole.restore(&checkpoint).unwrap();
        assert_eq!(actual, bits(&mut whole, &network, 20), "{first} {second}");
    }
}

#[test]
fn a_restored_run_shows_the_inputs_that_its_state_has() {
    let block = Block::new(&[&[0.0]], &[&[1.0]], &[&[1.0]], &[&[0.0]], &[0.0]);
    let system = Network { blocks: vec![block], links: Vec::new() }.system(ABLE, &Arc::default());
    let mut run = Simulation::new(system, &Algorithm::new(0.25), &until(1.0)).unwrap();
    let input = run.system().port("a.u0").unwrap();
    let mut readout = run.readout(&[input]);
    run.system().set_value(input, &Value::Real(3.0)).unwrap();
    run.step().unwrap();
    let checkpoint = run.checkpoint().unwrap();
    run.system().set_value(input, &Value::Real(5.0)).unwrap();
    run.restore(&checkpoint).unwrap();
    run.read(&mut readout).unwrap();
    let actual = run.system().get_value(input).unwrap();
    assert_eq!((actual, readout.reals[0]), (Value::Real(3.0), 3.0));
}

#[test]
fn a_run_that_a_slave_ended_stays_ended() {
    let (system, _) = crate::engine::puppet::system([f64::sin; 2], crate::engine::parts::ends);
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.25);
    let mut run = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
    while !run.is_finished() {
        run.step().unwrap();
    }
    let checkpoint = run.checkpoint().unwrap();
    let (system, _) = crate::engine::puppet::system([f64::sin; 2], crate::engine::parts::ends);
    let resumed = Simulation::resume(
        system,
        &algorithm,
        &until(1.0),
        master::Scenario::default(),
        &checkpoint,
    );
    let resumed = resumed.unwrap();
    assert!(resumed.is_finished());
    assert_eq!(resumed.ended_by(), Some("p"));
}
