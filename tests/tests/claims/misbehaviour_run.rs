//! FMUs in C under `aso-ftc run`, in its own process. Unusual ones run. If one fails, the message,
//! the exit status and the results up to that step are right, even if the FMU ends the process.
//! `misbehaviour_isolated.rs` tests the same with isolation.

mod promises;
mod settings;

use tests::c_fmu::CFmu;
use tests::coupled::{ALL, Run, STEP, TO_T1, UNUSUAL};

#[test]
fn unusual_fmus_run() {
    for behaviour in UNUSUAL {
        Run::pair(&CFmu::that(behaviour), &[]).expect(0, ALL);
    }
    Run::pair(&CFmu::that("no way back").without_rollback(), &[]).expect(0, ALL);
    Run::pair(&CFmu::well_behaved().needing("Bench 4"), &[]).expect(0, ALL);
}

#[test]
fn very_many_messages_do_not_affect_the_results() {
    let late = ["--set", "a.t1=0.9375"];
    Run::pair(&CFmu::that("flood in fmi2DoStep"), &late).expect(0, ALL);
}

#[test]
fn another_locale_or_current_folder_of_the_process_changes_no_results() {
    for behaviour in ["change the locale in fmi2DoStep", "change the folder in fmi2DoStep"] {
        Run::pair(&CFmu::that(behaviour), &[]).expect(0, ALL);
    }
    for behaviour in
        ["change the locale in fmi2Instantiate", "change the folder in fmi2Instantiate"]
    {
        Run::pair(&CFmu::that(behaviour), &[]).expect(0, ALL);
    }
}

#[test]
fn fmus_without_optional_functions_run_if_these_are_not_needed() {
    for missing in [
        &["fmi2Terminate"][..],
        &["fmi2SetDebugLogging", "fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Reset"],
        &["fmi2GetString", "fmi2GetBoolean", "fmi2GetInteger", "fmi2SetBoolean"],
        &["fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives"],
        &["fmi2GetDirectionalDerivative", "fmi2CancelStep", "fmi2GetStatus"],
        &["fmi2GetRealStatus", "fmi2GetBooleanStatus", "fmi2GetStringStatus"],
    ] {
        Run::pair(&CFmu::well_behaved().without(missing), &[]).expect(0, ALL);
    }
    let stateless = ["fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate"];
    let stateless = CFmu::well_behaved().without_rollback().without(&stateless);
    Run::pair(&stateless, &[]).expect(0, ALL);
}

#[test]
fn a_missing_function_that_the_run_needs_is_reported_with_the_fmu() {
    let run = Run::pair(&CFmu::well_behaved().without(&["fmi2DoStep"]), &[]);
    assert_eq!(run.status, Some(2), "{}", run.message);
    run.says(&["fmi2DoStep", "missing"]);
    let run = Run::pair(&CFmu::well_behaved().without(&["fmi2GetReal"]), &[]);
    assert!(matches!(run.status, Some(1 | 2)), "{}", run.message);
    run.says(&["fmi2GetReal", "missing", "a"]);
}

#[test]
fn values_of_all_types_pass_through_connections() {
    let text = "Grüße, \"Ångström\"\n;";
    let set = format!("a.s_in={text}");
    let kinds = ["i", "b", "s", "e"];
    let links = kinds.map(|kind| format!("a.{kind}_out=b.{kind}_in"));
    let mut more: Vec<&str> = links.iter().flat_map(|link| ["--connect", link]).collect();
    more.extend(["--set", "a.i_in=-2147483648", "--set", "a.b_in=true", "--set", &set]);
    more.extend(["--set", "a.e_in=2"]);
    let fmu = CFmu::well_behaved();
    let run = Run::of(&[("a", &fmu), ("b", &fmu)], &more);
    assert_eq!(run.status, Some(0), "{}", run.message);
    for (name, before, after) in [
        ("i_out", &["0"][..], &["-2147483648"][..]),
        ("b_out", &["0", "false", "False"], &["1", "true", "True"]),
        ("s_out", &[""], &[text]),
        // An enumeration item may be recorded by its number or by its name.
        ("e_out", &["1", "off"], &["2", "on"]),
    ] {
        for (slave, delay) in [("a", 1), ("b", 2)] {
            let column = run.column(&format!("{slave}.{name}"));
            assert_eq!(column.len(), ALL, "{slave}.{name}");
            for (row, value) in column.iter().enumerate() {
                let expected = if row < delay { before } else { after };
                assert!(expected.contains(&value.as_str()), "{slave}.{name}, row {row}: {value}");
            }
        }
    }
}

