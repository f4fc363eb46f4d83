//! Discrete time: what is sent at an instant arrives at this instant, whatever the order of the FMUs. The FMUs are
//! `tests/c/node3.c` and `tests/c/equations.c`; both are strict about the calls that their mode allows.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; times and counts are exact")]

use std::path::Path;

use fmu_description::Experiment;
use fmu_import::{Fmu, isolate};
use integrate::{Integrated, Options};
use master::drive::{Drive, DriveKind, DriveSource, Drives};
use master::signal::{Interpolation, Signal, Track};
use master::{
    Algorithm, AlgorithmRequest, Extrapolation, Method, Scenario, Simulation, System, SystemError,
    Value, choose,
};
use tests::{equations, isolated, node};

const STEP: f64 = 0.001;

/// A system of nodes: in their order, each with its parameters.
struct Nodes<'a> {
    nodes: &'a [(&'a str, &'a [(&'a str, &'a str)])],
    /// Sender and receiver.
    links: &'a [(&'a str, &'a str)],
}

impl Nodes<'_> {
    /// Connects the nodes in this order.
    fn system(&self, fmu: &Path, order: &[usize], isolate: bool) -> System {
        let mut system = System::default();
        for &number in order {
            let (name, parameters) = self.nodes[number];
            if isolate {
                let isolated_slave = isolate::open(fmu, name, &isolated::options()).unwrap();
                system.add(name, Box::new(isolated_slave)).unwrap();
            } else {
                system
                    .add(name, Box::new(Fmu::open_any(fmu).unwrap().instantiate(name).unwrap()))
                    .unwrap();
            }
            for (parameter, value) in parameters {
                system.set(&format!("{name}.{parameter}"), value).unwrap();
            }
        }
        for (from, to) in self.links {
            for (output, input) in [
                ("tx_clock", "rx_clock"),
                ("tx", "rx"),
                ("tx_time", "rx_time"),
                ("tx_data", "rx_data"),
                ("level", "level_in"),
            ] {
                system.connect(&format!("{from}.{output}"), &format!("{to}.{input}")).unwrap();
            }
        }
        system
    }

    /// Runs the nodes in their order.
    fn run(&self, stop: f64, request: &AlgorithmRequest) -> Result<Outcome, SystemError> {
        let folder = tempfile::tempdir().unwrap();
        let fmu = node::write(folder.path());
        let order: Vec<usize> = (0..self.nodes.len()).collect();
        run(self.system(&fmu, &order, false), stop, request)
    }
}

/// The discrete outputs of all nodes at all communication points.
struct Outcome {
    rows: Vec<(f64, Vec<(String, f64)>)>,
}

impl Outcome {
    fn last(&self, name: &str) -> f64 {
        let (_, row) = self.rows.last().unwrap();
        row.iter().find(|(column, _)| column == name).unwrap().1
    }

    /// The first time at which the variable has this value.
    fn first(&self, name: &str, value: f64) -> Option<f64> {
        let has = |row: &[(String, f64)]| {
            row.iter().any(|(column, number)| column == name && *number == value)
        };
        self.rows.iter().find(|(_, row)| has(row)).map(|(time, _)| *time)
    }
}

const OUTPUTS: [&str; 8] =
    ["received", "sum", "sent", "latency", "bytes", "level", "level_out", "tx"];

fn request() -> AlgorithmRequest {
    AlgorithmRequest { step: Some(STEP), ..AlgorithmRequest::default() }
}

fn algorithm(system: &System, stop: f64, request: &AlgorithmRequest) -> Algorithm {
    choose(system, request, stop).unwrap().algorithm
}

fn number(value: &Value) -> f64 {
    match value {
        Value::Real(value) => *value,
        Value::Integer(value) => f64::from(i32::try_from(*value).unwrap()),
        other => panic!("{other:?}"),
    }
}

fn row(simulation: &mut Simulation) -> (f64, Vec<(String, f64)>) {
    let time = simulation.time();
    let system = simulation.system();
    let mut names: Vec<String> = system.slaves.iter().map(|(name, _)| name.clone()).collect();
    names.sort();
    let mut values = Vec::new();
    for name in names {
        for output in OUTPUTS {
            let port = system.port(&format!("{name}.{output}")).unwrap();
            values.push((format!("{name}.{output}"), number(&system.get_value(port).unwrap())));
        }
    }
    (time, values)
}

fn run(system: System, stop: f64, request: &AlgorithmRequest) -> Result<Outcome, SystemError> {
    let algorithm = algorithm(&system, stop, request);
    let experiment = Experiment { stop_time: Some(stop), ..Experiment::default() };
    let mut simulation = Simulation::new(system, &algorithm, &experiment)?;
    let mut rows = vec![row(&mut simulation)];
    while !simulation.is_finished() {
        simulation.step()?;
        rows.push(row(&mut simulation));
    }
    simulation.terminate()?;
    Ok(Outcome { rows })
}

