//! Slaves that stop within a step, and outputs that are NaN.

use master::{
    Algorithm, Coupling, Extrapolation, Method, Readout, Simulation, StepControl, StepResult,
};

use crate::engine::puppet::{add_clock, system, whole};
use crate::engine::until;

/// Stops at 0.35 s; the rest of the step must be requested again.
pub(crate) fn stops(begin: f64, end: f64) -> StepResult {
    if begin < 0.35 && end > 0.35 {
        return StepResult::Part { reached: 0.35, terminated: false };
    }
    StepResult::Whole
}

pub(crate) fn ends(begin: f64, end: f64) -> StepResult {
    if begin < 0.35 && end > 0.35 {
        return StepResult::Part { reached: 0.35, terminated: true };
    }
    StepResult::Whole
}

fn never(begin: f64, _: f64) -> StepResult {
    StepResult::Part { reached: begin, terminated: false }
}

fn run(way: fn(f64, f64) -> StepResult, algorithm: &Algorithm) -> (Vec<f64>, Vec<(f64, f64)>) {
    let (system, asked) = system([|time| 1.0 + time; 2], way);
    let mut simulation = Simulation::new(system, algorithm, &until(1.0)).unwrap();
    let mut times = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        times.push(simulation.time());
    }
    let asked = asked.lock().unwrap().clone();
    (times, asked)
}

#[test]
fn without_rollback_a_slave_that_stops_within_a_step_continues_from_there() {
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.25);
    let (times, asked) = run(stops, &algorithm);
    assert_eq!(times, [0.25, 0.5, 0.75, 1.0]);
    assert_eq!(asked, [(0.0, 0.25), (0.25, 0.5), (0.35, 0.5), (0.5, 0.75), (0.75, 1.0)]);
}

#[test]
fn with_rollback_all_slaves_step_to_the_time_at_which_one_stopped() {
    for (coupling, control) in [
        (Coupling::Newton, StepControl::Fixed),
        (Coupling::Once, StepControl::Doubling),
        (Coupling::Once, StepControl::Embedded),
    ] {
        let algorithm = Algorithm { coupling, control, largest_step: 0.25, ..Algorithm::new(0.25) };
        let (times, asked) = run(stops, &algorithm);
        assert!(times.contains(&0.35), "{times:?}");
        assert_eq!(times.last(), Some(&1.0));
        // The step that was too long is requested again from its start.
        let too_far = asked.iter().find(|step| step.0 < 0.35 && step.1 > 0.35).unwrap();
        let near = |step: &&(f64, f64)| step.0 == too_far.0 && (step.1 - 0.35).abs() < 1e-15;
        assert!(asked.iter().any(|step| near(&step)) || control == StepControl::Doubling);
    }
}

/// An incomplete step gives no error estimate: the size of the rest says nothing about the next
/// step.
#[test]
fn an_incomplete_step_does_not_make_the_next_one_longer() {
    let algorithm = Algorithm {
        control: StepControl::Embedded,
        relative_tolerance: 1e-2,
        ..Algorithm::new(0.01)
    };
    let late = |begin: f64, end: f64| {
        let often = (begin * 20.0).floor() + 1.0;
        let stop = often / 20.0;
        if end > stop + 1e-12 {
            StepResult::Part { reached: stop, terminated: false }
        } else {
            StepResult::Whole
        }
    };
    let (_, asked) = run(late, &algorithm);
    let longest = asked.iter().map(|step| step.1 - step.0).fold(0.0, f64::max);
    let (_, free) = run(whole, &algorithm);
    let free = free.iter().map(|step| step.1 - step.0).fold(0.0, f64::max);
    assert!(longest <= free * 1.000_001, "{longest} {free}");
}

fn ends_later(begin: f64, end: f64) -> StepResult {
    if begin < 0.45 && end > 0.45 {
        return StepResult::Part { reached: 0.45, terminated: true };
    }
    StepResult::Whole
}

