//! Steps that end at events.

use fmu_description::Experiment;
use master::algorithm::EventSource;
use master::{
    Algorithm, Extrapolation, Method, Readout, Simulation, StepControl, StepResult, System,
};
use tests::linear::OUTPUTS;

use crate::engine::puppet::{add_clock, system, whole};
use crate::engine::typed::ring;
use crate::engine::until;

const EVENTS: [f64; 4] = [0.137, 0.3, 0.3001, 0.7777];

fn next(time: f64) -> f64 {
    EVENTS.into_iter().find(|event| *event > time).unwrap_or(f64::INFINITY)
}

fn times(simulation: &mut Simulation) -> Vec<f64> {
    let mut times = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        times.push(simulation.time());
    }
    times
}

#[test]
fn fixed_steps_end_at_the_times_that_an_output_announces_and_on_the_grid() {
    let (system, asked) = system([f64::sin, next], whole);
    let event = EventSource::NextTime(system.port("p.z").unwrap());
    let algorithm = Algorithm {
        events: vec![event],
        ..Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.1)
    };
    let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
    let grid = |k: u32| f64::from(k) * 0.1;
    let mut expected: Vec<f64> = (1..10).map(grid).chain([0.137, 0.3001, 0.7777, 1.0]).collect();
    expected.sort_by(f64::total_cmp);
    // 3 * 0.1 is the next number above 0.3: the event there is the grid point.
    assert_eq!(times(&mut simulation), expected);
    let ends: Vec<f64> = asked.lock().unwrap().iter().map(|step| step.1).collect();
    for (end, expected) in ends.iter().zip(&expected) {
        assert!((end - expected).abs() <= f64::EPSILON, "{end} {expected}");
    }
}

/// One unit in the last place of these times is 2.4e-7 s.
#[test]
fn in_seconds_since_1970_an_event_just_before_a_grid_point_is_there() {
    const START: f64 = 1.7e9;
    let event = |time: f64| {
        let event = (START + 0.5).next_down();
        if time < event { event } else { f64::INFINITY }
    };
    let (system, _) = system([f64::sin, event], whole);
    let event = EventSource::NextTime(system.port("p.z").unwrap());
    let algorithm = Algorithm { events: vec![event], ..Algorithm::new(0.25) };
    let experiment = Experiment { start_time: START, ..until(START + 1.0) };
    let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
    assert_eq!(times(&mut simulation), [0.25, 0.5, 0.75, 1.0].map(|time| START + time));
}

#[test]
fn chosen_steps_end_at_the_times_that_an_output_announces() {
    for control in [StepControl::Doubling, StepControl::Embedded, StepControl::Increment] {
        let (system, _) = system([f64::sin, next], whole);
        let event = EventSource::NextTime(system.port("p.z").unwrap());
        let algorithm =
            Algorithm { events: vec![event], control, largest_step: 0.25, ..Algorithm::new(0.1) };
        let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
        let times = times(&mut simulation);
        for event in [0.137, 0.3, 0.3001, 0.7777, 1.0] {
            assert!(times.contains(&event), "{}: {event} in {times:?}", control.name());
        }
    }
}

#[test]
fn a_source_of_events_that_is_no_real_is_refused() {
    let system = ring();
    let event = EventSource::NextTime(system.port("a.out1").unwrap());
    let algorithm = Algorithm { events: vec![event], ..Algorithm::new(0.1) };
    let expected =
        "a.out1 is a variable of type Integer, expected a Real output as a source of events";
    assert_eq!(algorithm.check(&system).unwrap_err().to_string(), expected);
}

/// Crosses zero upwards at 0.4321 s and downwards at 0.8 s.
fn crosses(time: f64) -> f64 {
    let (first, second) = (time - 0.4321, 0.8 - time);
    first * second * (1.0 + time)
}

#[test]
fn a_change_of_sign_ends_a_step_within_1e_9_of_its_size() {
    for control in [StepControl::Fixed, StepControl::Doubling] {
        let (system, _) = system([f64::sin, crosses], whole);
        let event = EventSource::Crossing(system.port("p.z").unwrap());
        let algorithm =
            Algorithm { events: vec![event], control, largest_step: 0.15, ..Algorithm::new(0.15) };
        let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
        let times = times(&mut simulation);
        for event in [0.4321, 0.8] {
            let near = |time: &&f64| (*time - event).abs() <= 0.15e-9;
            let actual: Vec<_> = times.iter().filter(near).collect();
            assert_eq!(actual.len(), 1, "{}: {event} in {times:?}", control.name());
            // At the end of the step the sign has changed.
            assert!((crosses(*actual[0]) > 0.0) != (crosses(event - 1e-6) > 0.0));
        }
    }
}