#[test]
fn an_error_in_a_step_ends_the_run_with_fmu_call_and_time_and_keeps_the_results() {
    for (deed, status) in
        [("fail", "fmi2Error"), ("fail fatally", "fmi2Fatal"), ("return 17", "17")]
    {
        let run = Run::pair(&CFmu::that(&format!("{deed} in fmi2DoStep")), &[]);
        run.expect(1, TO_T1);
        run.says(&["a", "t = 0.5 s", "fmi2DoStep", status]);
    }
    let run = Run::pair(&CFmu::that("fail in fmi2DoStep"), &[]);
    run.says(&["as it was told"]);
}

#[test]
fn an_error_without_a_message_names_the_option_that_switches_messages_on() {
    for function in ["fmi2EnterInitializationMode", "fmi2DoStep"] {
        let fmu = CFmu::that(&format!("fail silently in {function}"));
        Run::pair(&fmu, &[]).says(&[&format!("{function} returned fmi2Error; with -v")]);
        let run = Run::pair(&fmu, &["-v"]);
        run.says(&["returned fmi2Error"]);
        assert!(!run.message.contains("with -v"), "{}", run.message);
    }
}

#[test]
fn an_error_when_outputs_are_read_ends_the_run_and_keeps_the_previous_rows() {
    let run = Run::pair(&CFmu::that("fail in fmi2GetReal"), &[]);
    run.expect(1, TO_T1 - 1);
    run.says(&["a", "fmi2GetReal", "fmi2Error", "as it was told"]);
}

#[test]
fn an_error_before_the_first_step_is_reported_with_fmu_and_call() {
    for function in ["fmi2Instantiate", "fmi2SetupExperiment", "fmi2EnterInitializationMode"] {
        let run = Run::pair(&CFmu::that(&format!("fail in {function}")), &[]);
        assert!(matches!(run.status, Some(1 | 2)), "{}", run.message);
        run.says(&[function, "a", "as it was told"]);
    }
}

#[test]
fn an_error_at_the_end_is_reported_and_no_results_are_lost() {
    let run = Run::pair(&CFmu::that("fail in fmi2Terminate"), &[]);
    run.expect(1, ALL);
    run.says(&["fmi2Terminate", "fmi2Error"]);
}

#[test]
fn a_nan_ends_the_run_with_its_origin_and_time() {
    for (behaviour, value) in [("not a number", "NaN"), ("infinity", "-inf")] {
        let run = Run::pair(&CFmu::that(behaviour), &[]);
        run.expect(1, TO_T1 - 1);
        run.says(&["a.y", value, "t = 0.5 s"]);
    }
}

#[test]
fn nan_and_infinity_are_passed_on_if_they_are_allowed() {
    let run = Run::pair(&CFmu::that("not a number"), &["--allow-nan"]);
    run.expect(0, TO_T1 - 1);
    let (a, b) = (run.numbers("a.y"), run.numbers("b.y"));
    assert_eq!((a.len(), b.len()), (ALL, ALL));
    assert!(a[TO_T1 - 1..].iter().all(|value| value.is_nan()), "{a:?}");
    assert!(b[TO_T1..].iter().all(|value| value.is_nan()) && b[TO_T1 - 1].is_finite(), "{b:?}");
}

/// In the middle of the step that starts at 0.5 s.
const MIDDLE: [&str; 2] = ["--set", "a.t1=0.53125"];

#[test]
fn a_step_that_is_discarded_half_way_is_made_in_parts_with_rollback() {
    for behaviour in ["discard at t1", "pend and discard at t1"] {
        let run = Run::pair(&CFmu::that(behaviour), &[MIDDLE[0], MIDDLE[1], "--rollback"]);
        run.expect(0, TO_T1);
        let (time, y) = (run.numbers("time"), run.numbers("a.y"));
        assert_eq!(time, y);
        assert_eq!(time.last(), Some(&1.0));
        assert!(time.windows(2).all(|pair| pair[0] < pair[1]), "{time:?}");
        assert!((0_u8..17).all(|k| time.contains(&(f64::from(k) * STEP))), "{time:?}");
    }
}

#[test]
fn a_step_that_is_discarded_half_way_is_continued_if_the_fmu_allows_it() {
    let run = Run::pair(&CFmu::that("discard at t1 and go on").without_rollback(), &MIDDLE);
    run.expect(0, TO_T1);
    assert_eq!((run.numbers("a.y"), run.numbers("time").last()), (run.numbers("time"), Some(&1.0)));
}

/// Section 4.2.4: after a discarded step no other step is allowed without fmi2SetFMUstate.
#[test]
fn a_step_that_is_discarded_half_way_ends_the_run_if_it_can_be_neither_continued_nor_repeated() {
    let run = Run::pair(&CFmu::that("discard at t1").without_rollback(), &MIDDLE);
    run.expect(1, TO_T1);
    run.says(&["a", "fmi2DoStep", "0.53125"]);
}

