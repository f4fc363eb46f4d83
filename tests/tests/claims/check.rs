//! `aso-ftc check` on FMUs in C that misbehave: everything that an FMU does to its process is a
//! finding.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;
use tests::c_fmu::CFmu;
use tests::run;

/// An FMU with that behaviour, which starts at 0.5 s: within the ten steps of a trial.
fn fmu(behaviour: &str) -> CFmu {
    CFmu::that(behaviour).proposing(0.0625)
}

/// Exit status and findings of `check --json`.
fn check(fmu: &CFmu, more: &[&str]) -> (Option<i32>, Vec<Value>) {
    let folder = tempfile::tempdir().unwrap();
    let path = fmu.write(folder.path(), "slave").display().to_string();
    let output = run(&[&["check", "--json", path.as_str()], more].concat());
    let report: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    (output.status.code(), report["findings"].as_array().unwrap().clone())
}

fn text<'a>(finding: &'a Value, key: &str) -> &'a str {
    finding[key].as_str().unwrap_or("")
}

/// The findings on behaviour, without those that a well-behaved FMU has too.
fn new(behaviour: &str, more: &[&str]) -> (Option<i32>, Vec<Value>) {
    let (_, usual) = check(&fmu("as it should"), &[]);
    let (status, mut findings) = check(&fmu(behaviour), more);
    let elsewhere = |finding: &Value| text(finding, "part") != "behaviour";
    assert_eq!(
        findings.iter().filter(|finding| elsewhere(finding)).count(),
        usual.iter().filter(|finding| elsewhere(finding)).count(),
        "the files are looked at all the same: {findings:#?}"
    );
    findings.retain(|finding| text(finding, "part") == "behaviour" && !usual.contains(finding));
    (status, findings)
}

#[test]
fn an_fmu_that_ends_its_process_is_one_finding_with_function_and_reason() {
    for (deed, reason) in [
        ("crash", "crashed: its process was ended by signal 11 (SIGSEGV)"),
        ("abort", "crashed: its process was ended by signal 6 (SIGABRT)"),
        ("exit 3", "ended its process with exit status 3"),
        ("exit 0", "ended its process with exit status 0"),
    ] {
        for function in [
            "fmi2Instantiate",
            "fmi2SetupExperiment",
            "fmi2EnterInitializationMode",
            "fmi2DoStep",
            "fmi2GetReal",
            "fmi2GetString",
            "fmi2Terminate",
            "fmi2FreeInstance",
        ] {
            let (status, actual) = new(&format!("{deed} in {function}"), &[]);
            assert_eq!((status, actual.len()), (Some(1), 1), "{deed} in {function}: {actual:#?}");
            assert_eq!(text(&actual[0], "severity"), "error");
            assert_eq!(text(&actual[0], "where"), function);
            assert!(text(&actual[0], "what").starts_with(reason), "{actual:#?}");
            assert!(text(&actual[0], "why").contains("ends with it"), "{actual:#?}");
        }
    }
}

#[test]
fn an_fmu_that_hangs_is_a_finding_after_the_time_limit() {
    for function in ["fmi2Instantiate", "fmi2DoStep", "fmi2FreeInstance"] {
        let begin = Instant::now();
        let (status, actual) = new(&format!("hang in {function}"), &["--time-limit", "0.5"]);
        assert!(begin.elapsed() < Duration::from_secs(60));
        assert_eq!((status, actual.len()), (Some(1), 1), "{actual:#?}");
        assert_eq!(text(&actual[0], "where"), function);
        assert!(text(&actual[0], "what").starts_with("did not return within 0.5 s"), "{actual:#?}");
    }
}

#[test]
fn a_flood_of_messages_is_a_warning_with_their_number() {
    let (status, actual) = new("flood in fmi2SetupExperiment", &[]);
    assert_eq!(status, check(&fmu("as it should"), &[]).0);
    let flood = actual.iter().find(|finding| text(finding, "what").starts_with("sends")).unwrap();
    let number = text(flood, "what").split(' ').nth(1).unwrap().parse::<u64>().unwrap();
    // A million for each instance.
    assert!(number >= 1_000_000 && number % 1_000_000 < 1000, "{flood}");
    assert_eq!(text(flood, "severity"), "warning");
}

