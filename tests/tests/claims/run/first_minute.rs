//! A user's first runs: FMUs by their files, the summary, the log of calls.

use tests::c_fmu::CFmu;
use tests::c_versions;

use super::*;

/// Writes an FMU whose input and output have these units, and returns its path.
fn unit_fmu(bench: &Bench, name: &str, input: &str, output: &str) -> String {
    let fmu = CFmu::well_behaved().with_units(input, output);
    fmu.write(bench.folder.path(), name).display().to_string()
}

#[test]
fn fmus_given_by_their_files_get_their_names_and_are_connected_by_name() {
    let bench = Bench::new();
    let (plant, controller) = (fmu("FrictionPendulum"), fmu("AsoController"));
    let out = printed(&bench.run(&[&plant, &controller, "--stop-time", "0.01", "--out", "a"]));
    assert!(out.contains("FrictionPendulum.x_p -> AsoController.x_p\n"), "{out}");
    assert!(out.contains("AsoController.u -> FrictionPendulum.u\n"), "{out}");
    // The same run with names stated for the FMUs.
    printed(&bench.coupled(&["--stop-time", "0.01"]));
    let rows = |name: &str| bench.read(name).lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(rows("a/results.csv"), rows("out/results.csv"));
}

#[test]
fn an_fmu_given_twice_gets_two_names() {
    let bench = Bench::new();
    let tank = unit_fmu(&bench, "tank", "m", "m");
    let out = bench.run(&[&tank, &tank, "--connect", "tank.y=tank_2.u", "--stop-time", "0.1"]);
    assert!(printed(&out).contains("tank.y -> tank_2.u"));
}

#[test]
fn the_only_free_output_and_input_of_a_unit_are_connected_and_reported() {
    let bench = Bench::new();
    let pump = unit_fmu(&bench, "pump", "V", "m3/s");
    let tank = unit_fmu(&bench, "tank", "m3/s", "m");
    let output = bench.run(&[&pump, &tank, "--stop-time", "0.1"]);
    assert!(printed(&output).contains("pump.y -> tank.u"), "{}", printed(&output));
    let message = said(&output);
    assert!(message.contains("warning: pump.y and tank.u are connected because"), "{message}");
    // Inputs that remain are listed with the option that sets each.
    assert!(printed(&output).contains("  pump.u: set it by --set pump.u=VALUE"));
    assert!(printed(&output).contains("  pump.i_in: set it by --set pump.i_in=VALUE"));
}

#[test]
fn an_input_with_a_setting_or_a_signal_is_not_said_to_keep_its_start_value() {
    let bench = Bench::new();
    let [a, b] = ["a", "b"].map(|name| unit_fmu(&bench, name, "V", "m"));
    let text = format!(
        "[fmus]\na = '{a}'\nb = '{b}'\n[settings]\na.i_in = 7\n\
         [[scenario.signal]]\nvariable = \"a.u\"\nconstant = 2\n"
    );
    let system = bench.write("system.toml", &text);
    let list = printed(&bench.run(&[&system, "--stop-time", "0.1", "--set", "b.b_in=true"]));
    for (input, is_open) in
        [("a.u", false), ("a.i_in", false), ("b.b_in", false), ("b.u", true), ("a.b_in", true)]
    {
        assert_eq!(list.contains(&format!("\n  {input}: ")), is_open, "{input}: {list}");
    }
}

#[test]
fn a_clock_is_not_said_to_keep_its_start_value() {
    let bench = Bench::new();
    let fmu = c_versions::slave_3(bench.folder.path(), "plain", true).display().to_string();
    let list = printed(&bench.run(&[&fmu, &fmu, "--stop-time", "0.1"]));
    assert!(list.contains("\n  slave3.u: "), "{list}");
    assert!(!list.contains(".tick:"), "{list}");
}

#[test]
fn no_connection_is_proposed_that_closes_a_loop_over_a_unit() {
    let bench = Bench::new();
    let (plant, controller) = (fmu("FrictionPendulum"), fmu("AsoController"));
    let output = printed(&bench.run(&[&plant, &controller, "--stop-time", "0.01", "--out", "a"]));
    // The controller, which the plant feeds, estimates this force in N.
    let line = "  FrictionPendulum.f_a: set it by --set FrictionPendulum.f_a=VALUE\n";
    assert!(output.contains(line), "{output}");
    assert!(!output.contains("f_hat="), "{output}");
}

#[test]
fn outputs_and_inputs_whose_units_match_in_several_ways_are_not_connected() {
    let bench = Bench::new();
    let pumps = ["one", "two"].map(|name| unit_fmu(&bench, name, "V", "m3/s"));
    let tank = unit_fmu(&bench, "tank", "m3/s", "m");
    let output = bench.run(&[&pumps[0], &pumps[1], &tank, "--stop-time", "0.1"]);
    let printed = printed(&output);
    assert!(printed.starts_with("no connections\n"), "{printed}");
    let both = "  tank.u: --connect one.y=tank.u or --connect two.y=tank.u\n";
    assert!(printed.contains(both), "{printed}");
}

#[test]
fn a_run_reports_the_time_reached_and_the_file_of_its_results() {
    let bench = Bench::new();
    let printed = bench.coupled_well(&["--stop-time", "0.25", "--step", "0.125"]);
    let lines: Vec<_> = printed.lines().collect();
    let summary = lines[lines.len() - 2];
    assert!(summary.starts_with("t = 0.25 s reached in 2 steps and "), "{summary}");
    assert!(summary.ends_with(" times real time"), "{summary}");
    assert!(lines[lines.len() - 1].ends_with("results.csv"), "{printed}");
}

