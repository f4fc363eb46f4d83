//! `fmi2DoStep`: time and size of communication steps.

use super::{DRIVE, Decay, X, get, initialized, set, step};
use crate::Experiment;
use crate::instance::Instance;
use fmu_description::abi::Status;
use fmu_description::call_order::{Function, State};

#[test]
fn steps_follow_the_exponential_and_time_is_the_importers() {
    let mut instance = initialized();
    for k in 0..10 {
        assert_eq!(step(&mut instance, f64::from(k) * 0.1, 0.1), Status::OK);
    }
    assert!((get(&mut instance, X) - (-2.0_f64).exp()).abs() < 1e-14);
    assert!((get(&mut instance, 0) - 1.0).abs() < 1e-15);
}

#[test]
fn impossible_steps_are_errors() {
    for (start, size) in [
        (0.0, 0.0),
        (0.0, -0.1),
        (0.0, f64::NAN),
        (0.0, f64::INFINITY),
        (0.5, 0.1),
        (f64::NAN, 0.1),
        (0.0, 10.1),
    ] {
        assert_eq!(step(&mut initialized(), start, size), Status::Error, "{start} {size}");
    }
}

#[test]
fn a_step_of_more_than_1e7_default_steps_is_discarded_before_the_model_sees_it() {
    for size in [1.1e7, 1e300] {
        let mut instance = started_at(0.0);
        assert_eq!(step(&mut instance, 0.0, size), Status::Discard, "{size}");
        assert_eq!((instance.core.model.count, instance.last_successful_time()), (0, 0.0));
    }
    assert_eq!(step(&mut started_at(0.0), 0.0, 1e7), Status::OK);
}

#[test]
fn a_step_that_stops_half_way_tells_the_time_reached() {
    let mut instance = initialized();
    set(&mut instance, DRIVE, 50.0);
    assert_eq!(step(&mut instance, 0.0, 0.5), Status::Discard);
    assert_eq!(instance.last_successful_time(), 0.25);
    assert_eq!(instance.core.state, State::StepFailed);
}

/// An instance whose run starts at `time`.
fn started_at(time: f64) -> Instance<Decay> {
    let mut instance = super::fresh();
    let experiment = Experiment { start_time: time, ..Experiment::default() };
    let done = [
        instance.call(Function::SetupExperiment, |i| i.setup_experiment(experiment)),
        instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode),
        instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode),
    ];
    assert_eq!(done, [Status::OK; 3]);
    instance
}

/// The message of the error for a step.
fn refusal(time: f64, start: f64, size: f64) -> String {
    crate::instance::communication_step(time, start, size).unwrap_err().to_string()
}

#[test]
fn a_step_below_the_resolution_of_time_is_an_error_that_names_the_smallest_one() {
    for (time, size, smallest) in [
        (1e3, 1e-20, "1.1368683772161603e-13"),
        (1e3, 1e-13, "1.1368683772161603e-13"),
        (1e9, 1e-8, "1.1920928955078125e-7"),
        (-1.0, 1e-17, "1.1102230246251565e-16"),
        (1.0, f64::MIN_POSITIVE, "2.220446049250313e-16"),
    ] {
        assert_eq!(step(&mut started_at(time), time, size), Status::Error, "{time} {size}");
        let message = refusal(time, time, size);
        for part in [format!("{size:e} s"), format!("{time} s"), format!("{smallest} s")] {
            assert!(message.contains(&part), "{message}: {part}");
        }
        let smallest = smallest.parse().unwrap();
        let mut instance = started_at(time);
        assert_eq!(step(&mut instance, time, smallest), Status::OK, "{time} {smallest}");
        assert_eq!(get(&mut instance, 0), time.next_up());
    }
}

/// The master computes its time as a multiple of the step h, so it advances although `t + h` rounds to `t`.
#[test]
fn a_master_whose_time_advances_by_less_than_its_resolution_hears_of_it() {
    let (start, size) = (1e9, 1e-8);
    let mut instance = started_at(start);
    let statuses: Vec<_> =
        (0..100).map(|k| step(&mut instance, start + f64::from(k) * size, size)).collect();
    assert!(start + 100.0 * size > start);
    assert_eq!(statuses[0], Status::Error, "not one call is answered by OK without a step");
}

#[test]
fn a_step_that_ends_before_the_time_reached_is_an_error() {
    for (start, size) in [(0.0, 1e-10), (4e-10, 1e-10), (1e-10, 2e-10)] {
        let mut instance = initialized();
        assert_eq!(step(&mut instance, 0.0, 5e-10), Status::OK);
        assert_eq!(step(&mut instance, start, size), Status::Error, "{start} {size}");
        assert_eq!(get(&mut instance, 0), 5e-10);
        let message = refusal(5e-10, start, size);
        assert!(message.contains("the instance is at 0.0000000005 s"), "{message}");
    }
}

/// The distance to the stop time is a multiple of the resolution of time, so the step is valid.
#[test]
fn the_rest_to_the_stop_time_is_a_step_however_small() {
    for time in [9.0_f64, 2.0, 0.3, 1e-3, 123_456.789] {
        for stop in [time.next_up(), time.next_up().next_up().next_up()] {
            let mut instance = started_at(time);
            assert_eq!(step(&mut instance, time, stop - time), Status::OK);
            assert_eq!(get(&mut instance, 0), stop);
        }
    }
}
