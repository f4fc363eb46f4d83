//! Time, memory and threads.

use std::sync::Arc;

use master::{Algorithm, Coupling, Extrapolation, Method, Simulation};
use tests::linear::ABLE;
use tests::problems;

use crate::engine::{typed, until};

const ALL: [Extrapolation; 4] =
    [Extrapolation::Hold, Extrapolation::Limited, Extrapolation::Linear, Extrapolation::Quadratic];

#[test]
fn time_is_the_start_plus_a_multiple_of_the_step_to_the_bit() {
    for coupling in [Coupling::Once, Coupling::Newton] {
        let network = problems::coupled_oscillators();
        let experiment = fmu_description::Experiment {
            start_time: 0.3,
            ..fmu_description::Experiment::default()
        };
        let algorithm = Algorithm { coupling, ..Algorithm::new(0.001) };
        let system = network.system(ABLE, &Arc::default());
        let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
        let mut sum = 0.3;
        for k in 1..=2000 {
            simulation.step().unwrap();
            sum += 0.001;
            assert_eq!(simulation.time().to_bits(), (0.3 + f64::from(k) * 0.001).to_bits());
        }
        assert!(sum != simulation.time(), "a running sum would have been another time");
    }
}

#[test]
fn stepping_allocates_nothing_with_variables_of_all_types() {
    for sweep in [Method::Jacobi, Method::GaussSeidel] {
        for extrapolation in ALL {
            for multiples in [vec![], vec![1, 2, 4]] {
                let algorithm =
                    Algorithm { multiples, ..Algorithm::fixed(sweep, extrapolation, 0.25) };
                let mut simulation =
                    Simulation::new(typed::ring(), &algorithm, &until(1e3)).unwrap();
                // The Strings of the exchange are allocated in the first steps.
                for _ in 0..8 {
                    simulation.step().unwrap();
                }
                let counted = allocation_counter::measure(|| {
                    for _ in 0..100 {
                        simulation.step().unwrap();
                    }
                });
                let label = format!("{} {}", sweep.name(), extrapolation.name());
                assert_eq!(counted.count_total, 0, "{label}");
            }
        }
    }
}

/// 50 steps, because the first 32 find out which way is faster: 16 without threads, 16 with them.
#[test]
fn threads_change_no_bit() {
    let network = problems::coupled_oscillators();
    for sweep in [Method::Jacobi, Method::GaussSeidel] {
        for extrapolation in ALL {
            let run = |jobs: usize| {
                let algorithm = Algorithm { jobs, ..Algorithm::fixed(sweep, extrapolation, 0.05) };
                let system = network.system(ABLE, &Arc::default());
                let mut simulation = Simulation::new(system, &algorithm, &until(2.5)).unwrap();
                let mut all = Vec::new();
                while !simulation.is_finished() {
                    simulation.step().unwrap();
                    all.extend(network.outputs(simulation.system()).iter().map(|y| y.to_bits()));
                }
                all
            };
            assert_eq!(run(1), run(2), "{} {}", sweep.name(), extrapolation.name());
        }
    }
}
