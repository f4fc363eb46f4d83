//! The last step of a run: an FMU may refuse a step that ends an ulp beyond its stop time.

use fmu_description::Experiment;
use master::algorithm::EventSource;
use master::{Algorithm, Coupling, Extrapolation, Method, Simulation, StepControl, System};

use crate::engine::puppet::{Asked, rigid, system, whole};
use crate::engine::until;

/// Steps and stop times in s. If each step starts at a multiple of the step and has full size, the
/// last one ends an ulp or more beyond the stop time.
const BEYOND: [(f64, f64); 4] = [(0.01, 20.0), (0.1, 1.1), (0.7, 4.9), (0.003, 0.3)];

fn algorithms(step: f64, system: &System) -> Vec<(&'static str, Algorithm)> {
    let event = EventSource::NextTime(system.port("p.z").unwrap());
    let base = Algorithm::new(step);
    let largest_step = step;
    vec![
        ("plain", Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, step)),
        ("gauss-seidel", base.clone()),
        ("multiple", Algorithm { multiples: vec![3, 1], ..base.clone() }),
        ("both multiples", Algorithm { multiples: vec![2, 2], ..base.clone() }),
        ("iterated", Algorithm { coupling: Coupling::Newton, ..base.clone() }),
        ("rollback", Algorithm { rollback: true, ..base.clone() }),
        ("doubling", Algorithm { control: StepControl::Doubling, largest_step, ..base.clone() }),
        ("embedded", Algorithm { control: StepControl::Embedded, largest_step, ..base.clone() }),
        ("events", Algorithm { events: vec![event], ..base }),
    ]
}

/// Every requested step ends at the stop time or before; the last one ends at the stop time.
fn check(label: &str, simulation: &Simulation, asked: &Asked, stop: f64) {
    assert_eq!(simulation.time(), stop, "{label}");
    let asked = asked.lock().unwrap();
    for (begin, end) in asked.iter() {
        assert!(*end <= stop, "{label}: {begin} to {end} s");
    }
    assert_eq!(asked.last().unwrap().1, stop, "{label}");
}

/// An output that announces an event every 0.37 s.
fn every(time: f64) -> f64 {
    ((time / 0.37 + 1e-9).floor() + 1.0) * 0.37
}

#[test]
fn no_step_ends_an_ulp_beyond_the_stop_time_with_any_algorithm() {
    for (step, stop) in BEYOND {
        let new = || system([f64::sin, every], whole);
        for (name, algorithm) in algorithms(step, &new().0) {
            let (system, asked) = new();
            let mut simulation = Simulation::new(system, &algorithm, &until(stop)).unwrap();
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            check(&format!("{name} {step}"), &simulation, &asked, stop);
        }
    }
}

#[test]
fn no_fmu_is_asked_for_a_step_after_the_end() {
    let new = || system([f64::sin, every], whole);
    for (name, algorithm) in algorithms(0.1, &new().0) {
        let (system, asked) = new();
        let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap();
        }
        let count = asked.lock().unwrap().len();
        simulation.step().unwrap();
        assert_eq!((simulation.time(), asked.lock().unwrap().len()), (1.0, count), "{name}");
    }
}

#[test]
fn no_step_of_a_resumed_run_ends_an_ulp_beyond_the_stop_time() {
    for (step, stop) in BEYOND {
        let new = || system([f64::sin, every], whole);
        for (name, algorithm) in algorithms(step, &new().0) {
            let mut first = Simulation::new(new().0, &algorithm, &until(stop)).unwrap();
            for _ in 0..4 {
                first.step().unwrap();
            }
            let checkpoint = first.checkpoint().unwrap();
            let (system, asked) = new();
            let none = master::Scenario::default();
            let resumed = Simulation::resume(system, &algorithm, &until(stop), none, &checkpoint);
            let mut simulation = resumed.unwrap();
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            check(&format!("{name} {step}"), &simulation, &asked, stop);
        }
    }
}

/// Times of a run of p, which takes equal steps only, and a; sizes of the steps of p.
fn equal_steps(step: f64, multiples: &[u32], stop: f64) -> (Simulation, Vec<f64>, Vec<f64>) {
    let (system, asked) = rigid(system([f64::sin; 2], whole));
    let algorithm = Algorithm { multiples: multiples.to_vec(), ..Algorithm::new(step) };
    let mut simulation = Simulation::new(system, &algorithm, &until(stop)).unwrap();
    let mut times = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        times.push(simulation.time());
    }
    let sizes = asked.lock().unwrap().iter().map(|(begin, end)| end - begin).collect();
    (simulation, times, sizes)
}

#[test]
fn if_an_fmu_takes_equal_steps_only_the_run_ends_with_its_last_whole_step_and_says_so() {
    let (simulation, times, sizes) = equal_steps(0.25, &[], 1.125);
    assert_eq!((times, sizes), (vec![0.25, 0.5, 0.75, 1.0], vec![0.25; 4]));
    let early = simulation.early_end().unwrap().to_string();
    for part in ["p takes equal steps only", "stop time 1.125 s", "step 0.25 s", "t = 1 s"] {
        assert!(early.contains(part), "{early}");
    }
    let (simulation, times, _) = equal_steps(0.25, &[], 1.0);
    assert_eq!((times.len(), simulation.early_end()), (4, None));
    let (simulation, times, _) = equal_steps(2.0, &[], 1.0);
    assert!(times.is_empty() && simulation.time() == 0.0 && simulation.early_end().is_some());
}

/// 1.25 s is 5 steps of the grid, but no whole number of steps of a slave that makes 2 at once.
#[test]
fn equal_steps_of_a_slave_with_a_multiple_are_whole_multiples() {
    let (simulation, times, sizes) = equal_steps(0.25, &[2, 1], 1.25);
    assert_eq!((times.last(), sizes), (Some(&1.0), vec![0.5; 2]));
    assert_eq!(simulation.early_end().unwrap().step, 0.5);
    let (simulation, times, sizes) = equal_steps(0.25, &[2, 1], 1.5);
    assert_eq!((times.last(), sizes), (Some(&1.5), vec![0.5; 3]));
    assert_eq!(simulation.early_end(), None);
    // The slave that can vary its step makes a shorter one.
    let (simulation, times, sizes) = equal_steps(0.25, &[1, 2], 1.25);
    assert_eq!((times.last(), sizes.len()), (Some(&1.25), 5));
    assert_eq!(simulation.early_end(), None);
}

/// In seconds since 1970 the stop time is rounded by 1e-7 s, a part of 1e-5 of the step.
#[test]
fn rounding_of_the_stop_time_takes_no_step_from_equal_steps() {
    let (system, asked) = rigid(system([f64::sin; 2], whole));
    let (start_time, stop) = (1.7e9, 1_700_000_000.1);
    let experiment = Experiment { start_time, ..until(stop) };
    let mut simulation = Simulation::new(system, &Algorithm::new(0.01), &experiment).unwrap();
    assert_eq!(simulation.early_end(), None);
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    assert_eq!((simulation.time(), asked.lock().unwrap().len()), (stop, 10));
}
