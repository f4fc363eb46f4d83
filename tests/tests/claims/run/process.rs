//! The process of a run: signals, other processes at the same time, files left behind.

use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use results::Table;
use tests::c_fmu::CFmu;

use super::*;

/// Time limit for something that should happen soon.
const PATIENCE: Duration = Duration::from_secs(60);

/// Writes the FMU and returns the argument that adds it as `a`.
fn a(bench: &Bench, behaviour: &str) -> String {
    format!("a={}", CFmu::that(behaviour).write(bench.folder.path(), "a").display())
}

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Starts a run of one FMU that hangs in its step from 0.5 s on, and waits until it hangs.
fn hanging(bench: &Bench, temporary: &Path, more: &[&str]) -> Child {
    let fmu = a(bench, "hang in fmi2DoStep");
    let arguments = ["--fmu", &fmu, "--stop-time", "1", "--step", "0.25", "--out", "out"];
    let mut command = bench.command(&[&arguments[..], more].concat());
    command.env("TMPDIR", temporary).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = spawned(bench, &mut command);
    let results = bench.path("out/results.csv");
    until("there is no file", || fs::metadata(&results).is_ok_and(|file| file.len() > 0));
    child
}

/// Starts a run whose FMU hangs, and waits until it hangs.
fn spawned(bench: &Bench, command: &mut Command) -> Child {
    let sign = bench.path("hangs");
    let child = command.env("HANGS", &sign).spawn().unwrap();
    until("the FMU does not hang", || sign.exists());
    child
}

fn signal(child: &Child, signal: &str) {
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
}

/// Processes that the process of a run, which the command supervises, has started.
fn workers(command: u32) -> Vec<String> {
    let run = children(command);
    assert_eq!(run.len(), 1, "the process of the run");
    children(run[0].trim_start_matches("/proc/").parse().unwrap())
}

/// Processes whose parent is this one.
fn children(parent: u32) -> Vec<String> {
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    let is_child = |stat: &String| {
        let fields: Vec<_> = stat.rsplit(") ").next().unwrap_or("").split(' ').collect();
        fields.get(1) == Some(&parent.to_string().as_str())
    };
    let stat = |path: &Path| fs::read_to_string(path.join("stat")).ok();
    processes
        .filter(|entry| stat(&entry.path()).is_some_and(|stat| is_child(&stat)))
        .map(|entry| entry.path().display().to_string())
        .collect()
}

/// Whether the tests, and so the commands that they start, ignore a signal, as SIGHUP under nohup.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    u64::from_str_radix(mask.trim(), 16).unwrap() >> (signal - 1) & 1 == 1
}

#[test]
fn one_signal_ends_a_run_whose_fmu_hangs_and_keeps_its_rows_and_names_the_call() {
    for (kind, status, isolate) in [
        ("-INT", 130, &[][..]),
        ("-TERM", 143, &[]),
        ("-HUP", 129, &[]),
        ("-USR1", 138, &[]),
        ("-USR2", 140, &[]),
        ("-ALRM", 142, &[]),
        ("-XCPU", 152, &[]),
        ("-INT", 130, &["--isolate"]),
    ] {
        if is_ignored(status - 128) {
            continue;
        }
        let (bench, temporary) = (Bench::new(), tempfile::tempdir().unwrap());
        let child = hanging(&bench, temporary.path(), isolate);
        let workers = workers(child.id());
        assert_eq!(workers.len(), isolate.len());
        let begin = Instant::now();
        signal(&child, kind);
        let output = child.wait_with_output().unwrap();
        // One second on an idle machine; this machine may be busy.
        assert!(begin.elapsed() < PATIENCE, "{:?}", begin.elapsed());
        let parts = [
            "interrupted",
            "a at t = 0.5 s: fmi2DoStep has not returned within 0.8 s",
            "out/results.csv",
        ];
        fails(&output, status, &parts);
        assert_eq!(whole_rows(&bench.read("out/results.csv")), 3, "0, 0.25 and 0.5 s");
        let left: Vec<_> = fs::read_dir(temporary.path()).unwrap().flatten().collect();
        assert!(left.is_empty(), "{left:?}");
        for worker in &workers {
            until("the worker is left", || !Path::new(worker).exists());
        }
    }
}