#[test]
fn the_report_in_text_names_function_and_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = fmu("crash in fmi2DoStep").write(folder.path(), "slave");
    let output = run(&["check", &path.display().to_string()]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let expected =
        "error: fmi2DoStep: crashed: its process was ended by signal 11 (SIGSEGV) at t = ";
    assert!(said.contains(expected), "{said}");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn an_fmu_with_one_instance_per_process_gets_no_finding_for_that() {
    let one = CFmu::that("one instance only").flag("canBeInstantiatedOnlyOncePerProcess", true);
    let (_, actual) = check(&one, &[]);
    assert!(
        !actual.iter().any(|finding| text(finding, "where") == "fmi2Instantiate"),
        "{actual:#?}"
    );
}

#[test]
fn faults_outside_of_the_fmu_are_errors_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = CFmu::well_behaved().write(folder.path(), "slave").display().to_string();
    assert!(Path::new(&path).exists());
    for (more, parts) in [
        (["--time-limit", "0"], ["--time-limit is 0", "above 0"]),
        (["--time-limit", "-1"], ["--time-limit is -1", "above 0"]),
        (["--preload", "libnowhere.so.7"], ["libnowhere.so.7", "cannot"]),
    ] {
        let output = run(&[&["check", path.as_str()], &more[..]].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
}

#[test]
fn a_write_beside_an_array_or_into_a_constant_one_is_an_error() {
    for (behaviour, function, sentence) in [
        ("write past the array", "fmi2GetReal", "wrote past the end of its array of values"),
        ("write before the array", "fmi2GetReal", "wrote before the start of its array of values"),
        ("change constant values", "fmi2SetReal", "changed its constant array of values"),
        (
            "change constant references",
            "fmi2SetReal",
            "changed its constant array of value references",
        ),
        (
            "write past the state",
            "fmi2SerializeFMUstate",
            "wrote past the end of its array of bytes",
        ),
        (
            "change the constant state",
            "fmi2DeSerializeFMUstate",
            "changed its constant array of bytes",
        ),
    ] {
        let (status, actual) = new(behaviour, &[]);
        assert_eq!(status, Some(1), "{actual:#?}");
        let error = actual.iter().find(|finding| text(finding, "where") == function).unwrap();
        assert!(text(error, "what").contains(sentence), "{error:#?}");
    }
}

#[test]
fn what_an_fmu_changes_for_its_whole_process_is_a_warning() {
    for (deed, change) in [
        ("change the folder", "the working directory from "),
        ("change the locale", "the locale from "),
        ("round up", "the rounding mode from to nearest to upward"),
        ("change the environment", "the environment variable SLAVE_WAS_HERE"),
        ("join the group of the parent", "the process group from "),
    ] {
        for function in ["fmi2Instantiate", "fmi2DoStep"] {
            let (_, actual) = new(&format!("{deed} in {function}"), &[]);
            let is_change = |finding: &&Value| text(finding, "where") == "process";
            let finding = actual.iter().find(is_change).unwrap_or_else(|| panic!("{actual:#?}"));
            assert_eq!(text(finding, "severity"), "warning");
            assert!(text(finding, "what").contains(change), "{finding:#?}");
        }
    }
}

#[test]
fn a_thorough_check_runs_the_default_experiment() {
    let late = CFmu::that("crash in fmi2DoStep").experiment("stopTime=\"1\" stepSize=\"0.015625\"");
    let (_, short) = check(&late, &[]);
    let crash = |finding: &Value| text(finding, "what").contains("SIGSEGV");
    assert!(!short.iter().any(crash), "{short:#?}");
    let (status, long) = check(&late, &["--thorough"]);
    assert!(status == Some(1) && long.iter().any(crash), "{long:#?}");
}
