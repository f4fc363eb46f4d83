//! The order of convergence of every method, against the matrix exponential of the whole system.
//!
//! `cargo test --release -p tests --test claims order -- --nocapture` prints the tables.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "tests; the tables are printed")]

use master::{Algorithm, Coupling, Extrapolation, Method, SystemError};
use tests::linear::{ABLE, Abilities};
use tests::network::Network;
use tests::problems;

const STOP: f64 = 4.0;
/// Communication steps of each run.
const STEPS: [u32; 5] = [64, 128, 256, 512, 1024];
const HELD: Abilities = Abilities { interpolates: false, ..ABLE };
const PAST: Abilities = Abilities { derivatives: 0, ..ABLE };
const SLOPES: Abilities = Abilities { derivatives: 1, ..ABLE };
const SWEEPS: [Method; 2] = [Method::Jacobi, Method::GaussSeidel];
const COUPLINGS: [Coupling; 3] = [Coupling::Newton, Coupling::Anderson, Coupling::QuasiNewton];

fn iterated(coupling: Coupling, sweep: Method, extrapolation: Extrapolation) -> Algorithm {
    Algorithm {
        coupling,
        relative_tolerance: 1e-11,
        absolute_tolerance: 1e-11,
        ..Algorithm::fixed(sweep, extrapolation, 1.0)
    }
}

/// Prints the errors of `algorithm` for all steps; returns the observed order of the two smallest
/// steps.
fn observed(label: &str, network: &Network, able: Abilities, algorithm: &Algorithm) -> f64 {
    let errors = STEPS.map(|steps| {
        let step = STOP / f64::from(steps);
        network.run(able, &Algorithm { step, ..algorithm.clone() }, STOP).unwrap().late
    });
    let order = (errors[3] / errors[4]).log2();
    let columns: Vec<_> = errors.iter().map(|error| format!("{error:.2e}")).collect();
    println!("| {label} | {} | {order:.2} |", columns.join(" | "));
    order
}

fn head(problem: &str) {
    let columns: Vec<_> =
        STEPS.iter().map(|&steps| format!("H = {} s", STOP / f64::from(steps))).collect();
    println!("\n{problem}\n\n| method | {} | order |", columns.join(" | "));
    println!("|---|{}---|", "---|".repeat(STEPS.len()));
}

