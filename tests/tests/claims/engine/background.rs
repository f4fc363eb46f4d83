//! Slaves in the background: their steps overlap; results and errors stay the same.

use std::sync::Arc;

use master::{Algorithm, Coupling, Extrapolation, Method, Simulation, StepControl, System};

use crate::engine::ahead::{Fails, ahead};
use crate::engine::parts::stops;
use crate::engine::{puppet, typed, until};
use tests::linear::ABLE;
use tests::problems;

#[expect(clippy::unnecessary_wraps, reason = "the form of a choice")]
fn all(_: &str) -> Option<Fails> {
    Some(Fails::Nowhere)
}

fn none(_: &str) -> Option<Fails> {
    None
}

fn jacobi(jobs: usize) -> Algorithm {
    Algorithm { jobs, ..Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.25) }
}

/// Slaves a, b and c in a circle, connected by Reals only.
fn reals() -> System {
    let mut system = typed::ring();
    let to_reals = |port: master::Port| port.variable < 2;
    let connections: Vec<_> =
        system.connections.iter().filter(|connection| to_reals(connection.from)).cloned().collect();
    assert_eq!(connections.len(), 3);
    system.connections = connections;
    system
}

#[test]
fn all_slaves_of_a_group_start_before_the_first_is_finished() {
    for (system, jobs) in
        [(reals as fn() -> System, 1), (typed::ring, 1), (reals, 2), (typed::ring, 2)]
    {
        let (system, record) = ahead(system(), all);
        let mut simulation = Simulation::new(system, &jacobi(jobs), &until(100.0)).unwrap();
        // The master uses the first 32 steps to find out whether threads are faster: first without,
        // then with threads.
        for _ in 0..40 {
            simulation.step().unwrap();
            let actual = std::mem::take(&mut *record.lock().unwrap());
            assert_eq!(
                actual,
                ["begin a", "begin b", "begin c", "finish a", "finish b", "finish c"]
            );
        }
    }
}

#[test]
fn gauss_seidel_does_not_start_connected_slaves_together() {
    let algorithm = Algorithm { method: Method::GaussSeidel, ..jacobi(1) };
    let (system, record) = ahead(typed::ring(), all);
    Simulation::new(system, &algorithm, &until(1.0)).unwrap().step().unwrap();
    let actual = record.lock().unwrap().join(", ");
    let pairs = ["begin a, finish a", "begin b, finish b", "begin c, finish c"];
    assert!(pairs.iter().all(|pair| actual.contains(pair)), "{actual}");
}

/// The bits of all connected outputs after each step.
fn trajectory(algorithm: &Algorithm, fails: fn(&str) -> Option<Fails>) -> Vec<u64> {
    let network = problems::coupled_oscillators();
    let (system, _) = ahead(network.system(ABLE, &Arc::default()), fails);
    let mut simulation = Simulation::new(system, algorithm, &until(2.5)).unwrap();
    let mut bits = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        bits.extend(network.outputs(simulation.system()).iter().map(|y| y.to_bits()));
        bits.push(simulation.time().to_bits());
    }
    bits
}

#[test]
fn stepping_in_the_background_changes_no_bit() {
    let first: fn(&str) -> Option<Fails> = |name| (name == "a").then_some(Fails::Nowhere);
    assert!(!trajectory(&Algorithm::new(0.05), first).is_empty());
    for sweep in [Method::Jacobi, Method::GaussSeidel] {
        for course_of_inputs in [
            Extrapolation::Hold,
            Extrapolation::Limited,
            Extrapolation::Linear,
            Extrapolation::Quadratic,
        ] {
            let fixed = Algorithm::fixed(sweep, course_of_inputs, 0.05);
            for algorithm in [
                fixed.clone(),
                Algorithm { jobs: 2, ..fixed.clone() },
                Algorithm { control: StepControl::Doubling, ..fixed.clone() },
                Algorithm { coupling: Coupling::Newton, ..fixed },
            ] {
                let expected = trajectory(&algorithm, none);
                assert!(expected.len() > 20);
                assert_eq!(trajectory(&algorithm, all), expected, "{algorithm:?}");
                assert_eq!(trajectory(&algorithm, first), expected, "{algorithm:?}");
            }
        }
    }
}

