//! How runs end, and how they are resumed.

use std::process::Stdio;
use std::time::{Duration, Instant};

use tests::c_fmu::CFmu;

use super::*;

/// Runs plant and controller for `stop` s, and sends `signal` when there are some rows.
fn interrupted(bench: &Bench, signal: &str, stop: &str, more: &[&str]) -> Output {
    let times = ["--stop-time", stop, "--record-every", "0.1"];
    let arguments = coupled(&[&times, more].concat());
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    let mut command = bench.command(&arguments);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let results = bench.path("out/results.csv");
    let begin = Instant::now();
    while fs::metadata(&results).map_or(0, |file| file.len()) < 50_000 {
        assert!(begin.elapsed() < Duration::from_secs(60), "there are no rows");
        std::thread::sleep(Duration::from_millis(2));
    }
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    child.wait_with_output().unwrap()
}

#[test]
fn an_interrupted_run_keeps_complete_rows_and_says_where_it_stopped() {
    for (signal, status) in [("-INT", 130), ("-TERM", 143)] {
        let bench = Bench::new();
        let output = interrupted(&bench, signal, "1e6", &[]);
        fails(&output, status, &["the run was interrupted at t = "]);
        assert!(!said(&output).contains("--resume"), "there is no checkpoint to go on from");
        let text = bench.read("out/results.csv");
        let rows = whole_rows(&text);
        let message = said(&output);
        let time = message.split("at t = ").nth(1).unwrap().split(' ').next().unwrap();
        let reached: f64 = time.parse().unwrap();
        let last: f64 = text.lines().last().unwrap().split(',').next().unwrap().parse().unwrap();
        assert!(rows > 50 && last <= reached && reached < last + 0.1 + 1e-9, "{last} {reached}");
    }
}

#[test]
fn a_resumed_run_gives_the_results_of_an_uninterrupted_one() {
    let (bench, whole) = (Bench::new(), Bench::new());
    let output = interrupted(&bench, "-INT", "400", &["--checkpoint", "state"]);
    fails(&output, 130, &["interrupted"]);
    let message = said(&output);
    let line = message.split("; to go on: ").nth(1).unwrap().lines().next().unwrap();
    assert!(line.ends_with(" run --resume state"), "{line}");
    let mut shell = Command::new("sh");
    let resumed = shell.current_dir(bench.folder.path()).args(["-c", line]).output().unwrap();
    let printed = printed(&resumed);
    let file = printed.lines().find(|line| line.contains("results-from-")).unwrap();
    let (first, second) = (bench.read("out/results.csv"), bench.read(file));
    let (head, rows) = second.split_once('\n').unwrap();
    assert_eq!(first.lines().next(), Some(head));
    whole.coupled_well(&["--stop-time", "400", "--record-every", "0.1"]);
    assert!(first + rows == whole.read("out/results.csv"), "every row, bit by bit");
}

#[test]
fn a_failed_run_keeps_its_rows_and_its_checkpoints() {
    let bench = Bench::new();
    let write = |fmu: CFmu, name: &str| {
        format!("{name}={}", fmu.write(bench.folder.path(), name).display())
    };
    let (a, b) = (write(CFmu::that("fail in fmi2DoStep"), "a"), write(CFmu::well_behaved(), "b"));
    let fmus = ["--fmu", &a, "--fmu", &b, "--connect", "a.y=b.u", "--set", "a.t1=0.875"];
    let times = ["--step", "0.0625", "--stop-time", "2", "--out", "out"];
    let saving = ["--checkpoint", "state", "--checkpoint-every", "0.25"];
    let output = bench.run(&[&fmus[..], &times, &saving].concat());
    fails(&output, 1, &["the run ended early, after t = 0.875 s: a at t = 0.875 s: fmi2DoStep"]);
    let first = bench.read("out/results.csv");
    assert_eq!(whole_rows(&first), 15, "0 to 0.875");
    // The last checkpoint is at 0.75 s: the resumed run ends in the same way.
    fails(&bench.run(&["--resume", "state"]), 1, &["the run ended early, after t = 0.875 s"]);
    let second = bench.read("out/results-from-0.75.csv");
    let (first, second): (Vec<_>, Vec<_>) = (first.lines().collect(), second.lines().collect());
    assert!(second[1].starts_with("0.8125,"), "{second:?}");
    assert_eq!((second[0], &second[1..]), (first[0], &first[14..]));
}

/// The output u of the controller is finite at the start, its derivative is not.
/// `misbehaviour_run.rs` tests that a value that is not finite ends a run.
#[test]
fn an_infinite_output_derivative_is_named_as_such() {
    let bench = Bench::new();
    let more = ["--set", "plant.linearised=true", "--set", "plant.theta_0=1e300"];
    let output = bench.coupled(&[&more[..], &["--stop-time", "0.01"]].concat());
    fails(&output, 0, &["warning: controller.u: its output derivative", "NaN at t = 0 s"]);
    assert!(!said(&output).contains("expected a finite number"), "{}", said(&output));
}

