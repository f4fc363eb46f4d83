//! The files of a run: no output is an input, standard output and pipes take results, and a file that
//! is not whole is never silent.

use std::io::Read as _;
use std::os::unix::fs::symlink;
use std::process::Stdio;

use tests::c_fmu::CFmu;

use super::*;

/// Arguments of a run of the FMU at `fmu` with five rows.
fn short(fmu: &str) -> [&str; 7] {
    ["--fmu", fmu, "--stop-time", "1", "--step", "0.25", "--record-every=step"]
}

/// Writes a well-behaved FMU and returns the argument that adds it as `a`.
fn a(bench: &Bench) -> String {
    format!("a={}", CFmu::well_behaved().write(bench.folder.path(), "a").display())
}

#[test]
fn no_output_is_an_input() {
    let bench = Bench::new();
    let _ = a(&bench);
    fs::copy(bench.path("a.fmu"), bench.path("p.csv")).unwrap();
    fs::hard_link(bench.path("p.csv"), bench.path("hard.csv")).unwrap();
    symlink(bench.path("p.csv"), bench.path("soft.csv")).unwrap();
    let fmu = format!("a={}", bench.text("p.csv"));
    let before = fs::read(bench.path("p.csv")).unwrap();
    for outputs in [
        &["--results", "p.csv"][..],
        &["--results", "./hard.csv"],
        &["--results", "soft.csv"],
        &["--checkpoint", "p.csv"],
        &["--log-calls", "p.csv"],
        &["--bus-trace", "p.csv"],
    ] {
        let output = bench.run(&[&short(&fmu)[..], outputs].concat());
        fails(&output, 2, &["would overwrite the FMU", "p.csv; choose another name"]);
        assert_eq!(fs::read(bench.path("p.csv")).unwrap(), before, "{outputs:?}");
    }
    let table = bench.write("table.csv", "time,a.u\n0,1\n1,2\n");
    let toml = format!("[fmus]\na = 'p.csv'\n[[scenario.table]]\ncsv = '{table}'\n");
    let system = bench.write("system.toml", &toml);
    for (output, role) in [(&table, "the table"), (&system, "the configuration")] {
        let more = ["--out", "out", "--log-calls", output];
        let ran = bench.run(&[&[system.as_str()][..], &more].concat());
        fails(&ran, 2, &[&format!("--log-calls {output} would overwrite {role}")]);
    }
    assert_eq!(bench.read("system.toml"), toml);
    let live = bench.write("live.toml", &toml);
    let ran = bench.run(&[live.as_str(), "--live", "--results", "r.csv"]);
    fails(&ran, 2, &["the file of --live,", "would overwrite the configuration", "live.toml"]);
    let twice = ["--results", "out/a.csv", "--log-calls", "out/../out/a.csv"];
    fs::create_dir(bench.path("out")).unwrap();
    fails(&bench.run(&[&short(&fmu)[..], &twice].concat()), 2, &["name the same file"]);
}

#[test]
fn standard_output_takes_results_and_all_else_goes_to_standard_error() {
    let bench = Bench::new();
    let fmu = format!(
        "a={}",
        CFmu::that("print in fmi2DoStep").write(bench.folder.path(), "a").display()
    );
    for name in ["-", "/dev/stdout"] {
        let output = bench.run(&[&short(&fmu)[..], &["--results", name]].concat());
        let text = printed(&output);
        assert_eq!((whole_rows(&text), text.starts_with("\"time\"")), (5, true), "{text}");
        let rest = said(&output);
        assert!(rest.contains("reached in") && rest.contains("printed by an FMU"), "{rest}");
    }
    for (more, part) in [
        (&["--report"][..], "--report reads the results again"),
        (&["--plot", "a.y"], "--plot reads the results again"),
        (&["--format", "parquet"], "/dev/stdout is no file, expected csv"),
    ] {
        let arguments = [&short(&fmu)[..], &["--results", "-"], more].concat();
        fails(&bench.run(&arguments), 2, &[part]);
    }
}

#[test]
fn a_pipe_takes_results_and_its_faults_are_one_sentence() {
    let bench = Bench::new();
    let fmu = a(&bench);
    let made = Command::new("mkfifo").arg(bench.path("pipe")).status().unwrap();
    assert!(made.success());
    let arguments = [&short(&fmu)[..], &["--results", "pipe"]].concat();
    let run = bench.command(&arguments).stdout(Stdio::null()).spawn().unwrap();
    let mut text = String::new();
    fs::File::open(bench.path("pipe")).unwrap().read_to_string(&mut text).unwrap();
    assert!(run.wait_with_output().unwrap().status.success());
    assert_eq!(whole_rows(&text), 5);
    fails(&bench.run(&arguments), 2, &["cannot write", "pipe: no process reads this pipe"]);
    // More rows than a pipe holds.
    let line = format!(
        "'{}' run --fmu '{fmu}' --stop-time 1 --step 1e-5 --record-every step --results - | head -1; \
         exit ${{PIPESTATUS[0]}}",
        command().display()
    );
    let output = Command::new("bash").args(["-c", &line]).output().unwrap();
    fails(&output, 1, &["cannot write /dev/stdout: Broken pipe"]);
    assert_eq!(said(&output).matches("Broken pipe").count(), 1, "{}", said(&output));
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_device_is_an_error_of_whatever_is_printed_or_logged() {
    let bench = Bench::new();
    let fmu = a(&bench);
    let full = || Stdio::from(fs::File::options().write(true).open("/dev/full").unwrap());
    let checked = bench.text("a.fmu");
    for arguments in [
        &[&["run"], &short(&fmu)[..], &["--out", "out"]].concat()[..],
        &["check", &checked],
        &["run", "--help"],
        &["--version"],
    ] {
        let mut command = Command::new(command());
        command.current_dir(bench.folder.path()).args(arguments).stdout(full());
        let output = command.output().unwrap();
        fails(&output, 1, &["the output is not complete: No space left on device"]);
    }
    assert_eq!(whole_rows(&bench.read("out/results.csv")), 5);
    let logged = [&short(&fmu)[..], &["--out", "out", "--log-calls", "/dev/full"]].concat();
    fails(&bench.run(&logged), 1, &["error: /dev/full: calls are missing: No space left"]);
    assert_eq!(whole_rows(&bench.read("out/results.csv")), 5);
    let streamed = [&short(&fmu)[..], &["--results", "/dev/full"]].concat();
    fails(&bench.run(&streamed), 2, &["cannot write", "/dev/full: No space left"]);
}
