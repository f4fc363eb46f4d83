//! FMUs that do not do what their descriptions declare.

use super::*;

/// Gauss-Seidel with lines from output derivatives, instead of the held inputs of [`Run`].
const LINES: [&str; 4] = ["--method", "jacobi", "--extrapolation", "linear"];

/// `a`, connected by lines to b, which has no input derivatives and gets their mean.
fn by_lines(a: &CFmu, more: &[&str]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let a = a.write(folder.path(), "a").display().to_string();
    let b = CFmu::well_behaved().write(folder.path(), "b").display().to_string();
    let out = folder.path().join("out").display().to_string();
    let step = STEP.to_string();
    let mut arguments = vec!["run", &a, &b, "--connect", "a.y=b.u", "--stop-time", "1", "--out"];
    arguments.extend([&out, "--step", &step, "--record", "b.y"]);
    arguments.extend(LINES);
    arguments.extend(more);
    let output = tests::run(&arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{message}");
    let text = std::fs::read_to_string(folder.path().join("out/results.csv")).unwrap_or_default();
    let warnings = message.lines().filter(|line| line.starts_with("warning"));
    let mut said: Vec<String> = warnings.map(str::to_owned).collect();
    said.extend(text.lines().skip(1).map(|line| line.split(',').nth(1).unwrap_or("").to_owned()));
    said
}

/// a.y = t. If the derivative 1 of a.y is used, b gets the mean of the line over the step, t + H/2,
/// so b.y = t^2/2; otherwise b gets t.
#[test]
fn a_connection_is_held_while_its_output_derivative_is_not_finite_and_named_once() {
    for (start, value) in [("NaN", "NaN"), ("infinite", "inf")] {
        let fmu = CFmu::that(&format!("derivative {start} until t1"));
        let lines = by_lines(&fmu.promising_output_derivatives(), &[]);
        let (warning, rows) = lines.split_first().unwrap_or_else(|| panic!("no lines"));
        let derivative = format!("a.y: its output derivative is {value} at t = ");
        for part in ["warning", &derivative, "connections from a.y are held"] {
            assert!(warning.contains(part), "{part:?} is not in {warning:?}");
        }
        assert_eq!(rows.len(), ALL);
        let mut expected = 0.0;
        for (row, actual) in rows.iter().enumerate() {
            assert_eq!(actual.parse::<f64>().ok(), Some(expected), "{start}, row {row}");
            let time = STEP * f64::from(u8::try_from(row).unwrap_or_default());
            expected += STEP * if time < 0.5 { time } else { time + STEP / 2.0 };
        }
    }
}

#[test]
fn a_run_works_without_derivatives_that_an_fmu_declares_and_refuses() {
    let refusing = CFmu::that("derivative refused").promising_output_derivatives();
    let refusing = refusing.flag("canInterpolateInputs", true);
    let lines = by_lines(&refusing, &[]);
    let (warning, rows) = lines.split_first().unwrap_or_else(|| panic!("no lines"));
    for part in ["a: fmi2GetRealOutputDerivatives", "fmi2Error", "maxOutputDerivativeOrder"] {
        assert!(warning.contains(part), "{part:?} is not in {warning:?}");
    }
    assert_eq!(rows.len(), ALL);
    // The other way round: a receives the connection.
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let a = refusing.write(folder.path(), "a").display().to_string();
    let b = CFmu::well_behaved().write(folder.path(), "b").display().to_string();
    let out = folder.path().join("out").display().to_string();
    let output = tests::run(&["run", &a, &b, "--connect", "b.y=a.u", "--out", &out]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{message}");
    for part in ["a: fmi2SetRealInputDerivatives", "canInterpolateInputs"] {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

/// After `fmi2Error` an instance must not be used (FMI 2.0.5, section 2.1.3).
#[test]
fn a_variable_that_cannot_be_read_ends_the_run_and_can_be_left_out() {
    let fmu = CFmu::well_behaved().with_unreadable_variable();
    for more in [&[][..], &["--isolate"]] {
        let run = Run::of(&[("a", &fmu)], more);
        assert_eq!(run.status, Some(2), "{}", run.message);
        run.says(&["a.hidden at t = 0 s: fmi2GetReal returned fmi2Error", "exclude a.hidden"]);
        let run = Run::of(&[("a", &fmu)], &[&["--exclude", "a.hidden"], more].concat());
        assert_eq!((run.status, run.message.as_str()), (Some(0), ""));
        assert_eq!(run.numbers("a.y"), run.numbers("time"));
        assert_eq!(run.numbers("time").len(), ALL);
    }
}

/// A state that the description declares and the FMU refuses: the default algorithm then does not
/// iterate. The FMUs state no dependencies, so no iteration is needed here, and there is no
/// warning.
#[test]
fn fmus_that_refuse_their_state_run_by_default_if_no_state_is_needed() {
    let fmu = CFmu::that("no way back");
    let run = Run::of(&[("a", &fmu), ("b", &fmu)], &["--connect", "a.y=b.u"]);
    assert_eq!((run.status, run.message.as_str()), (Some(0), ""));
}