const SENDER: &[(&str, &str)] = &[("first", "1"), ("period", "0.003")];
const RECEIVER: &[(&str, &str)] = &[];

#[test]
fn what_two_nodes_send_each_other_arrives_at_the_time_it_is_sent() {
    let nodes = Nodes { nodes: &[("a", SENDER), ("b", SENDER)], links: &[("a", "b"), ("b", "a")] };
    let outcome = nodes.run(0.010, &request()).unwrap();
    for name in ["a", "b"] {
        // The messages 1, 2, 3, 4 at 0, 3, 6 and 9 ms.
        let of = |output: &str| outcome.last(&format!("{name}.{output}"));
        assert_eq!((of("sent"), of("received"), of("sum")), (4.0, 4.0, 10.0), "{name}");
        assert_eq!((of("bytes"), of("latency")), (10.0, 0.0), "{name}");
    }
    assert_eq!(outcome.first("b.received", 1.0), Some(0.0));
    assert!((outcome.first("b.received", 2.0).unwrap() - 0.003).abs() < 1e-12);
}

#[test]
fn a_value_without_a_clock_that_changes_at_an_event_arrives_at_this_event() {
    let nodes =
        Nodes { nodes: &[("a", &[("period", "0.004")]), ("b", RECEIVER)], links: &[("a", "b")] };
    let outcome = nodes.run(0.010, &request()).unwrap();
    assert_eq!(outcome.first("b.level_out", 1.0), outcome.first("a.level", 1.0));
    assert!((outcome.first("b.level_out", 1.0).unwrap() - 0.004).abs() < 1e-12);
}

/// 200 events, of which some are after their communication point by rounding.
#[test]
fn an_event_at_the_end_of_a_step_is_handled_there() {
    let nodes =
        Nodes { nodes: &[("a", &[("period", "0.001")]), ("b", RECEIVER)], links: &[("a", "b")] };
    let request = AlgorithmRequest { step: Some(0.0005), ..AlgorithmRequest::default() };
    let outcome = nodes.run(0.2, &request).unwrap();
    for (time, row) in &outcome.rows {
        let received = row.iter().find(|(name, _)| name == "b.received").unwrap().1;
        assert_eq!(received, (time / 0.001 + 1e-3).floor(), "{time}");
    }
    assert_eq!(outcome.last("b.received"), 200.0);
}

#[test]
fn an_announced_event_between_two_communication_points_ends_a_step() {
    let announced: &[(&str, &str)] = &[("period", "0.0025"), ("announces", "1")];
    let nodes = Nodes { nodes: &[("a", announced), ("b", RECEIVER)], links: &[("a", "b")] };
    let outcome = nodes.run(0.010, &request()).unwrap();
    assert_eq!(outcome.last("b.received"), 4.0);
    assert_eq!(outcome.last("b.latency"), 0.0);
    for message in 1..=4_u8 {
        let time = outcome.first("b.received", message.into()).unwrap();
        assert!((time - 0.0025 * f64::from(message)).abs() < 1e-12, "{time}");
    }
}

#[test]
fn messages_go_back_and_forth_within_one_instant() {
    let echo: &[(&str, &str)] = &[("limit", "9")];
    let first: &[(&str, &str)] = &[("first", "1"), ("limit", "9")];
    let nodes = Nodes { nodes: &[("a", first), ("b", echo)], links: &[("a", "b"), ("b", "a")] };
    let outcome = nodes.run(0.002, &request()).unwrap();
    // a sends 1, 3, 5, 7, 9 and b sends 2, 4, 6, 8, all at 0 s.
    let (_, start) = &outcome.rows[0];
    let at_start = |name: &str| start.iter().find(|(row, _)| row == name).unwrap().1;
    assert_eq!((at_start("b.received"), at_start("b.sum")), (5.0, 25.0));
    assert_eq!((at_start("a.received"), at_start("a.sum")), (4.0, 20.0));
    assert_eq!((outcome.last("b.received"), outcome.last("a.received")), (5.0, 4.0));
}

#[test]
fn an_instant_that_does_not_settle_is_an_error_with_its_signals() {
    let endless: &[(&str, &str)] = &[("first", "1"), ("limit", "1000000")];
    let nodes =
        Nodes { nodes: &[("a", endless), ("b", endless)], links: &[("a", "b"), ("b", "a")] };
    let Err(error) = nodes.run(0.002, &request()) else { panic!("it settles") };
    let text = error.to_string();
    assert!(
        text.starts_with("the events at t = 0 s do not settle within 1000 iterations"),
        "{text}"
    );
    assert!(text.contains("a.rx") && text.contains("b.rx"), "{text}");
}