#[test]
fn between_events_fixed_steps_stay_on_the_grid() {
    let (system, _) = system([f64::sin, crosses], whole);
    let event = EventSource::Crossing(system.port("p.z").unwrap());
    let algorithm = Algorithm { events: vec![event], ..Algorithm::new(0.15) };
    let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
    let times = times(&mut simulation);
    for k in 1..=6 {
        assert!(times.contains(&(f64::from(k) * 0.15)), "{k}: {times:?}");
    }
    assert_eq!(times.len(), 9);
}

/// The result of a step to a time between 0.25 and 0.45 s, which ends at 0.25 s; other steps are whole.
fn early(begin: f64, end: f64, terminated: bool) -> StepResult {
    if begin < 0.25 && end > 0.25 && end < 0.45 {
        return StepResult::Part { reached: 0.25, terminated };
    }
    StepResult::Whole
}

/// A simulation to 0.5 s in one step, but for the crossing at 0.4321 s.
fn crossing_in_a_step(system: System) -> Simulation {
    let event = EventSource::Crossing(system.port("p.z").unwrap());
    let algorithm = Algorithm { events: vec![event], ..Algorithm::new(0.5) };
    Simulation::new(system, &algorithm, &until(0.5)).unwrap()
}

/// The whole step does not end early; the first repeated one, to a time before the crossing, does.
#[test]
fn a_step_that_ends_early_while_a_crossing_is_located_is_the_step() {
    let (system, _) = system([f64::sin, crosses], |begin, end| early(begin, end, false));
    let times = times(&mut crossing_in_a_step(system));
    assert_eq!(times.len(), 3, "{times:?}");
    for (time, expected) in times.iter().zip([0.25, 0.4321, 0.5]) {
        assert!((time - expected).abs() <= 0.5e-9, "{times:?}");
    }
}

#[test]
fn a_slave_that_requests_the_end_while_a_crossing_is_located_ends_the_run_of_all_there() {
    let (mut system, _) = system([f64::sin, crosses], |begin, end| early(begin, end, true));
    add_clock(&mut system, "q", whole);
    let mut simulation = crossing_in_a_step(system);
    simulation.step().unwrap();
    assert_eq!((simulation.ended_by(), simulation.ended_at()), (Some("p"), Some(0.25)));
    let ports = [simulation.system().port("q.y").unwrap()];
    let mut readout = Readout::new(simulation.system(), &ports);
    readout.read(simulation.system(), 0.25).unwrap();
    assert_eq!((simulation.time(), readout.reals), (0.25, vec![0.25]));
}

/// The lag after a jump to 1 at 0.5 s is `1 - exp(-(t - 0.5))`, whether 0.5 s is a grid point or
/// not.
///
/// A line through the values before and after the jump would continue to 2.
#[test]
fn after_an_event_inputs_are_not_extrapolated_from_values_before_it() {
    let step = |time: f64| if time > 0.5 - 1e-9 { 1.0 } else { 0.0 };
    let next = |time: f64| if time > 0.5 - 1e-9 { f64::INFINITY } else { 0.5 };
    for extrapolation in [
        Extrapolation::Hold,
        Extrapolation::Limited,
        Extrapolation::Linear,
        Extrapolation::Quadratic,
    ] {
        for size in [0.1, 0.08] {
            let (system, _) = system([step, next], whole);
            let event = EventSource::NextTime(system.port("p.z").unwrap());
            let algorithm = Algorithm {
                events: vec![event],
                ..Algorithm::fixed(Method::Jacobi, extrapolation, size)
            };
            let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
            times(&mut simulation);
            let mut value = [0.0];
            let lag = &mut simulation.system().slaves[1].1;
            lag.get_real(&[OUTPUTS], &mut value).unwrap();
            let expected = 1.0 - f64::exp(-0.5);
            assert!(
                (value[0] - expected).abs() < 1e-12,
                "{} {size}: {value:?}",
                extrapolation.name()
            );
        }
    }
}
