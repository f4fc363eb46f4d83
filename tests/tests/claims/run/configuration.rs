//! `system.toml` and the command line.

use tests::Table;

use super::*;

const SCENARIO: &str = "
[settings]
plant = { F_c = 20, x_p_0 = 0.05 }

[experiment]
stop-time = 0.8

[results]
every = 0.01

[[scenario.set]]
variable = 'plant.f_a'
at = 0.5
value = 2.0

[[scenario.signal]]
variable = 'plant.F_s'
csv = { file = 'friction.csv', column = 'F' }

[[scenario.fault]]
connection = 'controller.x_p'
noise = { deviation = 1e-5, seed = 7, from = 0.3 }
";

/// A folder with a `system.toml` and the files that it names.
fn scenario() -> Bench {
    let bench = Bench::new();
    bench.write("friction.csv", "time,F\n0,30\n0.4,30\n0.4,40\n1,40\n");
    bench.write("system.toml", &system_toml(SCENARIO));
    bench
}

/// Runs with `arguments`, then, in another folder, with the configuration that `--print-config`
/// prints for them, and compares the results.
fn round_trip(bench: &Bench, arguments: &[&str]) -> String {
    printed(&bench.run(arguments));
    let first = bench.read("out/results.csv");
    fs::remove_file(bench.path("out/results.csv")).unwrap();
    let printed_config = printed(&bench.run(&[arguments, &["--print-config"]].concat()));
    assert!(!bench.path("out/results.csv").exists(), "only printed");
    let elsewhere = Bench::new();
    elsewhere.write("copy.toml", &printed_config);
    printed(&elsewhere.run(&["copy.toml"]));
    assert_eq!(bench.read("out/results.csv"), first, "{printed_config}");
    let again = printed(&elsewhere.run(&["copy.toml", "--print-config"]));
    assert_eq!(again, printed_config);
    first
}

#[test]
fn a_printed_configuration_gives_the_same_bytes() {
    let bench = Bench::new();
    let arguments = coupled(&[
        "--stop-time=0.7",
        "--method=jacobi",
        "--extrapolation=linear",
        "--every=controller=2",
        "--set=plant.F_c=20.25",
        "--set=controller.K_x[1,2]=-1.5e3",
        "--record-every=0.0123",
        "--exclude=*.f_hat",
    ]);
    round_trip(&bench, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
}

#[test]
fn a_printed_scenario_gives_the_same_bytes_and_takes_effect() {
    let bench = scenario();
    let with = round_trip(&bench, &["system.toml", "--out", "out", "--record", "plant.*"]);
    let results = Table::read(&bench.path("out/results.csv"));
    let (time, f_a) = (results.column("time"), results.column("plant.f_a"));
    // Each row has the value of the signal at its time.
    for (time, f_a) in time.iter().zip(&f_a) {
        assert_eq!(*f_a, if *time < 0.5 - 1e-9 { 0.0 } else { 2.0 }, "at {time}");
    }
    let text = bench.read("system.toml");
    let until = text.find("[[scenario.fault]]").unwrap();
    bench.write("system.toml", &text[..until]);
    printed(&bench.run(&["system.toml", "--out", "out", "--record", "plant.*"]));
    let without = bench.read("out/results.csv");
    // Compares the rows before the fault at 0.3 s, which is row 30 after the header.
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines(&with)[..31], lines(&without)[..31]);
    assert_ne!(with, without);
}

#[test]
fn the_command_line_overrides_the_file_and_the_file_overrides_the_fmus() {
    let bench = scenario();
    let more = ["--record", "plant.F_c", "--record", "plant.x_p", "--out", "out"];
    printed(&bench.run(&[&["system.toml"][..], &more].concat()));
    let results = Table::read(&bench.path("out/results.csv"));
    assert_eq!(results.column("plant.F_c")[0], 20.0);
    assert_eq!(results.column("plant.x_p")[0], 0.05);
    assert_eq!(results.column("time").last(), Some(&0.8));
    let over = ["--set", "plant.F_c=22", "--stop-time", "0.5", "--record-every", "0.1"];
    printed(&bench.run(&[&["system.toml"][..], &more, &over].concat()));
    let results = Table::read(&bench.path("out/results.csv"));
    assert_eq!(results.column("plant.F_c"), [22.0; 6]);
    assert_eq!(results.column("plant.x_p")[0], 0.05);
    assert_eq!(results.column("time").last(), Some(&0.5));
}

#[test]
fn errors_state_line_and_column_of_the_file() {
    let bench = scenario();
    let text = bench.read("system.toml");
    for (old, new, parts) in [
        ("stop-time", "stoptime", ["system.toml:9:1", "stoptime", "`stop-time`"]),
        ("F_c = 20", "F_q = 20", ["system.toml:6:17", "plant.F_q", "no variable \"F_q\""]),
        ("F_c = 20", "F_c = 'x'", ["system.toml:6:17", "plant.F_c", "a number"]),
        ("plant.f_a", "plant.f_b", ["system.toml:15:12", "scenario.set[1]", "plant.f_b"]),
        ("'controller.x_p'", "'plant.x_p'", ["system.toml:24:", "scenario.fault[1]", "plant.x_p"]),
        ("column = 'F'", "column = 'G'", ["system.toml:19:1", "friction.csv", "no column \"G\""]),
    ] {
        bench.write("system.toml", &text.replace(old, new));
        fails(&bench.run(&["system.toml", "--out", "out"]), 2, &parts);
    }
    assert!(!bench.path("out").exists(), "nothing was begun");
}

#[test]
fn an_explanation_says_what_was_chosen_and_why() {
    let bench = Bench::new();
    let said = bench.coupled_well(&["--stop-time", "0.01", "--explain"]);
    for part in [
        "algorithm: gauss-seidel, extrapolation limited, coupling once, fixed step 0.001 s",
        "the smallest stepSize of all DefaultExperiments (plant)",
        "in the order of the direct dependencies: plant, controller",
        "time: 0 to 0.01 s",
    ] {
        assert!(said.contains(part), "{part} is not in {said}");
    }
    let said = printed(&bench.run(&["--fmu", &format!("c={}", fmu("AsoController")), "--explain"]));
    assert!(said.contains("stop time 100 s: the latest stopTime of all DefaultExperiments (c)"));
    assert!(said.contains("extrapolation limited: no input is connected"), "{said}");
}

#[test]
fn the_folder_of_the_command_line_takes_the_files_of_the_file_with_their_names() {
    let bench = Bench::new();
    let results = "[results]\nfile = 'a/b.parquet'\nplot = ['plant.x_p']\nplot-file = 'c.png'\n";
    bench.write("system.toml", &system_toml(&format!("{results}[experiment]\nstop-time = 0.01\n")));
    let list = printed(&bench.run(&["system.toml", "--out", "out"]));
    assert!(list.ends_with("out/b.parquet\nout/c.png\n"), "{list}");
    assert!(!bench.path("a").exists() && !bench.path("c.png").exists());
}

#[test]
fn an_option_replaces_an_fmu_of_the_file() {
    let bench = scenario();
    let text = bench.read("system.toml").replace("AsoController.fmu", "None.fmu");
    bench.write("system.toml", &text);
    fails(&bench.run(&["system.toml"]), 2, &["None.fmu"]);
    let controller = format!("controller={}", fmu("AsoController"));
    printed(&bench.run(&["system.toml", "--fmu", &controller, "--out", "out"]));
}
