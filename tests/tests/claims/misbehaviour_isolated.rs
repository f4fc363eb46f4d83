//! FMUs in C under `aso-ftc run --isolate`: if one ends its process, the run reports the FMU, the
//! call, the time and the signal, and the results up to that step are complete.

use tests::c_fmu::CFmu;
use tests::coupled::{ALL, Run, STEP, TO_T1, UNUSUAL};

/// Runs `a` with that behaviour and `b`, each in a process of its own.
fn isolated(behaviour: &str, more: &[&str]) -> Run {
    let more: Vec<_> = ["--isolate"].iter().chain(more).copied().collect();
    Run::pair(&CFmu::that(behaviour), &more)
}

/// Behaviours that end the process of an FMU, and the text that reports each.
const ENDS: [(&str, &[&str]); 4] = [
    ("crash", &["signal 11", "SIGSEGV"]),
    ("abort", &["signal 6", "SIGABRT"]),
    ("exit 3", &["exit status 3"]),
    ("exit 0", &["exit status 0"]),
];

#[test]
fn an_fmu_whose_process_ends_in_a_step_is_reported_with_call_time_and_reason() {
    for (deed, reason) in ENDS {
        let run = isolated(&format!("{deed} in fmi2DoStep"), &[]);
        run.expect(1, TO_T1);
        run.says(&["a", "fmi2DoStep", "t = 0.5 s"]);
        run.says(reason);
    }
}

#[test]
fn an_fmu_whose_process_ends_when_it_is_read_is_reported_with_call_and_reason() {
    for (deed, reason) in ENDS {
        let run = isolated(&format!("{deed} in fmi2GetReal"), &[]);
        run.expect(1, TO_T1 - 1);
        run.says(&["a", "fmi2GetReal"]);
        run.says(reason);
    }
}

#[test]
fn an_fmu_whose_process_ends_before_the_first_step_is_reported_with_call_and_reason() {
    for function in ["fmi2Instantiate", "fmi2SetupExperiment", "fmi2EnterInitializationMode"] {
        for (deed, reason) in ENDS {
            let run = isolated(&format!("{deed} in {function}"), &[]);
            assert!(matches!(run.status, Some(1 | 2)), "{function}: {}", run.message);
            assert!(!run.message.contains("panicked"), "{}", run.message);
            run.says(&["a", function]);
            run.says(reason);
        }
    }
}

#[test]
fn no_results_are_lost_if_the_process_of_an_fmu_ends_after_the_last_step() {
    for function in ["fmi2Terminate", "fmi2FreeInstance"] {
        for (deed, reason) in ENDS {
            let run = isolated(&format!("{deed} in {function}"), &[]);
            run.expect(1, ALL);
            run.says(&["a", function]);
            run.says(reason);
        }
    }
}

#[test]
fn an_fmu_that_corrupts_its_heap_affects_nothing_else() {
    let run = isolated("corrupt the heap in fmi2DoStep", &[]);
    run.expect(1, TO_T1);
    run.says(&["a", "signal"]);
}

#[test]
fn a_call_that_never_returns_is_ended_after_the_time_limit() {
    for deed in ["hang", "spin"] {
        let run = isolated(&format!("{deed} in fmi2DoStep"), &["--time-limit", "0.5"]);
        run.expect(1, TO_T1);
        run.says(&["a", "fmi2DoStep", "t = 0.5 s", "did not return within 0.5 s"]);
    }
    let run = isolated("hang in fmi2Instantiate", &["--time-limit", "0.5"]);
    assert!(matches!(run.status, Some(1 | 2)), "{}", run.message);
    run.says(&["a", "fmi2Instantiate", "did not return within 0.5 s"]);
    for function in ["fmi2Terminate", "fmi2FreeInstance"] {
        let run = isolated(&format!("hang in {function}"), &["--time-limit", "0.5"]);
        run.expect(1, ALL);
        run.says(&["a", function, "did not return within 0.5 s"]);
    }
}