#[test]
fn an_fmu_that_cannot_save_its_state_is_named_before_the_run() {
    let bench = Bench::new();
    let fmu = CFmu::well_behaved().without_rollback().write(bench.folder.path(), "a");
    let fmu = format!("a={}", fmu.display());
    let options = ["--fmu", &fmu, "--stop-time", "1", "--step", "0.25", "--out", "out"];
    fails(
        &bench.run(&[&options[..], &["--checkpoint", "state"]].concat()),
        2,
        &["a cannot take part in a checkpoint", "canSerializeFMUstate"],
    );
    printed(&bench.run(&options));
    fails(&bench.run(&options[..2]), 0, &["stop time 1 s", "--stop-time"]);
}

#[test]
fn a_folder_in_place_of_a_checkpoint_is_refused_before_the_run() {
    let bench = Bench::new();
    fs::create_dir(bench.path("states")).unwrap();
    let output = bench.coupled(&["--stop-time", "0.1", "--checkpoint", "states"]);
    fails(&output, 2, &["cannot write the checkpoint ", "states: it is a folder"]);
    assert!(!bench.path("out").exists());
}

/// The FMU refuses steps beyond the stop time that it got.
#[test]
fn a_resumed_run_passes_the_first_stop_time_and_warns_if_the_new_one_is_later() {
    let bench = Bench::new();
    let strict = CFmu::that("refuse what is beyond the stop time");
    let fmu = format!("a={}", strict.write(bench.folder.path(), "a").display());
    let times = ["--stop-time", "1", "--step", "0.0625", "--out", "out"];
    let run = bench.run(&[&["--fmu", &fmu, "--checkpoint", "state"][..], &times].concat());
    fails(&run, 0, &[]);
    fails(&bench.run(&["--resume", "state"]), 0, &["t = 1 s, which is the end of the run"]);
    let later = bench.run(&["--resume", "state", "--stop-time", "2"]);
    let warning = "the stop time 2 s is later than 1 s, the stop time that the FMUs received";
    fails(&later, 1, &[warning, "the step ends beyond the stop time"]);
    let other = CFmu::well_behaved().write(bench.folder.path(), "b");
    let fmu = format!("b={}", other.display());
    fails(&bench.run(&[&["--fmu", &fmu, "--checkpoint", "b.state"][..], &times].concat()), 0, &[]);
    fails(&bench.run(&["--resume", "b.state", "--stop-time", "2"]), 0, &[warning]);
    let rows = bench.read("out/results-from-1.csv");
    assert!(rows.lines().last().unwrap().starts_with("2.0,"), "{rows}");
}

#[test]
fn bad_checkpoints_are_refused() {
    let bench = Bench::new();
    bench.coupled_well(&["--stop-time", "0.1", "--checkpoint", "state"]);
    let good = fs::read(bench.path("state")).unwrap();
    let mut bad = good.clone();
    *bad.last_mut().unwrap() ^= 1;
    fs::write(bench.path("bad"), &bad).unwrap();
    fails(&bench.run(&["--resume", "bad"]), 2, &["bad", "damaged", "checksum"]);
    fs::write(bench.path("bad"), &good[..30]).unwrap();
    fails(&bench.run(&["--resume", "bad"]), 2, &["bad: "]);
    fs::write(bench.path("bad"), "no checkpoint").unwrap();
    fails(&bench.run(&["--resume", "bad"]), 2, &["bad: expected a checkpoint"]);
    fails(&bench.run(&["--resume", "none"]), 2, &["none"]);
    let other = ["--resume", "state", "--extrapolation", "hold", "--coupling", "anderson"];
    let refused =
        "resume: the checkpoint was taken with extrapolation limited; --extrapolation hold is not";
    fails(&bench.run(&other), 2, &[refused]);
    let other = ["--resume", "state", "--step", "0.002"];
    let refused = "resume: the checkpoint was taken with step 0.001 s; --step 0.002 s is not";
    fails(&bench.run(&other), 2, &[refused]);
    fs::write(bench.path("old"), b"aso-ftc-state-1\nof former times").unwrap();
    let parts = ["old: found a checkpoint of format 1, expected format 6", "from its start"];
    fails(&bench.run(&["--resume", "old"]), 2, &parts);
    let setting = ["--resume", "state", "--set", "plant.F_c=20"];
    fails(&bench.run(&setting), 2, &["--set", "--resume", "cannot be used with"]);
    let swapped = format!("controller={}", fmu("FrictionPendulum"));
    let output = bench.run(&["--resume", "state", "--fmu", &swapped]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    fails(&bench.coupled(&["--checkpoint-every", "1"]), 2, &["--checkpoint FILE"]);
}
