//! FMUs in C that end the process of `aso-ftc run`, or leave something in it that does, in ways that a handler
//! of the process cannot see: the supervising process says which FMU, function and time was last, and every
//! row is there.
#![cfg(target_os = "linux")]

use tests::c_fmu::CFmu;
use tests::coupled::{ALL, Run, TO_T1};

const PLACE: &str = "a at t = 0.5 s: fmi2DoStep";

#[test]
fn an_fmu_that_ends_the_process_in_a_step_is_named_and_no_row_is_lost() {
    for (deed, status, end) in [
        ("leave 0", 1, "ended the process with exit status 0"),
        ("become another program", 1, "ended the process with exit status 0"),
        ("forget SIGSEGV and crash", 1, "signal 11 (SIGSEGV)"),
        ("kill itself", 137, "signal 9 (SIGKILL)"),
    ] {
        let run = Run::pair(&CFmu::that(&format!("{deed} in fmi2DoStep")), &[]);
        run.expect(status, TO_T1);
        run.says(&[PLACE, end, "the results up to this step are in"]);
    }
}

#[test]
fn an_exception_and_the_end_of_the_thread_in_a_function_are_named_with_the_function() {
    for deed in ["throw", "end the thread"] {
        let fmu = CFmu::that(&format!("{deed} in fmi2DoStep"));
        for more in [&[][..], &["--in-process"], &["--isolate"]] {
            let run = Run::pair(&fmu, more);
            run.expect(1, TO_T1);
            run.says(&[PLACE, "was left by an exception of C++, by pthread_exit"]);
        }
    }
}

#[test]
fn an_fmu_that_ends_the_process_before_the_first_step_gives_status_2() {
    let run = Run::pair(&CFmu::that("leave 0 in fmi2EnterInitializationMode"), &[]);
    assert_eq!(run.status, Some(2), "{}", run.message);
    run.says(&["a at t = 0 s: fmi2EnterInitializationMode", "exit status 0"]);
}

#[test]
fn the_copy_of_a_process_that_an_fmu_forks_writes_no_rows() {
    let run = Run::pair(&CFmu::that("fork and go on in fmi2DoStep"), &[]);
    run.expect(0, ALL);
    assert_eq!(run.numbers("time").len(), ALL);
    assert_eq!(run.message.matches("has forked this process").count(), 1, "{}", run.message);
}

#[test]
fn what_an_fmu_leaves_for_the_end_of_the_process_loses_nothing_and_is_an_error() {
    for (deed, end) in [
        ("leave 7 when unloaded", "exit status 7"),
        ("crash when unloaded", "SIGSEGV"),
        ("hang when unloaded", "unloading the library does not end"),
        ("abort at exit", "signal 6 (SIGABRT)"),
        ("hang at exit", "kept the process from ending"),
    ] {
        let run = Run::pair(&CFmu::that(&format!("{deed} in fmi2DoStep")), &[]);
        run.expect(1, ALL);
        run.says(&[end]);
        assert!(!run.message.contains("may be lost"), "{}", run.message);
    }
}