#[test]
fn an_fmu_that_requests_the_end_of_the_simulation_ends_it_normally() {
    let run = Run::pair(&CFmu::that("end at t1"), &MIDDLE);
    run.expect(0, TO_T1);
    // b has already stepped further: the last row has the last time that both have reached.
    run.says(&["a requested the end", "t = 0.53125 s", "the results end at t = 0.5 s"]);
    assert_eq!(run.numbers("time").len(), TO_T1);
    let run = Run::pair(&CFmu::that("end at t1"), &[&MIDDLE[..], &["--rollback"]].concat());
    run.expect(0, TO_T1);
    let last = |name: &str| run.numbers(name)[TO_T1..].to_vec();
    let b = run.numbers("b.y")[TO_T1 - 1] + 0.03125 * 0.5;
    assert_eq!([last("time"), last("a.y"), last("b.y")], [vec![0.53125], vec![0.53125], vec![b]]);
    let run = Run::of(&[("a", &CFmu::that("end at t1"))], &MIDDLE);
    assert_eq!(run.numbers("time").last(), Some(&0.53125), "it is alone: {}", run.message);
}

#[test]
fn steps_without_progress_end_the_run() {
    let run = Run::pair(&CFmu::that("discard every step"), &[]);
    run.expect(1, 1);
    run.says(&["a", "fmi2Discard"]);
    let run = Run::pair(&CFmu::that("lie about t1"), &MIDDLE);
    run.expect(1, TO_T1);
    run.says(&["a", "fmi2DoStep", "-1 s"]);
}

#[test]
fn a_step_that_stays_pending_is_given_up_after_the_time_limit() {
    let run = Run::pair(&CFmu::that("pend"), &["--set", "a.n=-1", "--time-limit", "0.2"]);
    run.expect(1, 1);
    run.says(&["a", "t = 0 s", "fmi2DoStep", "did not return within 0.2"]);
}

#[test]
fn a_pending_step_that_fails_ends_the_run() {
    let run = Run::pair(&CFmu::that("pend and fail"), &[]);
    run.expect(1, TO_T1);
    run.says(&["fmi2DoStep", "failed in the background"]);
}

/// Steps of full size end at 20.000000000000004 s for an FMU that adds the step to its start.
#[test]
fn an_fmu_that_refuses_steps_an_ulp_beyond_its_stop_time_runs_to_it() {
    let strict = CFmu::that("refuse what is beyond the stop time");
    let last = 19.990_000_000_000_002;
    assert!(last + 0.01 > 20.0);
    let long = ["--step", "0.01", "--stop-time", "20", "--record-every", "step"];
    for more in [
        &[][..],
        &["--isolate"],
        &["--every", "a=3"],
        &["--step-control", "doubling"],
        &["--coupling", "newton"],
    ] {
        let run = Run::of(&[("a", &strict)], &[&long[..], more].concat());
        assert_eq!(run.status, Some(0), "{more:?}: {}", run.message);
        assert_eq!(run.numbers("time").last(), Some(&20.0), "{more:?}");
    }
}

#[test]
fn an_fmu_with_equal_steps_ends_the_run_with_its_last_whole_step_and_a_warning() {
    let rigid =
        CFmu::that("step of one size").flag("canHandleVariableCommunicationStepSize", false);
    Run::pair(&rigid, &[]).expect(0, ALL);
    let one = [("a", &rigid)];
    let run = Run::of(&one, &["--stop-time", "1.01"]);
    assert_eq!(run.status, Some(0), "{}", run.message);
    run.says(&["warning", "a takes equal steps only", "stop time 1.01 s", "t = 1 s"]);
    assert_eq!(run.numbers("time").last(), Some(&1.0));
}

#[test]
fn two_instances_of_an_fmu_that_allows_one_are_refused_and_isolation_is_suggested() {
    let one = CFmu::that("one instance only").flag("canBeInstantiatedOnlyOncePerProcess", true);
    let run = Run::of(&[("a", &one), ("b", &one)], &[]);
    assert_eq!(run.status, Some(2), "{}", run.message);
    run.says(&["canBeInstantiatedOnlyOncePerProcess", "--isolate"]);
}

#[test]
fn several_instances_of_one_fmu_run_together() {
    let fmu = CFmu::well_behaved();
    let run = Run::of(&[("a", &fmu), ("b", &fmu), ("c", &fmu)], &["--set", "c.u=-2"]);
    assert_eq!(run.status, Some(0), "{}", run.message);
    let time = run.numbers("time");
    assert_eq!(time.len(), ALL);
    assert_eq!((run.numbers("a.y"), run.numbers("b.y")), (time.clone(), time.clone()));
    assert_eq!(run.numbers("c.y"), time.iter().map(|time| -2.0 * time).collect::<Vec<_>>());
}