/// The calls of section 4.2.4 in order, with arguments, results and statuses.
#[test]
fn the_log_of_calls_has_every_call_of_a_run() {
    let bench = Bench::new();
    let path = CFmu::well_behaved().write(bench.folder.path(), "a").display().to_string();
    for isolate in [&[][..], &["--isolate"]] {
        let mut arguments = vec![path.as_str(), "--set", "a.t1=2.5", "--log-calls", "calls.txt"];
        arguments.extend(["--step", "0.5", "--stop-time", "1", "--record", "a.y"]);
        arguments.extend(isolate);
        printed(&bench.run(&arguments));
        let calls = bench.read("calls.txt");
        let expected = [
            "a fmi2Instantiate(\"a\", fmi2CoSimulation, \"as it should\") -> fmi2OK",
            "a fmi2SetupExperiment(no tolerance, start time 0.0, stop time 1.0) -> fmi2OK",
            "a fmi2SetReal([2], [2.5]) -> fmi2OK",
            "a fmi2EnterInitializationMode() -> fmi2OK",
            "a fmi2GetReal([2]) -> fmi2OK [2.5]",
            "a fmi2ExitInitializationMode() -> fmi2OK",
            "a fmi2GetReal([2]) -> fmi2OK [2.5]",
            "a fmi2GetReal([1]) -> fmi2OK [0.0]",
            "a fmi2DoStep(0.0, 0.5, true) -> fmi2OK",
            "a fmi2GetReal([1]) -> fmi2OK [0.5]",
            "a fmi2DoStep(0.5, 0.5, true) -> fmi2OK",
            "a fmi2GetReal([1]) -> fmi2OK [1.0]",
            "a fmi2Terminate() -> fmi2OK",
            "a fmi2FreeInstance()",
        ];
        let mut rest = calls.lines();
        for call in expected {
            assert!(rest.any(|line| line == call), "{call:?} is not in its place in\n{calls}");
        }
    }
}

#[test]
fn a_run_without_a_call_keeps_the_log_of_calls_of_an_earlier_one() {
    let bench = Bench::new();
    let log = ["--step", "0.5", "--stop-time", "1", "--log-calls", "calls.txt"];
    let earlier = "an earlier line\n".repeat(1000);
    bench.write("calls.txt", &earlier);
    fails(&bench.run(&[&log[..], &["--fmu", "a=none.fmu"]].concat()), 2, &["none.fmu"]);
    assert_eq!(bench.read("calls.txt"), earlier);
    let path = CFmu::well_behaved().write(bench.folder.path(), "a").display().to_string();
    printed(&bench.run(&[&log[..], &[path.as_str()]].concat()));
    let calls = bench.read("calls.txt");
    assert!(calls.starts_with("a fmi2Instantiate(") && !calls.contains("earlier"), "{calls}");
}

#[test]
fn the_log_of_calls_distinguishes_warnings_from_ok() {
    let bench = Bench::new();
    let fmu = CFmu::that("warn everywhere").write(bench.folder.path(), "a");
    let path = fmu.display().to_string();
    printed(&bench.run(&[&path, "--step", "0.5", "--stop-time", "1", "--log-calls", "calls.txt"]));
    let calls = bench.read("calls.txt");
    assert!(calls.contains("a fmi2DoStep(0.0, 0.5, true) -> fmi2Warning\n"), "{calls}");
    assert!(calls.contains("a fmi2GetReal([1]) -> fmi2Warning [0.0]\n"), "{calls}");
    assert!(calls.contains("a fmi2DoStep(0.5, 0.5, true) -> fmi2Warning\n"), "{calls}");
}

#[test]
fn the_log_of_calls_ends_with_the_call_that_failed() {
    let bench = Bench::new();
    let fmu = CFmu::that("fail in fmi2DoStep").write(bench.folder.path(), "a");
    let path = fmu.display().to_string();
    fails(&bench.run(&[&path, "--step", "0.25", "--log-calls", "calls.txt"]), 1, &["fmi2DoStep"]);
    let calls = bench.read("calls.txt");
    assert!(calls.contains("a fmi2DoStep(0.5, 0.25, true) -> fmi2Error\n"), "{calls}");
}

/// Each row of a driven input has the signal's value at its time, also at a jump of the signal and
/// while the FMU still has the value of the previous step.
#[test]
fn driven_inputs_are_recorded_with_the_value_of_their_signal() {
    let bench = Bench::new();
    let fmu = CFmu::well_behaved().write(bench.folder.path(), "a");
    let text = format!(
        "[fmus]\na = '{}'\n[[scenario.signal]]\nvariable = \"a.u\"\npoints = [[0, 2], [1, 4]]\n\
         [[scenario.signal]]\nvariable = \"a.i_in\"\nsteps = [[0, 5], [0.5, 6]]\n\
         [algorithm]\nstep = 0.25\n[experiment]\nstop-time = 1\n",
        fmu.display()
    );
    let path = bench.write("system.toml", &text);
    printed(&bench.run(&[&path, "--record", "a.u", "--record", "a.i_in", "--out", "out"]));
    let rows: Vec<String> =
        bench.read("out/results.csv").lines().skip(1).map(str::to_owned).collect();
    assert_eq!(rows, ["0.0,2.0,5", "0.25,2.5,5", "0.5,3.0,6", "0.75,3.5,6", "1.0,4.0,6"]);
}
