//! The command line, run as a process.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; numbers as written")]

use std::fs;
use std::process::Output;

use serde_json::Value;
use tests::{Table, dist, root, run};

use crate::run::fails;

/// Runs `reproduce` into a new folder with `more` arguments.
fn reproduce(more: &[&str]) -> (tempfile::TempDir, Output) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let fmus = folder.path().join("dist").display().to_string();
    let mut arguments = vec!["reproduce", "--out", &out, "--dist", &fmus];
    arguments.extend(more);
    let output = run(&arguments);
    (folder, output)
}

fn summary(folder: &tempfile::TempDir) -> Value {
    serde_json::from_slice(&fs::read(folder.path().join("summary.json")).unwrap()).unwrap()
}

/// Standard output and error.
fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

/// Checks that the command refuses with status 2 and a message that has all of `parts`.
fn refuses(arguments: &[&str], parts: &[&str]) {
    fails(&run(arguments), 2, parts);
}

#[test]
fn reproduce_reports_that_every_claim_of_the_paper_holds() {
    let (folder, output) = reproduce(&[]);
    println!("{}", said(&output));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let summary = summary(&folder);
    let claims = summary["claims"].as_array().unwrap();
    assert_eq!(claims.len(), 7);
    assert!(claims.iter().all(|claim| claim["holds"] == Value::Bool(true)));
    for figure in ["figure5", "figure6"] {
        let svg = fs::read_to_string(folder.path().join(format!("{figure}.svg"))).unwrap();
        assert!(svg.contains("</svg>"));
        let png = fs::read(folder.path().join(format!("{figure}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
    }
    let results = Table::read(&folder.path().join("results.csv"));
    let time = results.column("time");
    assert_eq!((time.len(), time[0], time[10_000]), (10_001, 0.0, 100.0));
    assert_eq!(results.column("plant.x_p")[0], 0.1);
    assert_eq!(results.column("controller.f_hat")[3999], 0.0);
}

#[test]
fn the_summary_certifies_the_design_by_theorem_1() {
    let (folder, _) = reproduce(&["--stop-time", "0.1"]);
    let design = &summary(&folder)["design"];
    let real = |pair: &Value| pair[0].as_f64().unwrap();
    let mut observer: Vec<_> =
        design["observer_eigenvalues"].as_array().unwrap().iter().map(real).collect();
    observer.sort_by(f64::total_cmp);
    assert_eq!(observer.len(), 5);
    for (actual, required) in observer.iter().zip([-3000.0, -2100.0, -1800.0, -1500.0, -1200.0]) {
        assert!((actual / required - 1.0).abs() < 1e-6, "{actual} {required}");
    }
    let theorem = &design["theorem_1"];
    assert_eq!(theorem["controllability_rank"], serde_json::json!([4, 4]));
    assert_eq!(theorem["observability_rank"], serde_json::json!([5, 5]));
    assert!(theorem["p_smallest_eigenvalue"].as_f64().unwrap() > 0.0);
    assert!(theorem["residual"].as_f64().unwrap() < 1e-9);
    assert!(theorem["delta"].as_f64().unwrap() > 0.0);
}

#[test]
fn the_papers_initial_state_reaches_the_same_residual_on_the_linearised_plant() {
    let (folder, output) = reproduce(&["--scenario", "paper-literal"]);
    println!("{}", said(&output));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let results = Table::read(&folder.path().join("results.csv"));
    assert_eq!(results.column("plant.x_p")[0], 1.1);
}

#[test]
fn with_the_printed_gains_the_nonlinear_pendulum_falls_and_the_report_says_so() {
    let (folder, output) = reproduce(&["--scenario", "printed-gains"]);
    println!("{}", said(&output));
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("expected: the printed gains lose the nonlinear plant"));
    let actual = summary(&folder)["design"]["observer_eigenvalues"].clone();
    let slowest = actual.as_array().unwrap().iter().map(|pair| pair[0].as_f64().unwrap());
    assert!((slowest.fold(f64::NEG_INFINITY, f64::max) + 9.1).abs() < 0.1, "{actual}");
}

#[test]
fn the_shipped_design_is_what_the_design_command_computes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("design.toml").display().to_string();
    let output = run(&["design", "fmu-controller/pendulum.toml", "--out", &file]);
    assert_eq!(output.status.code(), Some(1), "the verdict is red: {}", said(&output));
    assert!(said(&output).contains("the peak of S at the output is 5.583, above 4 (red)"));
    let table = |path: &str| fs::read_to_string(path).unwrap().parse::<toml::Table>().unwrap();
    let shipped = root().join("fmu-controller/resources/design.toml").display().to_string();
    let (computed, shipped) = (table(&file), table(&shipped));
    assert_eq!(computed.keys().collect::<Vec<_>>(), shipped.keys().collect::<Vec<_>>());
    for name in ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"] {
        let numbers = |table: &toml::Table| -> Vec<f64> {
            let rows = table[name].as_array().unwrap().iter();
            rows.flat_map(|row| row.as_array().unwrap().clone())
                .map(|entry| entry.as_float().unwrap())
                .collect()
        };
        let (computed, shipped) = (numbers(&computed), numbers(&shipped));
        assert_eq!(computed.len(), shipped.len(), "{name}");
        for (one, other) in computed.iter().zip(shipped) {
            assert!((one - other).abs() <= 1e-8 * other.abs(), "{name}: {one} {other}");
        }
    }
}