#[test]
fn a_second_signal_ends_a_run_at_once() {
    let (bench, temporary) = (Bench::new(), tempfile::tempdir().unwrap());
    let mut child = hanging(&bench, temporary.path(), &[]);
    signal(&child, "-INT");
    std::thread::sleep(Duration::from_millis(300));
    signal(&child, "-INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_signal_ends_a_run_whose_fmu_hangs_before_the_first_step() {
    let bench = Bench::new();
    let fmu = a(&bench, "hang in fmi2EnterInitializationMode");
    let arguments = ["--fmu", &fmu, "--stop-time", "1", "--step", "0.25", "--out", "out"];
    let child = spawned(&bench, bench.command(&arguments).stderr(Stdio::piped()));
    signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    fails(&output, 130, &["a at t = 0 s: fmi2EnterInitializationMode has not returned"]);
}

#[test]
fn a_second_run_into_the_same_file_is_refused_and_the_first_continues() {
    let (bench, temporary) = (Bench::new(), tempfile::tempdir().unwrap());
    let mut first = hanging(&bench, temporary.path(), &[]);
    let before = bench.read("out/results.csv");
    let other = format!("b={}", CFmu::well_behaved().write(bench.folder.path(), "b").display());
    let second = ["--fmu", &other, "--stop-time", "1", "--step", "0.25", "--out", "out"];
    fails(&bench.run(&second), 2, &["out/results.csv: another run writes", "--out"]);
    let elsewhere = [&second[..], &["--results", "out/other.csv"]].concat();
    printed(&bench.run(&elsewhere));
    assert!(bench.read("out/results.csv").starts_with(&before));
    first.kill().unwrap();
    first.wait().unwrap();
    // A killed run leaves no lock.
    printed(&bench.run(&second));
    assert_eq!(whole_rows(&bench.read("out/results.csv")), 5);
}

#[test]
fn temporary_folders_of_a_killed_run_are_removed_by_the_next_run() {
    let (bench, temporary) = (Bench::new(), tempfile::tempdir().unwrap());
    let left = || fs::read_dir(temporary.path()).unwrap().count();
    let mut killed = hanging(&bench, temporary.path(), &[]);
    assert_eq!(left(), 1);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert_eq!(left(), 1, "nobody can remove it at once");
    let fmu = a(&bench, "crash in fmi2DoStep");
    let mut next = bench.command(&["--fmu", &fmu, "--stop-time", "1", "--step", "0.25"]);
    let output = next.env("TMPDIR", temporary.path()).output().unwrap();
    fails(&output, 1, &["fmi2DoStep crashed"]);
    assert_eq!(left(), 0, "neither that of the killed run nor that of this one, which crashed");
}

#[test]
fn closed_standard_streams_do_not_end_a_run() {
    let bench = Bench::new();
    let fmu = a(&bench, "another environment in fmi2DoStep");
    for close in [">&-", "2>&-", ">&- 2>&-", "| true", "2>&1 | true"] {
        let _ = fs::remove_dir_all(bench.path("out"));
        let command = tests::command().display();
        let line = format!(
            "{{ sleep 0.1; '{command}' run --fmu '{fmu}' --stop-time 1 --step 0.25 --out out; \
             echo $? > status; }} {close}"
        );
        let mut shell = Command::new("sh");
        shell.current_dir(bench.folder.path()).args(["-c", &line]).stderr(Stdio::piped());
        let output = shell.output().unwrap();
        assert_eq!(bench.read("status").trim(), "0", "{close}: {}", said(&output));
        assert!(!said(&output).contains("panicked"), "{}", said(&output));
        assert_eq!(whole_rows(&bench.read("out/results.csv")), 5, "{close}");
    }
}

#[test]
fn on_a_full_disk_the_results_are_a_readable_prefix() {
    let fmu = CFmu::well_behaved();
    // On a busy machine, a block of 65536 rows is written in parts.
    for (format, least) in [("csv", 1000), ("parquet", 32_768)] {
        let bench = Bench::new();
        let path = fmu.write(bench.folder.path(), "a");
        let (command, fmu) = (tests::command().display(), path.display());
        // The limit is in units of 512 or 1024 bytes: 2 or 4 MiB.
        let line = format!(
            "ulimit -f 4096; exec '{command}' run --fmu 'a={fmu}' --stop-time 4 --step 0.00001 \
             --record-every step --record a.y --out out --format {format}"
        );
        let mut shell = Command::new("sh");
        let output = shell.current_dir(bench.folder.path()).args(["-c", &line]).output().unwrap();
        fails(&output, 1, &["cannot write", &format!("out/results.{format}")]);
        let table = Table::open(&bench.path(&format!("out/results.{format}"))).unwrap();
        let mut rows = 0_u32;
        let visited = table.visit(&[1], &mut |time: f64, values: &[f64]| {
            let expected = f64::from(rows) * 1e-5;
            assert!((time - expected).abs() < 1e-9 && (values[0] - time).abs() < 1e-6, "{time}");
            rows += 1;
        });
        visited.unwrap();
        assert!(rows >= least && rows < 400_000, "{rows} rows");
    }
}
