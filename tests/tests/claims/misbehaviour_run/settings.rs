//! Settings before the run, start values, and the tolerance passed to the FMUs' solvers.

use super::*;

/// The slave ends a step at t1, so its value of t1 shows in the results.
fn ending(behaviour: &str) -> CFmu {
    CFmu::that(behaviour)
}

#[test]
fn settings_survive_an_fmu_that_resets_them_before_and_during_the_initialization() {
    for function in ["fmi2SetupExperiment", "fmi2EnterInitializationMode"] {
        let fmu = ending(&format!("forget in {function}"));
        let recorded =
            ["--set", "a.t1=2.5", "--set", "a.n=4", "--record", "a.t1", "--record", "a.n"];
        let run = Run::of(&[("a", &fmu)], &recorded);
        assert_eq!(run.status, Some(0), "{function}: {}", run.message);
        assert_eq!(run.numbers("a.t1"), vec![2.5; ALL], "{function}");
        assert_eq!(run.numbers("a.n"), vec![4.0; ALL], "{function}");
        assert_eq!(run.message, "", "{function}");
    }
}

#[test]
fn a_setting_that_an_fmu_does_not_keep_ends_the_run_before_its_start_and_is_named() {
    let fmu = ending("forget in fmi2ExitInitializationMode");
    for (setting, parts) in
        [("a.t1=2.5", ["a.t1", "2.5", "0.5", "lost"]), ("a.n=4", ["a.n", "4", "3", "lost"])]
    {
        for more in [&["--set", setting][..], &["--set", setting, "--isolate"]] {
            let run = Run::of(&[("a", &fmu)], more);
            assert_eq!(run.status, Some(2), "{}", run.message);
            run.says(&parts);
        }
    }
    // A setting that equals the value to which the FMU resets it is kept.
    let run = Run::of(&[("a", &fmu)], &["--set", "a.t1=0.5"]);
    assert_eq!((run.status, run.message.as_str()), (Some(0), ""));
}

#[test]
fn each_fmu_gets_its_own_tolerance_unless_the_user_states_one() {
    let told = |tolerance: Option<&str>| {
        let attributes = tolerance.map(|tolerance| format!("tolerance=\"{tolerance}\""));
        let attributes = attributes.unwrap_or_else(|| "stepSize=\"1\"".to_owned());
        CFmu::that("start at the tolerance").experiment(&attributes)
    };
    let (a, b, c) = (told(Some("1e-5")), told(Some("1e-7")), told(None));
    let fmus = [("a", &a), ("b", &b), ("c", &c)];
    for (more, expected) in [
        (&[][..], [1e-5, 1e-7, -1.0]),
        (&["--tolerance", "1e-3"], [1e-3; 3]),
        (&["--isolate"], [1e-5, 1e-7, -1.0]),
    ] {
        let run = Run::of(&fmus, more);
        assert_eq!(run.status, Some(0), "{}", run.message);
        let starts = ["a.y", "b.y", "c.y"].map(|name| run.numbers(name)[0]);
        assert_eq!(starts.map(f64::to_bits), expected.map(f64::to_bits), "{more:?}");
    }
}

#[test]
fn a_run_without_a_stop_time_takes_one_second_and_says_so() {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    for (name, attributes, last) in [
        ("none", "stepSize=\"0.25\"", "1"),
        ("late", "startTime=\"3\" stepSize=\"0.25\"", "4"),
        ("empty", "startTime=\"0\" stopTime=\"0\" stepSize=\"0.25\"", "1"),
    ] {
        let path = CFmu::well_behaved().experiment(attributes).write(folder.path(), name);
        let out = folder.path().join(name).display().to_string();
        let output = tests::run(&["run", &path.display().to_string(), "--out", &out]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{message}");
        assert!(message.contains(&format!("stop time {last} s")), "{message}");
        assert!(message.contains("--stop-time"), "{message}");
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(printed.contains(&format!("t = {last} s reached in 4 steps")), "{printed}");
    }
}

#[test]
fn two_sources_of_one_input_are_refused_on_the_command_line() {
    let fmu = CFmu::well_behaved();
    let twice = ["--connect", "a.y=b.u", "--connect", "c.y=b.u"];
    let run = Run::of(&[("a", &fmu), ("b", &fmu), ("c", &fmu)], &twice);
    assert_eq!(run.status, Some(2), "{}", run.message);
    run.says(&["b.u", "a.y", "c.y"]);
}