#[test]
fn settings_reach_the_fmu() {
    let (folder, output) = reproduce(&["--stop-time", "0.5", "--set", "plant.x_p_0=0.02"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let results = Table::read(&folder.path().join("results.csv"));
    assert_eq!(results.column("plant.x_p")[0], 0.02);
    assert_eq!(summary(&folder)["settings"], serde_json::json!(["plant.x_p_0=0.02"]));
}

#[test]
fn claims_that_a_short_run_cannot_decide_are_left_open() {
    let (folder, output) = reproduce(&["--stop-time", "0.5"]);
    assert_eq!(output.status.code(), Some(0));
    let summary = summary(&folder);
    assert!(summary["claims"].as_array().unwrap().iter().all(|claim| claim["holds"].is_null()));
    assert!(said(&output).contains("not judged"));
}

#[test]
fn a_file_that_cannot_be_written_after_the_run_is_status_1_as_any_lost_output() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("summary.json")).unwrap();
    let out = folder.path().display().to_string();
    let fmus = folder.path().join("dist").display().to_string();
    let output = run(&["reproduce", "--out", &out, "--dist", &fmus, "--stop-time", "0.1"]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("summary.json: "), "{}", said(&output));
    assert!(folder.path().join("results.csv").is_file());
}

/// Runs `run` on the packed FMUs with `more` arguments and expects a refusal.
fn run_refuses(more: &[&str], parts: &[&str]) {
    let plant = dist().join("FrictionPendulum.fmu").display().to_string();
    let controller = dist().join("AsoController.fmu").display().to_string();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let common = ["run", "--plant", &plant, "--controller", &controller, "--out", &out];
    let arguments: Vec<_> = common.into_iter().chain(more.iter().copied()).collect();
    refuses(&arguments, parts);
}

#[test]
fn bad_settings_are_refused_by_name_value_and_rule() {
    run_refuses(&["--set", "plant.F_d=1"], &["plant.F_d", "FrictionPendulum", "F_"]);
    run_refuses(&["--set", "motor.F_c=1"], &["motor", "plant, controller"]);
    run_refuses(&["--set", "plant.F_c=much"], &["plant.F_c", "much", "a number"]);
    run_refuses(&["--set", "plant.F_c=NaN"], &["plant.F_c", "F_c = NaN", "finite"]);
    run_refuses(&["--set", "plant.M=-1"], &["M = -1", "> 0"]);
    run_refuses(&["--set", "plant.F_s=20"], &["F_s = 20"]);
    run_refuses(&["--set", "plant.linearised=maybe"], &["maybe", "true or false"]);
    run_refuses(&["--set", "plant.x_p=1"], &["x_p", "calculated by the FMU"]);
    run_refuses(&["--set", "plant.F_c"], &["NAME=VALUE"]);
}

#[test]
fn bad_times_are_refused() {
    run_refuses(&["--step", "0"], &["communication step", "more than 0"]);
    run_refuses(&["--step", "-0.1"], &["-0.1"]);
    run_refuses(&["--step", "NaN"], &["communication step", "NaN"]);
    run_refuses(&["--stop-time", "-1"], &["stop time", "-1"]);
    run_refuses(&["--record-every", "0"], &["record-every"]);
}

#[test]
fn bad_connections_are_refused() {
    run_refuses(&["--connect", "plant.x_p=controller.u"], &["controller.u", "output", "input"]);
    run_refuses(&["--connect", "plant.x_p=controller.theta"], &["in m", "in rad"]);
    run_refuses(&["--connect", "plant.x_p=controller.compensate"], &["Boolean", "Real"]);
}

#[test]
fn bad_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.fmu");
    fs::write(&broken, b"PK\x03\x04 but no archive").unwrap();
    let broken = broken.display().to_string();
    refuses(&["run", &broken], &["broken.fmu"]);
    refuses(&["run", "missing.fmu"], &["missing.fmu"]);
    refuses(&["check", "missing.fmu"], &["missing.fmu"]);
    refuses(&["design", "missing.toml"], &["missing.toml"]);
    let plant = folder.path().join("plant.toml");
    let text = fs::read_to_string(root().join("fmu-controller/pendulum.toml")).unwrap();
    fs::write(&plant, text.replace("C = [", "CC = [")).unwrap();
    refuses(&["design", &plant.display().to_string()], &["CC"]);
    fs::write(&plant, text.replace("-9.0]", "]")).unwrap();
    refuses(&["design", &plant.display().to_string()], &["plant.toml", "expected"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn the_last_step_is_shortened_to_the_stop_time() {
    let (folder, output) =
        reproduce(&["--step", "0.003", "--stop-time", "0.01", "--record-every", "0.003"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let time = Table::read(&folder.path().join("results.csv")).column("time");
    assert_eq!(time.len(), 4);
    assert_eq!(summary(&folder)["reached"], 0.01);
}
