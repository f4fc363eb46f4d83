//! The written results equal those that the library computes.

use master::Transformation;
use master::{Algorithm, Coupling, Extrapolation, Method, Probe, Simulation, StepControl, System};
use ssp::{Link, Terminal};
use tests::{Table, closed_loop, simulation};

use super::*;

const NAMES: [&str; 4] = ["plant.x_p", "plant.regime", "controller.u", "controller.f_hat"];

/// Time and values of [`NAMES`] at every communication point up to `stop`.
fn rows(simulation: &mut Simulation, probe: &mut Probe, stop: f64) -> Vec<[f64; 5]> {
    let mut rows = Vec::new();
    loop {
        let time = simulation.time();
        let mut values = [0.0; 4];
        probe.read(simulation.system(), time, &mut values).unwrap();
        rows.push([time, values[0], values[1], values[2], values[3]]);
        if time >= stop - 1e-9 {
            return rows;
        }
        simulation.step().unwrap();
    }
}

fn computed(system: System, algorithm: &Algorithm, stop: f64) -> Vec<[f64; 5]> {
    let (mut simulation, mut probe) = simulation(system, algorithm, &NAMES);
    rows(&mut simulation, &mut probe, stop)
}

fn written(path: &Path) -> Vec<[f64; 5]> {
    let table = Table::read(path);
    let columns = ["time"].into_iter().chain(NAMES).map(|name| table.column(name));
    let columns: Vec<_> = columns.collect();
    (0..columns[0].len()).map(|row| std::array::from_fn(|k| columns[k][row])).collect()
}

#[test]
fn each_option_of_the_algorithm_acts_like_the_setting_of_the_library() {
    let fixed = |sweep, extrapolation| Algorithm::fixed(sweep, extrapolation, 0.001);
    let default = fixed(Method::GaussSeidel, Extrapolation::Limited);
    let cases: [(&[&str], Algorithm); 9] = [
        (&[], default.clone()),
        (&["--method", "jacobi"], fixed(Method::Jacobi, Extrapolation::Limited)),
        (
            &["--method", "jacobi", "--extrapolation", "hold"],
            fixed(Method::Jacobi, Extrapolation::Hold),
        ),
        (&["--extrapolation", "quadratic"], fixed(Method::GaussSeidel, Extrapolation::Quadratic)),
        (
            &["--step", "0.0005"],
            Algorithm::fixed(Method::GaussSeidel, Extrapolation::Limited, 0.0005),
        ),
        (&["--coupling", "newton"], Algorithm { coupling: Coupling::Newton, ..default.clone() }),
        (&["--every", "controller=2"], Algorithm { multiples: vec![1, 2], ..default.clone() }),
        (&["--jobs", "2", "--method", "jacobi"], fixed(Method::Jacobi, Extrapolation::Limited)),
        (
            &["--extrapolation", "linear", "--allow-nan"],
            fixed(Method::GaussSeidel, Extrapolation::Linear),
        ),
    ];
    let mut seen = Vec::new();
    for (options, algorithm) in cases {
        let bench = Bench::new();
        let more = [&["--stop-time", "0.3", "--record-every", "step"], options].concat();
        bench.coupled_well(&more);
        let written = written(&bench.path("out/results.csv"));
        let settings = [("plant.x_p_0", "0.1")];
        // Between the ends of an FMU's step, the probe reads the value at the end of that step.
        let common = algorithm.multiples.iter().max().map_or(1, |&multiple| multiple as usize);
        let computed = computed(closed_loop(&settings), &algorithm, 0.3);
        assert_eq!(written.len(), computed.len(), "{options:?}");
        let meeting = |rows: &[[f64; 5]]| rows.iter().step_by(common).copied().collect::<Vec<_>>();
        assert_eq!(meeting(&written), meeting(&computed), "{options:?}");
        seen.push(written);
    }
    let same = |one: usize, other: usize| seen[one] == seen[other];
    assert!(!same(0, 1) && !same(1, 2) && !same(0, 3) && !same(0, 6), "the options do something");
    assert!(same(1, 7), "threads change nothing");
}