#[test]
fn messages_with_a_foreign_or_null_environment_are_attributed_to_the_fmu_that_is_called() {
    for isolate in [&[][..], &["--isolate"]] {
        let run = Run::pair(&CFmu::that("no environment in fmi2DoStep"), isolate);
        run.expect(0, ALL);
        run.says(&["warning: a, t = 0.5 s, logAll: message 1 of nobody"]);
        let run = Run::pair(&CFmu::that("another environment in fmi2DoStep"), isolate);
        run.expect(0, ALL);
        run.says(&["warning: a, t = 0.5 s: message 2", "warning: a, t = 0.5 s, logAll: message 3"]);
        let run = Run::pair(&CFmu::that("no environment in fmi2Instantiate"), isolate);
        run.expect(0, ALL);
        run.says(&["warning: a, t = 0 s, logAll: message 1 of nobody"]);
    }
}

#[test]
fn value_references_in_messages_become_the_names_of_the_variables() {
    for isolate in [&[][..], &["--isolate"]] {
        let run = Run::pair(&CFmu::that("names in fmi2DoStep"), isolate);
        run.says(&["logAll: u, b_out and #r77# are #4"]);
    }
}

/// Behaviours that end or corrupt the process, and the word for each in the report.
const ENDS: [(&str, &str); 6] = [
    ("crash", "SIGSEGV"),
    ("abort", "SIGABRT"),
    ("exit 0", "exit"),
    ("exit 3", "exit"),
    ("overflow the stack", "SIGSEGV"),
    ("divide by zero", "SIGFPE"),
];

#[test]
#[cfg(unix)]
fn an_fmu_that_ends_the_process_is_reported_with_call_and_time_and_the_rows_are_kept() {
    for (deed, word) in ENDS {
        let run = Run::pair(&CFmu::that(&format!("{deed} in fmi2DoStep")), &[]);
        run.expect(1, TO_T1);
        run.says(&["error: a at t = 0.5 s: fmi2DoStep", word, "out/results.csv", "--isolate"]);
    }
}

#[test]
#[cfg(unix)]
fn no_row_is_lost_if_an_fmu_ends_the_process_after_the_last_step() {
    for function in ["fmi2Terminate", "fmi2FreeInstance"] {
        for (deed, word) in ENDS {
            let run = Run::pair(&CFmu::that(&format!("{deed} in {function}")), &[]);
            run.expect(1, ALL);
            run.says(&["error: a at t = ", function, word]);
        }
    }
}

#[test]
#[cfg(unix)]
fn an_fmu_that_ends_the_process_before_the_first_step_is_reported_with_the_call() {
    for function in ["fmi2Instantiate", "fmi2EnterInitializationMode", "fmi2SetReal"] {
        for (deed, word) in ENDS {
            let fmu = CFmu::that(&format!("{deed} in {function}"));
            let run = Run::pair(&fmu, &["--set", "a.u=1"]);
            assert_eq!(run.status, Some(2), "{}", run.message);
            run.says(&["error: a at t = 0 s: ", function, word]);
        }
    }
}

#[test]
#[cfg(unix)]
fn an_fmu_that_corrupts_the_common_heap_is_reported_with_call_and_time() {
    for function in ["fmi2DoStep", "fmi2Terminate"] {
        let run = Run::pair(&CFmu::that(&format!("corrupt the heap in {function}")), &[]);
        assert_eq!(run.status, Some(1), "{}", run.message);
        assert!(!run.message.contains("panicked"), "{}", run.message);
        run.says(&["a at t = ", function, "SIG", "--isolate"]);
    }
}

#[test]
fn a_time_limit_without_isolation_gives_a_warning() {
    let run = Run::pair(&CFmu::well_behaved(), &["--time-limit", "5"]);
    run.expect(0, ALL);
    run.says(&["warning: --time-limit without --isolate cannot end a call that hangs"]);
    let run = Run::pair(&CFmu::well_behaved(), &["--isolate", "--time-limit", "5"]);
    assert_eq!(run.message, "");
}

#[test]
fn a_crash_when_an_fmu_is_freed_does_not_hide_why_the_run_ended() {
    let fmu = CFmu::that("crash in fmi2FreeInstance");
    // Writing the results fails because the name is that of a folder.
    let run = Run::pair(&fmu, &["--results", "."]);
    assert_eq!(run.status, Some(2), "{}", run.message);
    run.says(&[
        "fmi2FreeInstance crashed with signal 11",
        "before that,",
        "results are written as",
    ]);
}