#[test]
fn values_of_all_types_and_multiples_are_the_same_in_the_background() {
    for (multiples, extrapolation) in
        [(vec![], Extrapolation::Hold), (vec![1, 2, 4], Extrapolation::Linear)]
    {
        let run = |fails: fn(&str) -> Option<Fails>| {
            let algorithm = Algorithm { multiples: multiples.clone(), extrapolation, ..jacobi(1) };
            let (system, _) = ahead(typed::ring(), fails);
            let mut simulation = Simulation::new(system, &algorithm, &until(10.0)).unwrap();
            let mut actual = Vec::new();
            while !simulation.is_finished() {
                simulation.step().unwrap();
                for (_, slave) in &mut simulation.system().slaves {
                    let (mut real, mut integer, mut boolean) = ([0.0], [0], [0]);
                    slave.get_real(&[1], &mut real).unwrap();
                    slave.get_integer(&[1], &mut integer).unwrap();
                    slave.get_boolean(&[1], &mut boolean).unwrap();
                    actual.push((real[0].to_bits(), integer, boolean));
                }
            }
            actual
        };
        assert_eq!(run(all), run(none));
        assert_eq!(run(all).len(), 120);
    }
}

#[test]
fn an_incomplete_step_is_continued_or_repeated_as_without_background() {
    for algorithm in [
        jacobi(1),
        Algorithm { extrapolation: Extrapolation::Linear, ..jacobi(1) },
        Algorithm { coupling: Coupling::Newton, ..Algorithm::new(0.25) },
        Algorithm { control: StepControl::Doubling, ..Algorithm::new(0.25) },
    ] {
        let run = |fails: fn(&str) -> Option<Fails>| {
            let (system, asked) = puppet::system([|time| 1.0 + time; 2], stops);
            let (system, _) = ahead(system, fails);
            let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
            while !simulation.is_finished() {
                simulation.step().unwrap();
            }
            asked.lock().unwrap().clone()
        };
        let expected = run(none);
        assert!(expected.iter().any(|step| step.0 == 0.35 || step.1 == 0.35), "{expected:?}");
        assert_eq!(run(all), expected);
    }
}

/// Returns the error of the step from 5 s, and the starts and ends of steps in it. If the run has
/// threads, this step uses them. Afterwards every slave still answers.
fn failed(jobs: usize, fails: fn(&str) -> Option<Fails>) -> (String, String) {
    let (system, record) = ahead(typed::ring(), fails);
    let mut simulation = Simulation::new(system, &jacobi(jobs), &until(10.0)).unwrap();
    for _ in 0..20 {
        simulation.step().unwrap();
    }
    record.lock().unwrap().clear();
    let message = simulation.step().unwrap_err().to_string();
    let calls = record.lock().unwrap().join(", ");
    for (_, slave) in &mut simulation.system().slaves {
        slave.get_real(&[1], &mut [0.0]).unwrap();
    }
    simulation.terminate().unwrap();
    (message, calls)
}

#[test]
fn the_reported_error_is_that_of_the_first_slave_in_order_wherever_it_fails() {
    use Fails::{InBegin, InFinish, InSet};
    let only_b = |fails: Fails| -> fn(&str) -> Option<Fails> {
        match fails {
            InFinish => |name| Some(if name == "b" { InFinish } else { Fails::Nowhere }),
            InBegin => |name| Some(if name == "b" { InBegin } else { Fails::Nowhere }),
            _ => |name| Some(if name == "b" { InSet } else { Fails::Nowhere }),
        }
    };
    for jobs in [1, 2] {
        for (fails, function, begun) in [
            (InFinish, "fmi2DoStep", "begin a, begin b, begin c, finish a, finish b"),
            (InBegin, "fmi2DoStep", "begin a, begin b, finish a"),
            (InSet, "fmi2SetInteger", "begin a, finish a"),
        ] {
            let (message, actual) = failed(jobs, only_b(fails));
            assert_eq!(message, format!("b at t = 5 s: {function} returned fmi2Error"));
            assert!(jobs > 1 || actual == begun, "{actual}");
        }
        let (message, _) = failed(jobs, |name| Some(if name == "a" { InFinish } else { InBegin }));
        assert_eq!(message, "a at t = 5 s: fmi2DoStep returned fmi2Error");
        let (message, _) = failed(jobs, |name| (name == "c").then_some(InFinish));
        assert_eq!(message, "c at t = 5 s: fmi2DoStep returned fmi2Error");
    }
}
