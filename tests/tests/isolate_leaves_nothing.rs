//! Resources that isolated FMUs leave behind. Each test runs in a process of its own, started from
//! this program.
#![cfg(target_os = "linux")]
#![forbid(unsafe_code)]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use fmu_import::isolate::{self, Isolated, Options};
use master::{Failure, Slave as _};
use tests::{Trouble, command, troubles};

/// Environment variable that tells a started process its part.
const PART: &str = "ISOLATE_TEST_PART";

fn open(time_limit: Option<Duration>) -> Isolated {
    let executable = Some(command().to_owned());
    isolate::open(troubles(), "one", &Options { executable, time_limit, ..Options::default() })
        .unwrap()
}

fn step(slave: &mut Isolated, trouble: Trouble) -> Result<master::StepResult, master::CallError> {
    slave.set_integer(&[0], &[trouble as i64])?;
    slave.do_step(0.0, 0.1, true)
}

/// Starts this program again, with only the test `name`, in the part `part`.
fn again(name: &str, part: &str) -> Command {
    let mut again = Command::new(std::env::current_exe().unwrap());
    again.args(["--exact", name, "--nocapture", "--test-threads", "1"]).env(PART, part);
    again
}

fn part() -> Option<String> {
    std::env::var(PART).ok()
}

/// Open files, mappings of shared memory, child processes.
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
    for _ in 0..3 {
        let mut well = open(None);
        step(&mut well, Trouble::None).unwrap();
        let second = open(None);
        assert_eq!(belongings().1, 2);
        assert_eq!(belongings().2.len(), before.2.len() + 2);
        drop((well, second));
        for trouble in [Trouble::CrashInStep, Trouble::Leave, Trouble::Hang] {
            step(&mut open(limit), trouble).unwrap_err();
        }
        // The step itself is shorter than this limit, on a busy machine, too.
        step(&mut open(Some(Duration::from_secs(1))), Trouble::HangInFree).unwrap();
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
    // Wait until the step hangs.
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

/// The process group of a process, if it runs.
fn group(process: u32) -> Vec<String> {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let stats =
        processes.filter_map(|entry| std::fs::read_to_string(entry.path().join("stat")).ok());
    let in_group = |stat: &String| {
        // After the name in parentheses: state, parent, group.
        let fields: Vec<_> = stat.rsplit(") ").next().unwrap_or("").split(' ').collect();
        fields.get(2) == Some(&process.to_string().as_str()) && fields.first() != Some(&"Z")
    };
    stats.filter(in_group).collect()
}

#[test]
fn processes_started_by_an_fmu_end_with_it_even_if_it_ends_by_itself() {
    let mut slave = open(None);
    let process = slave.process_id();
    let error = step(&mut slave, Trouble::LeaveWithChild).unwrap_err();
    assert_eq!(error.failure, Failure::Exited(3));
    let begin = Instant::now();
    while !group(process).is_empty() {
        assert!(begin.elapsed() < Duration::from_secs(20), "{:?} is left", group(process));
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_crash_from_memory_beyond_the_limit_is_reported_as_such() {
    let executable = Some(command().to_owned());
    let limit = 1 << 30;
    let options = Options { executable, memory_limit: Some(limit), ..Options::default() };
    let mut slave = isolate::open(troubles(), "one", &options).unwrap();
    step(&mut slave, Trouble::None).unwrap();
    let error = step(&mut slave, Trouble::TakeMemory).unwrap_err();
    assert_eq!(error.failure, Failure::OutOfMemory(limit));
    assert!(error.to_string().contains("limit of 1073741824 bytes"), "{error}");
    // A crash for another reason is not attributed to the limit.
    let mut slave = isolate::open(troubles(), "one", &options).unwrap();
    let error = step(&mut slave, Trouble::CrashInStep).unwrap_err();
    assert!(matches!(error.failure, Failure::Killed(11, _)), "{error}");
    let tight = Options { memory_limit: Some(4 << 20), ..options };
    let error = isolate::open(troubles(), "one", &tight).err().unwrap().to_string();
    assert!(error.contains("4194304 bytes"), "{error}");
}

#[test]
fn a_program_that_does_not_check_for_its_worker_argument_starts_itself_once_and_says_what_is_missing()
 {
    let name = "a_program_that_does_not_check_for_its_worker_argument_starts_itself_once_and_says_what_is_missing";
    let folder = tempfile::tempdir().unwrap();
    let (log, script) = (folder.path().join("starts"), folder.path().join("program"));
    if let Some(part) = part() {
        // Each start of the program writes a line.
        let executable = Some(Path::new(&part).to_owned());
        let options = Options { executable, ..Options::default() };
        let error = isolate::open(troubles(), "one", &options).err().unwrap();
        println!("said: {error}");
        return;
    }
    let this = std::env::current_exe().unwrap();
    let text = format!(
        "#!/bin/sh\necho start >> '{}'\nexec '{}' --exact {name} --nocapture >&2\n",
        log.display(),
        this.display()
    );
    std::fs::write(&script, text).unwrap();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&script, mode).unwrap();
    let done = again(name, &script.display().to_string()).output().unwrap();
    let said = String::from_utf8_lossy(&done.stdout) + String::from_utf8_lossy(&done.stderr);
    assert!(said.contains("did not become a worker"), "{said}");
    assert!(said.contains("fmu_import::isolate::worker()"), "{said}");
    assert_eq!(std::fs::read_to_string(&log).unwrap(), "start\n", "{said}");
}

#[test]
fn of_endless_output_of_an_fmu_a_part_is_passed_on() {
    let name = "of_endless_output_of_an_fmu_a_part_is_passed_on";
    if part().is_some() {
        step(&mut open(None), Trouble::PrintFlood).unwrap();
        return;
    }
    let done = again(name, "printer").output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    let lines = said.lines().filter(|line| line.starts_with("again and again")).count();
    // 1 MiB of 40 MB.
    assert!((20_000..32_000).contains(&lines), "{lines} lines");
}

#[test]
fn output_of_an_fmu_does_not_reach_standard_output() {
    let name = "output_of_an_fmu_does_not_reach_standard_output";
    if part().is_some() {
        step(&mut open(None), Trouble::Print).unwrap();
        return;
    }
    let done = again(name, "printer").output().unwrap();
    assert!(done.status.success());
    assert!(!String::from_utf8_lossy(&done.stdout).contains("noise"));
    assert!(String::from_utf8_lossy(&done.stderr).contains("noise on standard output"));
}
