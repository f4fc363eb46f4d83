//! Steps of equations with known solutions.

use super::*;

fn run(
    method: Method,
    tolerance: f64,
    mut equations: impl FnMut(f64, &[f64], &mut [f64]),
    start: &[f64],
    end: f64,
) -> (Vec<f64>, u32, Stepper) {
    let scale = Scale::new(tolerance, 0.01 * tolerance, vec![1.0; start.len()]);
    let mut stepper = Stepper::new(method, scale);
    let mut derivative = |t: f64, y: &[f64], slope: &mut [f64]| {
        equations(t, y, slope);
        Ok(())
    };
    let (mut time, mut states, mut steps) = (0.0, start.to_vec(), 0);
    while time < end {
        time = match stepper.advance(&mut derivative, &states, time, end) {
            Ok(reached) => reached,
            Err(error) => panic!("{error:?}"),
        };
        states.copy_from_slice(stepper.end());
        steps += 1;
    }
    (states, steps, stepper)
}

#[test]
fn the_error_of_a_long_run_follows_the_tolerance() {
    let circle = |_: f64, y: &[f64], slope: &mut [f64]| (slope[0], slope[1]) = (y[1], -y[0]);
    for method in [Method::Explicit, Method::Stiff, Method::Automatic] {
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let (actual, ..) = run(method, tolerance, circle, &[0.0, 1.0], 10.0);
            let error = (actual[0] - 10.0_f64.sin()).abs() + (actual[1] - 10.0_f64.cos()).abs();
            assert!(error < 50.0 * tolerance, "{method:?} {tolerance}: {error}");
        }
    }
}

/// Robertson's reaction; the values at t = 40 and 4e5 s are those of Hairer and Wanner 1996, section
/// IV.10, and of the SUNDIALS example cvRoberts.
fn robertson(_: f64, y: &[f64], slope: &mut [f64]) {
    slope[0] = -0.04 * y[0] + 1e4 * y[1] * y[2];
    slope[2] = 3e7 * y[1] * y[1];
    slope[1] = -slope[0] - slope[2];
}

#[test]
fn stiff_reactions_are_noticed_and_integrated() {
    let start = [1.0, 0.0, 0.0];
    let known = [(40.0, [7.158e-1, 9.185e-6, 2.842e-1]), (4e5, [4.939e-3, 1.985e-8, 9.951e-1])];
    for (end, expected) in known {
        for method in [Method::Automatic, Method::Stiff] {
            let (actual, steps, stepper) = run(method, 1e-6, robertson, &start, end);
            assert!(stepper.memory.is_stiff && steps < 400, "{method:?} {steps}");
            for (actual, expected) in actual.iter().zip(expected) {
                assert!((actual / expected - 1.0).abs() < 1e-3, "{end}: {actual} {expected}");
            }
        }
    }
}

#[test]
fn equations_that_are_no_longer_stiff_return_to_the_explicit_method() {
    // Stiff until t = 1 s, an oscillator after it.
    let equations = |t: f64, y: &[f64], slope: &mut [f64]| {
        let rate = if t < 1.0 { 1e6 } else { 0.1 };
        slope[0] = -rate * (y[0] - 2.0);
        slope[1] = 20.0 * y[2];
        slope[2] = -20.0 * y[1];
    };
    let (actual, _, stepper) = run(Method::Automatic, 1e-6, equations, &[0.0, 0.0, 1.0], 5.0);
    assert!(!stepper.memory.is_stiff);
    assert!((actual[1] - 100.0_f64.sin()).abs() < 1e-3, "{}", actual[1]);
}

#[test]
fn a_state_without_a_derivative_ends_the_run_by_its_name() {
    let scale = Scale::new(1e-6, 1e-8, vec![1.0; 2]);
    let mut stepper = Stepper::new(Method::Explicit, scale);
    let mut derivative = |t: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = 1.0;
        slope[1] = if t < 0.5 { 1.0 } else { f64::NAN };
        Ok(())
    };
    let (mut time, mut states) = (0.0, vec![0.0; 2]);
    let error = loop {
        match stepper.advance(&mut derivative, &states, time, 1.0) {
            Ok(reached) => time = reached,
            Err(error) => break error,
        }
        states.copy_from_slice(stepper.end());
    };
    assert!(
        matches!(error, StepError::Size { state: 1, is_finite: false, cause: None, .. }),
        "{error:?}"
    );
    assert!((time - 0.5).abs() < 1e-9, "{time}");
}

/// The FMU refuses long steps. Shorter steps fail because their derivative is NaN, which is the cause.
#[test]
fn a_refusal_before_the_last_trial_step_is_not_the_cause() {
    let mut stepper = Stepper::new(Method::Explicit, Scale::new(1e-6, 1e-8, vec![1.0]));
    let mut derivative = |t: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = if t > 0.0 { f64::NAN } else { 1.0 };
        let failure = Failure::Status(Status::Discard);
        let error = CallError { function: "fmi2GetDerivatives", failure, messages: Vec::new() };
        if t > 1e-9 { Err(error) } else { Ok(()) }
    };
    let error = stepper.advance(&mut derivative, &[0.0], 0.0, 1.0).unwrap_err();
    assert!(
        matches!(error, StepError::Size { state: 0, is_finite: false, cause: None, .. }),
        "{error:?}"
    );
}

/// The first step of 1e-6 s that is chosen for such states is less than four units in the last place of the time.
#[test]
fn states_at_rest_at_zero_are_integrated_in_seconds_since_1970() {
    let mut stepper = Stepper::new(Method::Automatic, Scale::new(1e-6, 1e-8, vec![1.0]));
    let mut derivative = |_: f64, _: &[f64], slope: &mut [f64]| {
        slope[0] = 0.0;
        Ok(())
    };
    let (mut time, end) = (1.7e9, 1.7e9 + 1.0);
    while time < end {
        time = match stepper.advance(&mut derivative, &[0.0], time, end) {
            Ok(reached) => reached,
            Err(error) => panic!("{error:?}"),
        };
    }
    assert!(stepper.end()[0].abs() < 1e-15);
}
