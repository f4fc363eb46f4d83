//! What isolated FMUs leave behind. Each test runs in a process of its own: this program again.
#![cfg(target_os = "linux")]
#![forbid(unsafe_code)]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use master::Slave as _;
use master::isolate::{self, Isolated, Options};
use tests::{Trouble, command, troubles};

/// Set in the processes that the tests start, to the part they have.
const PART: &str = "ISOLATE_TEST_PART";

fn open(time_limit: Option<Duration>) -> Isolated {
    let executable = Some(command().to_owned());
    isolate::open(troubles(), "one", &Options { executable, time_limit, ..Options::default() })
        .unwrap()
}

fn step(slave: &mut Isolated, trouble: Trouble) -> Result<master::Stepped, master::CallError> {
    slave.set_integer(&[0], &[trouble as i32])?;
    slave.do_step(0.0, 0.1, true)
}

/// This program again, with only the test `name`, in the part `part`.
fn again(name: &str, part: &str) -> Command {
    let mut again = Command::new(std::env::current_exe().unwrap());
    again.args(["--exact", name, "--nocapture", "--test-threads", "1"]).env(PART, part);
    again
}

fn part() -> Option<String> {
    std::env::var(PART).ok()
}

/// Open files, mappings of shared memory, children.
fn belongings() -> (usize, usize, Vec<String>) {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let mut children = Vec::new();
    for task in std::fs::read_dir("/proc/self/task").unwrap().flatten() {
        let text = std::fs::read_to_string(task.path().join("children")).unwrap_or_default();
        children.extend(text.split_whitespace().map(str::to_owned));
    }
    let files = std::fs::read_dir("/proc/self/fd").unwrap().count();
    (files, maps.matches("memfd:fmu").count(), children)
}

#[test]
fn after_drop_no_process_no_shared_memory_and_no_file_is_left() {
    let name = "after_drop_no_process_no_shared_memory_and_no_file_is_left";
    if part().is_none() {
        let done: Output = again(name, "owner").output().unwrap();
        let text = String::from_utf8_lossy(&done.stdout) + String::from_utf8_lossy(&done.stderr);
        assert!(done.status.success() && text.contains("1 passed"), "{text}");
        return;
    }
    drop(open(None));
    let before = belongings();
    assert_eq!(before.1, 0);
    let limit = Some(Duration::from_millis(100));
    for _ in 0..5 {
        let mut well = open(None);
        step(&mut well, Trouble::None).unwrap();
        let second = open(None);
        assert_eq!(belongings().1, 2);
        assert_eq!(belongings().2.len(), before.2.len() + 2);
        drop((well, second));
        for trouble in [Trouble::CrashInStep, Trouble::Leave, Trouble::Hang] {
            step(&mut open(limit), trouble).unwrap_err();
        }
        step(&mut open(limit), Trouble::HangInFree).unwrap();
    }
    assert_eq!(belongings(), before);
}

#[test]
fn a_master_that_is_killed_leaves_no_worker_even_in_a_step_that_hangs() {
    let name = "a_master_that_is_killed_leaves_no_worker_even_in_a_step_that_hangs";
    match part().as_deref() {
        None => {
            for part in ["idle", "hanging"] {
                kill_master(name, part);
            }
        }
        Some(part) => {
            let mut slave = open(None);
            println!("worker {}", slave.process_id());
            if part == "hanging" {
                step(&mut slave, Trouble::Hang).unwrap();
            }
            std::thread::sleep(Duration::from_secs(1000));
        }
    }
}

/// Starts a master, kills it, and waits until its worker is gone.
fn kill_master(name: &str, part: &str) {
    let mut master = again(name, part).stdout(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(master.stdout.take().unwrap()).lines();
    let mut lines = lines.map_while(Result::ok);
    let worker = lines.find_map(|line| line.split("worker ").nth(1).map(str::to_owned)).unwrap();
    let worker = Path::new("/proc").join(worker);
    assert!(worker.exists());
    // Into the hanging step.
    std::thread::sleep(Duration::from_millis(200));
    assert!(worker.exists());
    master.kill().unwrap();
    master.wait().unwrap();
    let begin = Instant::now();
    while worker.exists() {
        assert!(begin.elapsed() < Duration::from_secs(20), "the worker of the {part} master lives");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn what_the_fmu_prints_does_not_reach_standard_output() {
    let name = "what_the_fmu_prints_does_not_reach_standard_output";
    if part().is_some() {
        step(&mut open(None), Trouble::Print).unwrap();
        return;
    }
    let done = again(name, "printer").output().unwrap();
    assert!(done.status.success());
    assert!(!String::from_utf8_lossy(&done.stdout).contains("noise"));
    assert!(String::from_utf8_lossy(&done.stderr).contains("noise on standard output"));
}
