//! Messages on standard error.

use serde_json::Value;
use tests::c_fmu::CFmu;

use super::*;

const UNSOUND: [&str; 4] = ["--stop-time", "1", "--set", "plant.F_s=20"];

#[test]
fn messages_of_an_fmu_have_its_name_the_time_and_their_category() {
    let bench = Bench::new();
    let output = bench.coupled(&UNSOUND);
    fails(&output, 2, &["error: plant, t = 0 s, logStatusError: ", "F_s = 20"]);
}

#[test]
fn as_json_each_line_is_an_object() {
    let bench = Bench::new();
    let output = bench.coupled(&[&UNSOUND[..], &["--log-json"]].concat());
    assert_eq!(output.status.code(), Some(2));
    let lines: Vec<Value> =
        said(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let fmu = lines.iter().find(|line| line["target"] == "fmu").unwrap();
    assert_eq!(fmu["instance"], "plant");
    assert_eq!(fmu["category"], "logStatusError");
    assert_eq!((&fmu["time"], &fmu["level"]), (&Value::from(0.0), &Value::from("ERROR")));
    assert!(fmu["message"].as_str().unwrap().contains("F_s = 20"));
    let last = lines.last().unwrap();
    assert!(last["message"].as_str().unwrap().starts_with("plant at t = 0 s: fmi2EnterInit"));
}

#[test]
fn a_cause_is_stated_once() {
    let bench = Bench::new();
    let message = said(&bench.coupled(&UNSOUND));
    let last = message.lines().last().unwrap();
    assert_eq!(last.matches("returned fmi2Error").count(), 1, "{last}");
}

#[test]
fn a_run_without_problems_writes_nothing_to_standard_error() {
    let bench = Bench::new();
    assert_eq!(said(&bench.coupled(&["--stop-time", "0.1"])), "");
}

#[test]
fn a_results_file_that_is_replaced_is_one_line_on_standard_error() {
    let bench = Bench::new();
    let message =
        |more: &[&str]| said(&bench.coupled(&[&["--stop-time", "0.1"][..], more].concat()));
    assert_eq!(message(&[]), "");
    let line = message(&[]);
    let end = "out/results.csv: replaces the file of this name\n";
    assert!(line.starts_with("info: ") && line.ends_with(end), "{line:?}");
    assert_eq!(line.lines().count(), 1, "{line:?}");
    let line: Value = serde_json::from_str(&message(&["--log-json"])).unwrap();
    assert_eq!(line["level"], "INFO");
    assert_eq!(message(&["--results", "out/other.csv"]), "");
    // No run has written this file.
    bench.write("notes.csv", "mine\n");
    let line = message(&["--results", "notes.csv"]);
    assert!(line.ends_with("notes.csv: replaces the file of this name\n"), "{line:?}");
}

#[test]
fn fmus_without_common_names_run_unconnected_with_a_warning() {
    let bench = Bench::new();
    let fmus = ["a", "b"].map(|name| format!("{name}={}", fmu("FrictionPendulum")));
    let output = bench.run(&["--fmu", &fmus[0], "--fmu", &fmus[1], "--stop-time", "0.01"]);
    assert_eq!(printed(&output).lines().next(), Some("no connections"));
    assert!(
        said(&output).contains("warning: nothing is connected: no output has the name of an input")
    );
}

#[test]
fn misuse_is_refused_with_the_expected_input() {
    let bench = Bench::new();
    for (options, parts) in [
        (
            &["--method", "gauss-seidel-hold"][..],
            &["--method gauss-seidel --extrapolation hold"][..],
        ),
        (&["--method", "jakobi"], &["jacobi, gauss-seidel"]),
        (&["--extrapolation", "cubic"], &["hold, limited, linear, quadratic"]),
        (&["--coupling", "twice"], &["once, newton, anderson, quasi-newton"]),
        (&["--step-control", "free"], &["fixed, doubling, embedded, increment, energy"]),
        (&["--every", "plant=0"], &["above 0", "\"0\""]),
        (&["--every", "motor=2"], &["motor", "plant, controller"]),
        (&["--fmu", "a=b.fmu"], &["--plant"]),
        (&["--record", "plant.z*"], &["plant.z*"]),
        (&["--plot", "plant.zz"], &["plot", "plant.zz"]),
        (&["--plot", "plant.x_p", "--plot-file", "a.pdf"], &["a.pdf", ".svg"]),
        (&["--plot", "plant.x_p", "--record-every", "never"], &["never"]),
        (&["--plot-file", "a.svg"], &["--plot-file needs --plot NAMES"]),
        (&["--results", "a.xlsx"], &["a.xlsx", ".csv or .parquet"]),
        (&["--time-limit", "0"], &["--time-limit", "above 0"]),
        (&["--start-time", "5", "--stop-time", "4"], &["stop time", "4"]),
        (&["--relative-tolerance", "-1"], &["relative tolerance", "-1"]),
        (&["--connect", "plant.x_p"], &["OUTPUT=INPUT", "--connect plant.y=controller.y"]),
        (&["--connect", "plant.x_p:controller.x_p"], &["write --connect plant.x_p=controller.x_p"]),
        (&["--tolerance", "0"], &["--tolerance", "above 0"]),
    ] {
        fails(&bench.coupled(options), 2, parts);
        assert!(!bench.path("out/results.csv").exists(), "{options:?}");
    }
    fails(&run(&["run", "some.fmu"]), 2, &["some.fmu"]);
    fails(&run(&["run", "some.txt"]), 2, &["some.txt", ".fmu", ".ssp"]);
    fails(&run(&["run", "some.ssp", "b.fmu"]), 2, &["b.fmu", "--fmu NAME=FMU"]);
    fails(&run(&["run", "some.ssp", "--report", "r.html"]), 2, &["r.html: expected a system"]);
    fails(&run(&["run", "none.toml"]), 2, &["none.toml"]);
    fails(&run(&["run", "none.ssp"]), 2, &["none.ssp"]);
    fails(&bench.run(&["a.toml", "--plant", "b.fmu"]), 2, &["--plant"]);
    bench.write("empty.toml", "");
    fails(&bench.run(&["empty.toml"]), 2, &["no FMU"]);
}

#[test]
fn a_column_that_is_an_input_but_for_a_letter_is_named() {
    let bench = Bench::new();
    let fmu = CFmu::well_behaved().write(bench.folder.path(), "a");
    let system =
        format!("[fmus]\na = {fmu:?}\n[[scenario.table]]\ncsv = \"in.csv\"\nelement = \"a\"\n");
    let system = bench.write("system.toml", &system);
    let warnings = |column: &str| {
        bench.write("in.csv", &format!("time,i_in,{column}\n0,1,2\n"));
        let output = bench.run(&[&system, "--stop-time", "0.5", "--step", "0.5"]);
        said(&output).lines().filter(|line| line.starts_with("warning")).collect::<String>()
    };
    assert_eq!(warnings("other"), "");
    let warning = warnings("U");
    assert!(warning.contains("\"U\"") && warning.contains("a.u"), "{warning}");
}

#[test]
fn a_column_of_an_input_that_another_entry_drives_is_not_called_misspelt() {
    let bench = Bench::new();
    let fmu = CFmu::well_behaved().write(bench.folder.path(), "a");
    let system = format!(
        "[fmus]\na = {fmu:?}\n[[scenario.set]]\nvariable = \"a.i_in\"\nat = 0\nvalue = 1\n\
         [[scenario.table]]\ncsv = \"in.csv\"\nelement = \"a\"\n"
    );
    let system = bench.write("system.toml", &system);
    // The name differs by one letter from b_in, which is free.
    bench.write("in.csv", "time,u,i_in\n0,1,2\n");
    let output = bench.run(&[&system, "--stop-time", "0.5", "--step", "0.5"]);
    assert!(output.status.success(), "{}", said(&output));
    assert!(!said(&output).contains("warning"), "{}", said(&output));
}
