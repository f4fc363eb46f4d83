//! Model-exchange FMUs in `aso-ftc run` and `aso-ftc check`.

use std::fs;
use std::path::Path;

use tempfile::TempDir;
use tests::{equations, run};

/// The output of a command: exit status, standard output, standard error.
fn output(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = run(arguments);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn fmu() -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = equations::write(folder.path()).display().to_string();
    (folder, path)
}

#[test]
fn an_fmu_without_co_simulation_runs_and_the_explanation_says_how() {
    let (folder, path) = fmu();
    let out = folder.path().display().to_string();
    let log = folder.path().join("calls.log").display().to_string();
    let arguments = ["run", &path, "--out", &out, "--explain", "--log-calls", &log];
    let (status, said, errors) = output(&arguments);
    assert_eq!(status, Some(0), "{errors}");
    assert!(said.contains("equations runs by model exchange: the master integrates it"), "{said}");
    assert!(said.contains("solver automatic"), "{said}");
    let results = fs::read_to_string(folder.path().join("results.csv")).unwrap();
    let names: Vec<&str> = results.lines().next().unwrap().split(',').collect();
    let last: Vec<&str> = results.lines().last().unwrap().split(',').collect();
    let at = |name: &str| {
        let column = names.iter().position(|column_name| column_name.trim_matches('"') == name);
        last[column.unwrap_or_else(|| panic!("{name} in {names:?}"))]
    };
    let decay: f64 = at("equations.x").parse().unwrap();
    assert!((decay - (-1.0_f64).exp()).abs() < 1e-6, "{decay}");
    assert_eq!(at("equations.ticks"), "4");
    let calls = fs::read_to_string(Path::new(&log)).unwrap();
    for call in ["fmi2ModelExchange", "fmi2NewDiscreteStates()", "fmi2GetDerivatives()"] {
        assert!(calls.contains(call), "{call}");
    }
}

#[test]
fn an_isolated_fmu_is_integrated_in_its_process_to_the_same_results() {
    let (folder, path) = fmu();
    let results = ["plain", "isolated"].map(|name| {
        let out = folder.path().join(name).display().to_string();
        let mut arguments = vec!["run", &path, "--out", &out, "--set", "equations.k=2"];
        arguments.extend((name == "isolated").then_some("--isolate"));
        let (status, _, errors) = output(&arguments);
        assert_eq!(status, Some(0), "{errors}");
        fs::read(folder.path().join(name).join("results.csv")).unwrap()
    });
    assert_eq!(results[0], results[1]);
}

#[test]
fn wrong_interfaces_are_refused_with_the_reason() {
    let (folder, path) = fmu();
    let out = folder.path().display().to_string();
    let with = |more: &[&str]| {
        let all: Vec<&str> = ["run", &path, "--out", &out].iter().chain(more).copied().collect();
        let (status, _, errors) = output(&all);
        assert_eq!(status, Some(2), "{errors}");
        errors
    };
    let log = folder.path().join("calls.log").display().to_string();
    let said = with(&["--isolate", "--log-calls", &log]);
    assert!(said.contains("where --log-calls does not see its calls"), "{said}");
    let said = with(&["--interface", "equations=co-simulation"]);
    assert!(said.contains("offers model-exchange only, found co-simulation"), "{said}");
    let said = with(&["--interface", "other=model-exchange"]);
    assert!(said.contains("the system has no FMU other, expected one of equations"), "{said}");
    let said = with(&["--solver", "equations=magic"]);
    assert!(said.contains("expected automatic, explicit or stiff"), "{said}");
}

#[test]
fn the_configuration_states_interface_and_solver() {
    let (folder, path) = fmu();
    let system = folder.path().join("system.toml");
    let text = format!(
        "[fmus]\nm = {path:?}\n[interface]\nm = \"model-exchange\"\n[solver]\nm = \"stiff\"\n"
    );
    fs::write(&system, text).unwrap();
    let system = system.display().to_string();
    let (status, said, errors) = output(&["run", &system, "--print-config"]);
    assert_eq!(status, Some(0), "{errors}");
    assert!(said.contains("[interface]\nm = \"model-exchange\"\n"), "{said}");
    assert!(said.contains("[solver]\nm = \"stiff\"\n"), "{said}");
}

#[test]
fn a_resumed_run_gives_the_same_results() {
    let (folder, path) = fmu();
    let (first, second) = (folder.path().join("whole"), folder.path().join("halves"));
    let (first, second) = (first.display().to_string(), second.display().to_string());
    let saved = folder.path().join("saved").display().to_string();
    let whole = output(&["run", &path, "--out", &first]);
    let half =
        output(&["run", &path, "--out", &second, "--stop-time", "0.5", "--checkpoint", &saved]);
    let rest = output(&["run", "--resume", &saved, "--out", &second, "--stop-time", "1"]);
    for (status, _, errors) in [&whole, &half, &rest] {
        assert_eq!(*status, Some(0), "{errors}");
    }
    let rows = |folder: &str, file: &str| {
        fs::read_to_string(Path::new(folder).join(file)).unwrap_or_default()
    };
    let (whole, rest) = (rows(&first, "results.csv"), rows(&second, "results-from-0.5.csv"));
    let rest: Vec<&str> = rest.lines().skip(1).collect();
    assert!(!rest.is_empty() && whole.ends_with(&(rest.join("\n") + "\n")), "{whole}\n{rest:?}");
}

#[test]
fn check_tries_an_fmu_for_model_exchange() {
    let (_folder, path) = fmu();
    let (_, said, _) = output(&["check", &path]);
    assert!(said.contains("runs in this master: yes, 10 steps of 0.1 s"), "{said}");
}

#[test]
fn a_system_structure_selects_model_exchange() {
    let (folder, _) = fmu();
    let structure = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="one" version="1.0"
  xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription">
<ssd:System name="system"><ssd:Elements>
<ssd:Component name="m" source="equations.fmu" implementation="IMPLEMENTATION"/>
</ssd:Elements></ssd:System>
</ssd:SystemStructureDescription>
"#;
    let out = folder.path().display().to_string();
    for (implementation, warned) in [("ModelExchange", false), ("CoSimulation", true)] {
        let path = folder.path().join("system.ssd");
        fs::write(&path, structure.replace("IMPLEMENTATION", implementation)).unwrap();
        let path = path.display().to_string();
        let (status, said, errors) = output(&["run", &path, "--out", &out, "--explain"]);
        assert_eq!(status, Some(0), "{errors}");
        assert!(said.contains("m runs by model exchange"), "{said}");
        let warning =
            "asks for co-simulation, which cannot be run with this FMU: its model exchange";
        assert_eq!(errors.contains(warning), warned, "{errors}");
    }
}