/// Both problems: name and network.
fn both() -> [(&'static str, Network); 2] {
    [
        ("Two coupled oscillators", problems::coupled_oscillators()),
        ("Two masses, force and displacement", problems::two_masses(20.0, 0.5)),
    ]
}

/// Checks that the order of `algorithm` is `expected`.
fn check(network: &Network, able: Abilities, algorithm: &Algorithm, expected: f64) {
    let mut label = format!("{} {}", algorithm.method.name(), algorithm.extrapolation.name());
    if algorithm.coupling != Coupling::Once {
        label = format!("{} {label}", algorithm.coupling.name());
    }
    let order = observed(&label, network, able, algorithm);
    assert!((order - expected).abs() < 0.25, "{label}: {order}");
}

/// Every order of stepping with every extrapolation, and the expected order, on both problems.
fn verify(what: &str, able: Abilities, courses: &[(Extrapolation, f64)]) {
    for (problem, network) in both() {
        head(&format!("{problem}; {what}"));
        for sweep in SWEEPS {
            for &(extrapolation, expected) in courses {
                check(&network, able, &Algorithm::fixed(sweep, extrapolation, 1.0), expected);
            }
        }
    }
}

#[test]
fn with_all_derivatives_hold_is_of_order_1_lines_of_2_parabolas_of_3() {
    let courses = [
        (Extrapolation::Hold, 1.0),
        (Extrapolation::Limited, 2.0),
        (Extrapolation::Linear, 2.0),
        (Extrapolation::Quadratic, 3.0),
    ];
    verify("input derivatives, output derivatives of order 2", ABLE, &courses);
}

#[test]
fn with_first_derivatives_only_parabolas_are_of_order_3() {
    verify(
        "input derivatives, output derivatives of order 1",
        SLOPES,
        &[(Extrapolation::Quadratic, 3.0)],
    );
}

/// The first step has no past values and holds its inputs, so a parabola does not reach order 3.
#[test]
fn past_values_instead_of_output_derivatives_give_order_2() {
    let courses = [(Extrapolation::Limited, 2.0), (Extrapolation::Linear, 2.0)];
    verify("input derivatives, no output derivatives", PAST, &courses);
    for (problem, network) in both() {
        head(&format!("{problem}; input derivatives, no output derivatives"));
        for sweep in SWEEPS {
            let label = format!("{} quadratic", sweep.name());
            let algorithm = Algorithm::fixed(sweep, Extrapolation::Quadratic, 1.0);
            assert!(observed(&label, &network, PAST, &algorithm) > 1.75, "{problem}, {label}");
        }
    }
}

#[test]
fn slaves_that_hold_their_inputs_get_the_mean_over_the_step_which_is_of_order_2() {
    let courses =
        [(Extrapolation::Hold, 1.0), (Extrapolation::Linear, 2.0), (Extrapolation::Quadratic, 2.0)];
    let network = problems::coupled_oscillators();
    head("Two coupled oscillators; no input derivatives, output derivatives of order 2");
    for sweep in SWEEPS {
        for (extrapolation, expected) in courses {
            check(&network, HELD, &Algorithm::fixed(sweep, extrapolation, 1.0), expected);
        }
    }
}

/// The force at the end of a step is computed from the mean displacement, not from that at the end.
#[test]
fn slaves_that_hold_their_inputs_and_depend_on_them_directly_are_of_order_1() {
    let network = problems::two_masses(20.0, 0.5);
    head("Two masses, force and displacement; no input derivatives, output derivatives of order 2");
    for sweep in SWEEPS {
        for extrapolation in [
            Extrapolation::Hold,
            Extrapolation::Limited,
            Extrapolation::Linear,
            Extrapolation::Quadratic,
        ] {
            check(&network, HELD, &Algorithm::fixed(sweep, extrapolation, 1.0), 1.0);
        }
    }
}

#[test]
fn slaves_with_multiples_of_the_step_keep_the_order() {
    for (problem, network) in both() {
        head(&format!("{problem}; the second slave steps every 4 H"));
        for sweep in SWEEPS {
            for (extrapolation, expected) in
                [(Extrapolation::Linear, 2.0), (Extrapolation::Quadratic, 3.0)]
            {
                let multiples = vec![1, 4];
                let algorithm =
                    Algorithm { multiples, ..Algorithm::fixed(sweep, extrapolation, 1.0) };
                check(&network, ABLE, &algorithm, expected);
            }
        }
    }
}

/// Rows between the ends of a slave's own steps have values on the line between these ends, which
/// is of order 2. A slave that steps first is also read within its step and not at its end.
#[test]
fn a_slave_with_a_multiple_of_the_step_is_read_at_the_time_of_its_reader() {
    for (problem, network) in both() {
        for sweep in SWEEPS {
            for multiples in [vec![1, 4], vec![4, 1]] {
                for (extrapolation, expected) in
                    [(Extrapolation::Hold, 1.0), (Extrapolation::Linear, 2.0)]
                {
                    let errors = [1.0 / 512.0, 1.0 / 1024.0].map(|step| {
                        let multiples = multiples.clone();
                        let algorithm =
                            Algorithm { multiples, ..Algorithm::fixed(sweep, extrapolation, step) };
                        network.run(ABLE, &algorithm, STOP).unwrap().between
                    });
                    let order = (errors[0] / errors[1]).log2();
                    let label = format!("{problem}, {} {}", sweep.name(), extrapolation.name());
                    println!("{label} {multiples:?}: {errors:?}, order {order:.2}");
                    assert!((order - expected).abs() < 0.25, "{label} {multiples:?}: {order}");
                }
            }
        }
    }
}

#[test]
fn iterated_coupling_has_the_order_of_its_extrapolation() {
    for (problem, network) in both() {
        head(&format!("{problem}; iterated"));
        for coupling in COUPLINGS {
            for sweep in SWEEPS {
                for (extrapolation, expected) in [
                    (Extrapolation::Hold, 1.0),
                    (Extrapolation::Linear, 2.0),
                    (Extrapolation::Quadratic, 3.0),
                ] {
                    check(&network, ABLE, &iterated(coupling, sweep, extrapolation), expected);
                }
            }
        }
    }
}

/// A coupling so stiff that its own frequency w gives `w H = 2.2`.
#[test]
fn iterated_coupling_is_stable_where_explicit_coupling_is_not() {
    for sweep in SWEEPS {
        stable(&problems::two_masses(1e3, 1.0), sweep, Extrapolation::Linear);
    }
}

fn stable(network: &Network, sweep: Method, extrapolation: Extrapolation) {
    let step = 0.05;
    let explicit = network.run(ABLE, &Algorithm::fixed(sweep, extrapolation, step), STOP);
    assert!(explicit.map_or(true, |run| run.late > 1e6));
    for coupling in COUPLINGS {
        for directional in [true, false] {
            let able = Abilities { directional, ..ABLE };
            let algorithm = Algorithm { step, ..iterated(coupling, sweep, extrapolation) };
            let run = network.run(able, &algorithm, STOP).unwrap();
            let label = format!("{} {} {}", coupling.name(), sweep.name(), extrapolation.name());
            println!("{label}: error {:.2e}, {} calls", run.late, run.calls);
            // At the start the force is 1 kN.
            assert!(run.late < 1e3, "{label}: {run:?}");
        }
    }
}

#[test]
fn an_algebraic_loop_with_gain_beyond_1_is_solved_by_iteration_only() {
    let network = problems::algebraic_loop(-2.0, 1.5);
    let explicit =
        network.run(ABLE, &Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.01), STOP);
    assert!(explicit.map_or(true, |run| run.error > 1e6));
    for coupling in COUPLINGS {
        head(&format!("Algebraic loop of gain -3; {}", coupling.name()));
        let algorithm = iterated(coupling, Method::Jacobi, Extrapolation::Linear);
        let order = observed("jacobi linear", &network, ABLE, &algorithm);
        assert!((order - 2.0).abs() < 0.25, "{}: {order}", coupling.name());
    }
}

#[test]
fn a_loop_of_gain_1_has_no_solution_and_is_refused_with_the_names_of_its_outputs() {
    let network = problems::algebraic_loop(2.0, 0.5);
    let algorithm = iterated(Coupling::Newton, Method::Jacobi, Extrapolation::Linear);
    let calls = std::sync::Arc::default();
    let refused = master::Simulation::new(
        network.system(ABLE, &calls),
        &algorithm,
        &fmu_description::Experiment::default(),
    );
    let error = refused.err().unwrap();
    assert!(matches!(error, SystemError::Loop { .. }));
    let message = error.to_string();
    assert!(message.starts_with("the loop through a.y0, b.y0 at t = 0 s"), "{message}");
    assert!(message.contains("singular"), "{message}");
}
