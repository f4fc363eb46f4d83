//! How runs end, and go on.

use std::process::Stdio;
use std::time::{Duration, Instant};

use tests::c_fmu::CFmu;

use super::*;

/// A plant whose sensor sticks: the pendulum falls, and soon whirls beyond what the plant computes.
const LOST: &str = "
[experiment]
stop-time = 2

[[scenario.set]]
variable = 'plant.f_a'
at = 0.5
value = 2.0

[[scenario.fault]]
connection = 'controller.x_p'
stuck = { from = 1.0 }
";

/// Runs plant and controller for `stop` s, sends `signal` when there are some rows.
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
fn an_interrupted_run_leaves_whole_rows_and_says_where_it_stopped() {
    for signal in ["-INT", "-TERM"] {
        let bench = Bench::new();
        let output = interrupted(&bench, signal, "1e6", &[]);
        fails(&output, 130, &["the run was interrupted at t = "]);
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
fn an_interrupted_run_goes_on_as_if_it_had_not_been() {
    let (bench, whole) = (Bench::new(), Bench::new());
    let output = interrupted(&bench, "-INT", "400", &["--checkpoint", "state"]);
    fails(&output, 130, &["interrupted"]);
    let printed = printed(&bench.run(&["--resume", "state"]));
    let file = printed.lines().find(|line| line.contains("results-from-")).unwrap();
    let (first, second) = (bench.read("out/results.csv"), fs::read_to_string(file).unwrap());
    let (head, rows) = second.split_once('\n').unwrap();
    assert_eq!(first.lines().next(), Some(head));
    whole.coupled_well(&["--stop-time", "400", "--record-every", "0.1"]);
    assert!(first + rows == whole.read("out/results.csv"), "every row, bit by bit");
}

#[test]
fn a_lost_run_keeps_its_rows_and_its_checkpoints() {
    let bench = Bench::new();
    bench.write("system.toml", &system_toml(LOST));
    let saving = ["--checkpoint", "state", "--checkpoint-every", "0.25"];
    let output = bench.run(&[&["system.toml", "--out", "out"][..], &saving].concat());
    fails(&output, 1, &["the run ended early, after t = 1.0", "plant at t = 1.0", "fmi2DoStep"]);
    let first = bench.read("out/results.csv");
    let rows = whole_rows(&first);
    assert!((1001..1200).contains(&rows), "{rows} rows at steps of 1 ms");
    // The last checkpoint is that at 1 s: the same end again.
    fails(&bench.run(&["--resume", "state"]), 1, &["the run ended early"]);
    let second = bench.read("out/results-from-1.csv");
    let tail: Vec<_> = first.lines().skip(1002).collect();
    assert_eq!(second.lines().skip(1).collect::<Vec<_>>(), tail);
    assert!(tail[0].starts_with("1.001,"), "{}", tail[0]);
}

#[test]
fn an_fmu_that_cannot_save_its_state_is_told_before_the_run() {
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
    fails(&bench.run(&options[..2]), 2, &["no stop time", "--stop-time"]);
}

#[test]
fn a_second_signal_ends_a_run_whose_fmu_hangs() {
    let bench = Bench::new();
    let fmu = CFmu::that("hang in fmi2DoStep").write(bench.folder.path(), "a");
    let fmu = format!("a={}", fmu.display());
    let more = ["--fmu", &fmu, "--stop-time", "1", "--step", "0.25", "--out", "out"];
    let mut child = bench.command(&more).stdout(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    while !fs::read_to_string(bench.path("out/results.csv")).is_ok_and(|text| !text.is_empty()) {
        assert!(begin.elapsed() < Duration::from_secs(60), "there is no file");
        std::thread::sleep(Duration::from_millis(2));
    }
    // The signals may come before the process hears them or before it hangs; at the end there have
    // been two.
    let status = loop {
        let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        std::thread::sleep(Duration::from_millis(50));
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "it does not end");
    };
    assert_eq!(status.code(), Some(130));
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
    let other = ["--resume", "state", "--course", "hold", "--coupling", "anderson"];
    fails(&bench.run(&other), 2, &["checkpoint", "another algorithm"]);
    let swapped = format!("controller={}", fmu("FrictionPendulum"));
    let output = bench.run(&["--resume", "state", "--fmu", &swapped]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    fails(&bench.coupled(&["--checkpoint-every", "1"]), 2, &["--checkpoint FILE"]);
}