#[test]
fn the_result_does_not_depend_on_the_order_of_the_nodes_nor_on_how_they_run() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = node::write(folder.path());
    let announced: &[(&str, &str)] =
        &[("period", "0.0025"), ("announces", "1"), ("first", "1"), ("limit", "5")];
    let nodes = Nodes {
        nodes: &[
            ("a", announced),
            ("b", &[("period", "0.002"), ("limit", "4")]),
            ("c", &[("limit", "3")]),
        ],
        links: &[("a", "b"), ("b", "c"), ("c", "a")],
    };
    let mut expected: Option<Outcome> = None;
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    for order in orders {
        for (method, jobs, isolate) in [
            (Method::GaussSeidel, 1, false),
            (Method::Jacobi, 1, false),
            (Method::Jacobi, 3, false),
            (Method::GaussSeidel, 1, true),
            (Method::Jacobi, 1, true),
        ] {
            let request = AlgorithmRequest { method: Some(method), jobs: Some(jobs), ..request() };
            let outcome = run(nodes.system(&fmu, &order, isolate), 0.011, &request).unwrap();
            match &expected {
                None => expected = Some(outcome),
                Some(expected) => {
                    assert_eq!(
                        outcome.rows, expected.rows,
                        "{order:?} {method:?} {jobs} {isolate}"
                    );
                }
            }
        }
    }
    let expected = expected.unwrap();
    assert!(expected.last("c.received") > 3.0);
    assert_eq!(expected.last("c.latency"), 0.0);
}

#[test]
fn a_resumed_run_has_the_ticks_of_the_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = node::write(folder.path());
    let nodes = Nodes { nodes: &[("a", SENDER), ("b", SENDER)], links: &[("a", "b"), ("b", "a")] };
    let experiment = Experiment { stop_time: Some(0.010), ..Experiment::default() };
    let build = || nodes.system(&fmu, &[0, 1], false);
    let algorithm = algorithm(&build(), 0.010, &request());
    let mut first = Simulation::new(build(), &algorithm, &experiment).unwrap();
    for _ in 0..5 {
        first.step().unwrap();
    }
    let checkpoint = first.checkpoint().unwrap();
    let scenario = Scenario::default();
    let mut second =
        Simulation::resume(build(), &algorithm, &experiment, scenario, &checkpoint).unwrap();
    while !first.is_finished() {
        first.step().unwrap();
        second.step().unwrap();
        assert_eq!(row(&mut second), row(&mut first));
    }
    assert!(second.is_finished());
}

#[test]
fn a_step_that_is_repeated_repeats_its_events() {
    let nodes = Nodes { nodes: &[("a", SENDER), ("b", SENDER)], links: &[("a", "b"), ("b", "a")] };
    let once = nodes.run(0.010, &request()).unwrap();
    let rollback = AlgorithmRequest { rollback: Some(true), ..request() };
    assert_eq!(nodes.run(0.010, &rollback).unwrap().rows, once.rows);
}

/// The system of one model-exchange FMU whose input `name` follows `points` from one value to the next.
fn driven(
    name: &str,
    (times, values): (&[f64], &[f64]),
    step: f64,
) -> (Simulation, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let fmu = Fmu::open_any(&equations::write(folder.path())).unwrap();
    let equations = fmu.instantiate_equations("m").unwrap();
    let mut system = System::default();
    system.add("m", Box::new(Integrated::new(equations, Options::default()))).unwrap();
    let port = system.port(name).unwrap();
    let is_integer = name == "m.mode";
    let between = if is_integer { Interpolation::Hold } else { Interpolation::Line };
    let track = Track::new(times.into(), values.into(), between).unwrap();
    let following =
        DriveSource { signal: Signal::Track(track), start: f64::NEG_INFINITY, texts: Vec::new() };
    let kind = if is_integer {
        DriveKind::Integer { least: i64::MIN, largest: i64::MAX }
    } else {
        DriveKind::Real { derivatives: true }
    };
    let reference = system.variable(port).value_reference;
    let drives = Drives::new(vec![Drive::new(port, reference, kind, following)]);
    let scenario = Scenario { drives, faults: Vec::new() };
    let experiment =
        Experiment { stop_time: Some(1.0), tolerance: Some(1e-10), ..Experiment::default() };
    let algorithm = Algorithm::new(step);
    (Simulation::with_scenario(system, &algorithm, &experiment, scenario).unwrap(), folder)
}

fn value(simulation: &mut Simulation, name: &str) -> f64 {
    let system = simulation.system();
    let port = system.port(name).unwrap();
    number(&system.get_value(port).unwrap())
}