/// Returns the end of a run with a second puppet, whose output is the time and which requests a later end, and both
/// outputs at that time.
fn ended(algorithm: &Algorithm) -> (f64, Vec<f64>) {
    let (mut system, _) = system([|time| time; 2], ends);
    add_clock(&mut system, "q", ends_later);
    let mut simulation = Simulation::new(system, algorithm, &until(1.0)).unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    assert_eq!((simulation.ended_by(), simulation.ended_at()), (Some("p"), Some(0.35)));
    let ports = ["p.y", "q.y"].map(|name| simulation.system().port(name).unwrap());
    let mut readout = Readout::new(simulation.system(), &ports);
    readout.read(simulation.system(), 0.35).unwrap();
    simulation.terminate().unwrap();
    (simulation.time(), readout.reals)
}

#[test]
fn a_slave_that_requests_the_end_ends_the_run_at_its_time_if_all_can_go_back() {
    for algorithm in [
        Algorithm { rollback: true, ..Algorithm::new(0.25) },
        Algorithm { rollback: true, ..Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.25) },
        Algorithm { coupling: Coupling::Newton, ..Algorithm::new(0.25) },
        Algorithm { control: StepControl::Doubling, ..Algorithm::new(0.25) },
        Algorithm { control: StepControl::Embedded, ..Algorithm::new(0.25) },
    ] {
        assert_eq!(ended(&algorithm), (0.35, vec![0.35; 2]));
    }
}

/// The run ends at a time that all slaves have reached: its row is that of the previous step.
#[test]
fn a_slave_that_requests_the_end_ends_the_run_at_the_last_common_point_if_others_are_beyond() {
    for sweep in [Method::Jacobi, Method::GaussSeidel] {
        let (time, outputs) = ended(&Algorithm::fixed(sweep, Extrapolation::Hold, 0.25));
        assert_eq!((time, outputs), (0.25, vec![0.35, 0.45]));
    }
}

#[test]
fn a_slave_that_does_not_advance_is_an_error() {
    for algorithm in [
        Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.25),
        Algorithm { coupling: Coupling::Newton, ..Algorithm::new(0.25) },
    ] {
        let (system, _) = system([|time| time; 2], never);
        let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
        let message = simulation.step().unwrap_err().to_string();
        let expected = "p at t = 0 s: fmi2DoStep returned fmi2Discard and came to 0 s only, on the \
                        way from 0 to 0.25 s";
        assert_eq!(message, expected);
    }
}

fn nearly(_: f64, end: f64) -> StepResult {
    StepResult::Part { reached: end - 1e-13, terminated: false }
}

#[test]
fn a_step_that_ends_a_rounding_error_early_is_complete() {
    for coupling in [Coupling::Once, Coupling::Newton] {
        let algorithm = Algorithm { coupling, ..Algorithm::new(0.25) };
        assert_eq!(run(nearly, &algorithm).0, [0.25, 0.5, 0.75, 1.0]);
    }
}

fn breaks(time: f64) -> f64 {
    if time > 0.6 { f64::NAN } else { 1.0 }
}

#[test]
fn an_output_that_is_nan_ends_the_run_unless_that_is_allowed() {
    let algorithm = Algorithm::fixed(Method::GaussSeidel, Extrapolation::Linear, 0.25);
    let (once, _) = system([breaks; 2], whole);
    let mut simulation = Simulation::new(once, &algorithm, &until(1.0)).unwrap();
    simulation.step().unwrap();
    simulation.step().unwrap();
    let message = simulation.step().unwrap_err().to_string();
    assert_eq!(message, "p.y is NaN at t = 0.75 s, expected a finite number");
    let (again, _) = system([breaks; 2], whole);
    let algorithm = Algorithm { allow_nan: true, ..algorithm };
    let mut simulation = Simulation::new(again, &algorithm, &until(1.0)).unwrap();
    for _ in 0..4 {
        simulation.step().unwrap();
    }
    assert!(simulation.is_finished());
}
