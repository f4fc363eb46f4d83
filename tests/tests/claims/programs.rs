//! Programs that use one library each, as a user would write them.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::Path;
use std::process::Command;

use tests::{dist, program, root, run};

/// What the program `name` of `tests/programs` prints.
fn printed(name: &str, arguments: &[&Path]) -> String {
    let output = Command::new(program(name)).args(arguments).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// The last value of the column `name` of a file of results.
fn last(file: &Path, name: &str) -> String {
    let text = fs::read_to_string(file).unwrap();
    let column = text
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|column| column.trim_matches('"') == name)
        .unwrap();
    text.lines().last().unwrap().split(',').nth(column).unwrap().to_owned()
}

fn command(arguments: &[&str]) {
    let output = run(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn twenty_lines_load_and_step_an_fmu_as_the_command_does() {
    let folder = tempfile::tempdir().unwrap();
    let (out, plant) = (folder.path().display().to_string(), dist().join("FrictionPendulum.fmu"));
    let plant_path = plant.display().to_string();
    command(&["run", &plant_path, "--stop-time", "10", "--step", "0.001", "--out", &out]);
    let x_p = last(&folder.path().join("results.csv"), "FrictionPendulum.x_p");
    let actual: f64 = printed("import", &[&plant]).parse().unwrap();
    assert_eq!(actual.to_bits(), x_p.parse::<f64>().unwrap().to_bits());
}

#[test]
fn thirty_lines_couple_two_fmus_as_the_command_does() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let [plant, controller] =
        ["FrictionPendulum.fmu", "AsoController.fmu"].map(|file| dist().join(file));
    let (first, second) = (plant.display().to_string(), controller.display().to_string());
    let paths = ["run", "--plant", &first, "--controller", &second];
    // The settings of `Algorithm::new`: Gauss-Seidel, limited slopes, fixed steps.
    let algorithm =
        ["--method", "gauss-seidel", "--extrapolation", "limited", "--coupling", "once"];
    let rest = ["--step", "0.001", "--stop-time", "10", "--out", &out];
    command(&[&paths[..], &algorithm, &rest].concat());
    let x_p = last(&folder.path().join("results.csv"), "plant.x_p");
    let actual: f64 = printed("couple", &[&plant, &controller]).parse().unwrap();
    assert_eq!(actual.to_bits(), x_p.parse::<f64>().unwrap().to_bits());
}

#[test]
fn a_system_toml_gives_the_same_results_by_the_library_and_by_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("system.toml");
    let entry = |name: &str, file: &str| format!("{name} = {:?}\n", dist().join(file));
    let text = format!(
        "[fmus]\n{}{}\n[experiment]\nstop-time = 1.0\n\n[results]\nfile = \"library.csv\"\n",
        entry("plant", "FrictionPendulum.fmu"),
        entry("controller", "AsoController.fmu")
    );
    fs::write(&file, text).unwrap();
    let written = printed("run-study", &[&file]);
    let other = folder.path().join("command.csv");
    let (system, results) = (file.display().to_string(), other.display().to_string());
    command(&["run", &system, "--results", &results]);
    assert_eq!(fs::read(written).unwrap(), fs::read(other).unwrap());
}

#[test]
fn a_design_is_the_same_by_the_library_and_by_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let plant = root().join("fmu-controller/pendulum.toml");
    let text = printed("make-design", &[&plant]);
    let file = folder.path().join("design.toml");
    let (plant, out) = (plant.display().to_string(), file.display().to_string());
    let output = run(&["design", &plant, "--out", &out]);
    assert_eq!(output.status.code(), Some(1), "the verdict on the pendulum is red");
    assert_eq!(text, fs::read_to_string(file).unwrap().trim());
}