#[test]
fn an_input_that_jumps_at_a_sample_is_seen_by_this_sample() {
    // The FMU samples at 0.25, 0.5, ... s. FMPy, and the code of FMI 3.0.2, section 3.2, set inputs before they
    // update the discrete states.
    let (mut simulation, _folder) = driven("m.mode", (&[0.0, 0.25], &[1.0, 7.0]), 0.125);
    while simulation.time() < 0.25 {
        assert_eq!(value(&mut simulation, "m.mode_out"), 1.0);
        simulation.step().unwrap();
    }
    assert_eq!(value(&mut simulation, "m.mode_out"), 7.0);
    assert_eq!(value(&mut simulation, "m.ticks"), 1.0);
}

#[test]
fn an_input_that_jumps_between_two_communication_points_jumps_there() {
    // x' = -(x - u) with x(0) = 1 and u = 0 until 0.25 s, then 1.
    let points: (&[f64], &[f64]) = (&[0.0, 0.25, 0.25, 2.0], &[0.0, 0.0, 1.0, 1.0]);
    let (mut simulation, _folder) = driven("m.u", points, 0.1);
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    let exact = 1.0 - (1.0 - (-0.25_f64).exp()) * (-0.75_f64).exp();
    let error = value(&mut simulation, "m.x") - exact;
    assert!(error.abs() < 1e-9, "{error:e}");
}

#[test]
fn a_discrete_real_is_held_under_every_extrapolation() {
    // A signal that jumps to the square of its step number in each step: what a receiver gets is one of its values.
    for extrapolation in [
        Extrapolation::Hold,
        Extrapolation::Limited,
        Extrapolation::Linear,
        Extrapolation::Quadratic,
    ] {
        for method in [Method::Jacobi, Method::GaussSeidel] {
            let mut system = System::default();
            system.add("s", Box::new(stairs::Stairs::new(true))).unwrap();
            system.add("r", Box::new(stairs::Stairs::new(false))).unwrap();
            system.connect("s.y", "r.u").unwrap();
            let algorithm = Algorithm { extrapolation, method, ..Algorithm::new(1.0) };
            let experiment = Experiment { stop_time: Some(6.0), ..Experiment::default() };
            let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
            while !simulation.is_finished() {
                simulation.step().unwrap();
                let received = value(&mut simulation, "r.u");
                assert_eq!(received, received.round(), "{extrapolation:?} {method:?}");
            }
            assert!(value(&mut simulation, "r.u") >= 25.0, "{extrapolation:?} {method:?}");
        }
    }
}

/// A sampled slave without events: its discrete output is the square of the number of its steps.
mod stairs {
    use fmu_description::ModelDescription;
    use master::{CallError, Slave, StepResult};

    pub(super) struct Stairs {
        description: ModelDescription,
        u: f64,
        y: f64,
        steps: f64,
    }

    impl Stairs {
        pub(super) fn new(sends: bool) -> Self {
            let variable = if sends {
                r#"<ScalarVariable name="y" valueReference="1" causality="output" variability="discrete"><Real/>
                </ScalarVariable>"#
            } else {
                r#"<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>"#
            };
            let structure = if sends {
                r#"<Outputs><Unknown index="1" dependencies=""/></Outputs>"#
            } else {
                ""
            };
            let xml = format!(
                r#"<fmiModelDescription fmiVersion="2.0" modelName="Stairs" guid="stairs">
                <CoSimulation modelIdentifier="S" canHandleVariableCommunicationStepSize="true"/>
                <ModelVariables>{variable}</ModelVariables><ModelStructure>{structure}</ModelStructure>
                </fmiModelDescription>"#
            );
            let description = ModelDescription::parse(xml).unwrap();
            Self { description, u: 0.0, y: 0.0, steps: 0.0 }
        }
    }

    impl Slave for Stairs {
        fn description(&self) -> &ModelDescription {
            &self.description
        }
        fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
            for (reference, value) in references.iter().zip(values) {
                *value = if *reference == 1 { self.y } else { self.u };
            }
            Ok(())
        }
        fn set_real(&mut self, _: &[u32], values: &[f64]) -> Result<(), CallError> {
            self.u = values[0];
            Ok(())
        }
        fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
            self.steps += 1.0;
            self.y = self.steps * self.steps;
            Ok(StepResult::Whole)
        }
    }
}

#[test]
fn the_explanation_says_how_each_connection_passes_its_signal() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = Nodes { nodes: &[("a", SENDER), ("b", RECEIVER)], links: &[("a", "b")] };
    let system = nodes.system(&node::write(folder.path()), &[0, 1], false);
    let reasons = choose(&system, &request(), 0.01).unwrap().reasons.join("\n");
    for part in [
        "discrete, passed on at the event at which they change: a.level -> b.level_in",
        "clocked, passed on at the ticks of their clock: a.tx_clock -> b.rx_clock, a.tx -> b.rx",
    ] {
        assert!(reasons.contains(part), "{reasons}");
    }
}
