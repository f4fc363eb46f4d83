//! Libraries of FMUs that misbehave while they are loaded or unloaded, that lack functions, or that have
//! another name; FMUs that return impossible sizes, or write where they must not.
#![cfg(target_os = "linux")]

use std::time::{Duration, Instant};

use tests::c_fmu::CFmu;
use tests::coupled::{ALL, Run, TO_T1};

/// Without isolation, and with it.
const WAYS: [&[&str]; 2] = [&[], &["--isolate"]];

#[test]
fn a_function_that_no_library_defines_is_named_before_the_run_which_goes_on_until_its_call() {
    let fmu = CFmu::that("call a missing function in fmi2DoStep").calling("not_there");
    for way in WAYS {
        let run = Run::pair(&fmu, way);
        run.expect(1, TO_T1);
        run.says(&["the library lacks the function not_there"]);
        run.says(&["a at t = 0.5 s: fmi2DoStep crashed", "SIGABRT"]);
        Run::pair(&CFmu::well_behaved().calling("not_there"), way).expect(0, ALL);
    }
}

#[test]
fn check_refuses_a_library_that_lacks_a_function() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = CFmu::well_behaved().calling("not_there");
    let path = fmu.write(folder.path(), "slave").display().to_string();
    let output = tests::run(&["check", &path]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("runs in this master: no"), "{text}");
    assert!(text.contains("undefined symbol: not_there"), "{text}");
    assert!(text.contains("does not run in FMPy"), "{text}");
}

#[test]
fn a_crash_or_exit_of_a_library_outside_of_its_functions_is_reported_by_the_name_of_the_fmu() {
    // A first write takes the time of the compiler, which is not that of the run.
    let folder = tempfile::tempdir().unwrap();
    let _ = CFmu::well_behaved().write(folder.path(), "b");
    for (deed, reason) in [("crash", "signal 11"), ("exit 3", "exit")] {
        for (moment, what, rows) in [
            ("ON_LOAD", "a.fmu: loading the library", 0),
            ("ON_UNLOAD", "a.fmu: unloading the library", ALL),
            ("AT_EXIT", "a.fmu: unloading the library", ALL),
        ] {
            let fmu = CFmu::well_behaved().doing(deed, moment);
            let _ = fmu.write(folder.path(), "a");
            let start = Instant::now();
            let run = Run::pair(&fmu, &[]);
            let status = if rows == 0 { 2 } else { 1 };
            assert_eq!(run.status, Some(status), "{deed} {moment}: {}", run.message);
            run.says(&[what, reason]);
            assert!(!run.message.contains("may be lost"), "{}", run.message);
            assert!(!run.message.contains("fmi2-unpacked"), "{}", run.message);
            assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
            if rows > 0 {
                run.expect(1, rows);
            }
        }
    }
}

#[test]
fn the_only_library_of_the_platform_is_used_whatever_its_name() {
    let fmu = CFmu::well_behaved().in_library("renamed");
    for way in WAYS {
        let run = Run::pair(&fmu, way);
        run.expect(0, ALL);
        run.says(&["renamed.so is used", "slave.so"]);
    }
}

#[test]
fn an_impossible_size_of_a_state_is_an_error_of_the_function() {
    let folder = tempfile::tempdir().unwrap();
    for (behaviour, size) in [("endless state", u64::MAX), ("huge state", 3 << 30)] {
        let checkpoint = folder.path().join("checkpoint").display().to_string();
        for way in WAYS {
            let more = [way, &["--checkpoint", &checkpoint]].concat();
            let run = Run::pair(&CFmu::that(behaviour), &more);
            assert_eq!(run.status, Some(1), "{way:?}: {}", run.message);
            run.says(&["a", "fmi2SerializedFMUstateSize", &size.to_string()]);
            assert!(!run.message.contains("panicked"), "{}", run.message);
        }
    }
}

/// Behaviours that write where an FMU must not, with function and sentence.
const WRITES: [(&str, &str, &str); 5] = [
    ("write past the array", "fmi2GetReal", "wrote past the end of its array of values"),
    ("write before the array", "fmi2GetReal", "wrote before the start of its array of values"),
    ("change constant values", "fmi2SetReal", "changed its constant array of values"),
    ("change constant references", "fmi2SetReal", "changed its constant array of value references"),
    ("write past the state", "fmi2SerializeFMUstate", "wrote past the end of its array of bytes"),
];

#[test]
fn with_a_log_of_calls_a_write_beside_an_array_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("calls.txt").display().to_string();
    for (behaviour, function, sentence) in WRITES {
        for way in WAYS {
            let checkpoint = folder.path().join("checkpoint").display().to_string();
            let more = [way, &["--log-calls", &log, "--set", "a.u=1", "--checkpoint", &checkpoint]]
                .concat();
            let run = Run::pair(&CFmu::that(behaviour), &more);
            assert!(matches!(run.status, Some(1 | 2)), "{behaviour}: {}", run.message);
            run.says(&["a", function, sentence]);
        }
    }
    let more = ["--log-calls", log.as_str(), "--set", "a.u=1"];
    Run::pair(&CFmu::well_behaved(), &more).expect(0, ALL);
}