#[test]
fn step_control_and_tolerances_reach_the_engine() {
    let bench = Bench::new();
    let control = ["--step-control", "doubling", "--step", "0.002"];
    let tolerances = ["--relative-tolerance", "1e-3", "--absolute-tolerance", "1e-5"];
    bench.coupled_well(&[&["--stop-time", "0.2"][..], &control, &tolerances].concat());
    let written = written(&bench.path("out/results.csv"));
    let algorithm = Algorithm {
        control: StepControl::Doubling,
        relative_tolerance: 1e-3,
        absolute_tolerance: 1e-5,
        ..Algorithm::new(0.002)
    };
    let system = closed_loop(&[]);
    let ports: Vec<_> = NAMES.iter().map(|name| system.port(name).unwrap()).collect();
    let mut probe = Probe::new(&system, &ports);
    let experiment = fmu_description::Experiment {
        stop_time: Some(0.2),
        ..fmu_description::Experiment::default()
    };
    let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
    assert_eq!(written, rows(&mut simulation, &mut probe, 0.2));
    let sizes: Vec<_> = written.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    assert!(sizes.iter().any(|size| (size - sizes[0]).abs() > 1e-6), "steps vary: {sizes:?}");
}

#[test]
fn a_connection_of_the_file_has_its_factor_and_offset() {
    let bench = Bench::new();
    let wire = |from: &str, to: &str| format!("[[connections]]\nfrom = '{from}'\nto = '{to}'\n");
    let wires = [
        wire("plant.x_p", "controller.x_p"),
        wire("plant.theta", "controller.theta"),
        wire("controller.u", "plant.u"),
        wire("controller.f_hat", "plant.f_a") + "factor = -0.5\noffset = 0.25\n",
    ];
    let more = "[settings]\ncontroller.t_on = 0.1\n[experiment]\nstop-time = 0.4\n";
    let file = bench.write("system.toml", &system_toml(&(wires.concat() + more)));
    printed(&bench.run(&[&file, "--out", "out"]));
    let mut system = closed_loop(&[("controller.t_on", "0.1")]);
    let terminal = |element: &str, variable: &str| Terminal {
        element: element.to_owned(),
        variable: variable.to_owned(),
    };
    let link = Link {
        from: terminal("controller", "f_hat"),
        to: terminal("plant", "f_a"),
        transformation: Transformation::Linear { factor: -0.5, offset: 0.25 },
        units_settled: true,
    };
    study::link(&mut system, &link).unwrap();
    let written = written(&bench.path("out/results.csv"));
    assert_eq!(written, computed(system, &Algorithm::new(0.001), 0.4));
    assert!(written.last().unwrap()[4] != 0.0, "the estimate is at work");
}

#[test]
fn a_run_starts_at_its_start_time() {
    let bench = Bench::new();
    let times = ["--start-time", "-1.5", "--stop-time", "0.5", "--record-every", "0.25"];
    bench.coupled_well(&times);
    let time = Table::read(&bench.path("out/results.csv")).column("time");
    let expected: Vec<_> = (-6..=2).map(|k| 0.25 * f64::from(k)).collect();
    assert_eq!(time.len(), expected.len());
    assert!(time.iter().zip(expected).all(|(one, other)| (one - other).abs() < 1e-12), "{time:?}");
}

#[test]
fn isolated_fmus_give_the_same_bytes() {
    let (here, apart) = (Bench::new(), Bench::new());
    here.coupled_well(&["--stop-time", "0.5"]);
    apart.coupled_well(&["--stop-time", "0.5", "--isolate", "--time-limit", "60"]);
    assert_eq!(here.read("out/results.csv"), apart.read("out/results.csv"));
}

#[test]
fn an_ssp_gives_the_same_bytes_as_its_fmus_named_one_by_one() {
    let (named, packed) = (Bench::new(), Bench::new());
    named.coupled_well(&["--stop-time", "0.5"]);
    let system = closed_loop(&[]);
    let links = system.connections.iter().map(|connection| {
        let terminal = |port: master::Port| Terminal {
            element: system.slaves[port.slave].0.clone(),
            variable: system.variable(port).name.clone(),
        };
        let (from, to) = (terminal(connection.from), terminal(connection.to));
        Link { from, to, transformation: Transformation::Identity, units_settled: false }
    });
    let element = |name: &str, file: &str| ssp::Element {
        name: name.to_owned(),
        fmu: fmu(file).into(),
        ..Default::default()
    };
    let assembly = ssp::Assembly {
        name: Some("pendulum".to_owned()),
        elements: vec![
            element("plant", "FrictionPendulum"),
            element("controller", "AsoController"),
        ],
        functions: Vec::new(),
        links: links.collect(),
        start_time: Some(0.0),
        stop_time: Some(0.5),
    };
    ssp::write(&assembly, None, &packed.path("pendulum.ssp")).unwrap();
    printed(&packed.run(&["pendulum.ssp", "--out", "out"]));
    assert_eq!(named.read("out/results.csv"), packed.read("out/results.csv"));
}