#[test]
fn errors_of_the_interface_are_reported_as_without_isolation() {
    for (behaviour, rows, parts) in [
        ("fail in fmi2DoStep", TO_T1, ["fmi2DoStep", "fmi2Error", "as it was told"]),
        ("fail fatally in fmi2DoStep", TO_T1, ["fmi2DoStep", "fmi2Fatal", "as it was told"]),
        ("return 17 in fmi2DoStep", TO_T1, ["fmi2DoStep", "17", "t = 0.5 s"]),
        ("pend and fail", TO_T1, ["fmi2DoStep", "fmi2Error", "failed in the background"]),
        ("fail in fmi2GetReal", TO_T1 - 1, ["fmi2GetReal", "fmi2Error", "as it was told"]),
        ("not a number", TO_T1 - 1, ["a.y", "NaN", "t = 0.5 s"]),
        ("fail in fmi2Terminate", ALL, ["fmi2Terminate", "fmi2Error", "as it was told"]),
    ] {
        let run = isolated(behaviour, &[]);
        run.expect(1, rows);
        run.says(&parts);
    }
}

#[test]
fn unusual_fmus_run_in_processes_too() {
    let meddling = [
        "print in fmi2Instantiate",
        "change the locale in fmi2DoStep",
        "change the folder in fmi2Instantiate",
    ];
    for behaviour in UNUSUAL.into_iter().chain(meddling) {
        isolated(behaviour, &[]).expect(0, ALL);
    }
    isolated("flood in fmi2DoStep", &["--set", "a.t1=0.9375"]).expect(0, ALL);
    let without = CFmu::well_behaved().without(&["fmi2Terminate", "fmi2GetString"]);
    Run::pair(&without, &["--isolate"]).expect(0, ALL);
}

#[test]
fn a_step_that_is_discarded_half_way_is_made_in_parts_across_processes() {
    let run = isolated("discard at t1", &["--set", "a.t1=0.53125", "--rollback"]);
    run.expect(0, TO_T1);
    let time = run.numbers("time");
    assert_eq!((time.last(), &run.numbers("a.y")), (Some(&1.0), &time));
}

#[test]
fn an_fmu_for_one_instance_has_one_in_each_process() {
    let one = CFmu::that("one instance only").flag("canBeInstantiatedOnlyOncePerProcess", true);
    let run = Run::of(&[("a", &one), ("b", &one)], &["--isolate", "--set", "b.u=3"]);
    assert_eq!(run.status, Some(0), "{}", run.message);
    let time = run.numbers("time");
    assert_eq!((time.len(), run.numbers("a.y")), (ALL, time.clone()));
    assert_eq!(run.numbers("b.y"), time.iter().map(|time| 3.0 * time).collect::<Vec<_>>());
}

#[test]
fn a_changed_rounding_mode_of_one_fmu_does_not_affect_others() {
    let rounds = CFmu::that("round up in fmi2DoStep");
    let more = ["--isolate", "--set", "a.t1=0", "--set", "a.u=0.1", "--set", "b.u=0.1"];
    let run = Run::of(&[("a", &rounds), ("b", &CFmu::well_behaved())], &more);
    assert_eq!(run.status, Some(0), "{}", run.message);
    let mut nearest = vec![0.0];
    for step in 0..ALL - 1 {
        nearest.push(nearest[step] + STEP * 0.1);
    }
    assert_eq!(run.numbers("b.y"), nearest);
    assert_ne!(run.numbers("a.y"), nearest, "the FMU itself does round up");
}

#[test]
fn values_of_all_types_pass_through_connections_between_processes() {
    let text = "Grüße, \"Ångström\"\n;";
    let set = format!("a.s_in={text}");
    let links = ["i", "b", "s", "e"].map(|kind| format!("a.{kind}_out=b.{kind}_in"));
    let mut more: Vec<&str> = links.iter().flat_map(|link| ["--connect", link]).collect();
    more.extend(["--isolate", "--set", "a.i_in=2147483647", "--set", "a.b_in=true"]);
    more.extend(["--set", &set, "--set", "a.e_in=2"]);
    let fmu = CFmu::well_behaved();
    let run = Run::of(&[("a", &fmu), ("b", &fmu)], &more);
    assert_eq!(run.status, Some(0), "{}", run.message);
    let last = |name: &str| run.column(name).pop().unwrap_or_default();
    assert_eq!((last("b.i_out").as_str(), last("b.s_out").as_str()), ("2147483647", text));
    assert!(["1", "true", "True"].contains(&last("b.b_out").as_str()));
    assert!(["2", "on"].contains(&last("b.e_out").as_str()));
}
