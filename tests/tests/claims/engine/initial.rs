//! Algebraic loops in initialization mode.

use std::sync::Arc;

use master::{Algorithm, Simulation};
use tests::linear::{ABLE, Block};
use tests::network::Network;
use tests::problems;

use crate::engine::until;

/// `y_a = 1 - 2 y_b`, `y_b = -0.5 + 1.5 y_a` have the solution `y_a = 0.5`, `y_b = 0.25`.
/// Fixed-point iteration diverges.
#[test]
fn an_algebraic_loop_starts_at_its_solution() {
    let network = problems::algebraic_loop(-2.0, 1.5);
    let system = network.system(ABLE, &Arc::default());
    let mut simulation = Simulation::new(system, &Algorithm::new(0.1), &until(1.0)).unwrap();
    let outputs = network.outputs(simulation.system());
    assert!((outputs[0] - 0.5).abs() < 1e-9 && (outputs[1] - 0.25).abs() < 1e-9, "{outputs:?}");
}

/// Two loops in sequence: `y_a = 3 - y_b`, `y_b = 2 y_a` give 1 and 2; then `y_c = y_b - y_d` and
/// `y_d = 3 y_c` give 0.5 and 1.5.
#[test]
fn loops_in_sequence_are_solved_in_their_order() {
    let scale = |gain: f64, offset: f64, inputs: usize| {
        let (held, row) = (vec![0.0; inputs], [-gain, 1.0]);
        Block::new(&[&[0.0]], &[&held], &[&[1.0]], &[&row[..inputs]], &[offset])
    };
    let network = Network {
        blocks: vec![
            scale(3.0, 0.0, 1),
            scale(1.0, 0.0, 2),
            scale(1.0, 3.0, 1),
            scale(2.0, 0.0, 1),
        ],
        links: vec![
            ((2, 0), (3, 0)),
            ((3, 0), (2, 0)),
            ((1, 0), (0, 0)),
            ((0, 0), (1, 0)),
            ((3, 0), (1, 1)),
        ],
    };
    // With the negative gain: c = 3 - d, d = -2 c; a = -3 b, b = d - a.
    let system = network.system(ABLE, &Arc::default());
    let mut simulation = Simulation::new(system, &Algorithm::new(0.1), &until(1.0)).unwrap();
    let [a, b, c, d] = network.outputs(simulation.system())[..] else { unreachable!() };
    assert!((c - -3.0).abs() < 1e-8 && (d - 6.0).abs() < 1e-8, "{c} {d}");
    assert!((b - -3.0).abs() < 1e-8 && (a - 9.0).abs() < 1e-8, "{a} {b}");
}

#[test]
fn a_singular_loop_is_refused_with_the_names_of_its_outputs() {
    let network = problems::algebraic_loop(2.0, 0.5);
    let system = network.system(ABLE, &Arc::default());
    let error = Simulation::new(system, &Algorithm::new(0.1), &until(1.0)).err().unwrap();
    let message = error.to_string();
    let expected = "the loop through a.y0, b.y0 at t = 0 s: it has no solution or many: its matrix \
                    is singular (condition ";
    assert!(message.starts_with(expected), "{message}");
}

/// `y_a = NaN - 2 y_b`: both outputs are NaN.
#[test]
fn a_loop_of_values_that_are_nan_is_refused_unless_that_is_allowed() {
    let mut network = problems::algebraic_loop(-2.0, 1.5);
    network.blocks[0].start.fill(f64::NAN);
    let system = network.system(ABLE, &Arc::default());
    let error = Simulation::new(system, &Algorithm::new(0.1), &until(1.0)).err().unwrap();
    assert!(error.to_string().starts_with("the loop through a.y0, b.y0 at t = 0 s: "), "{error}");
    let system = network.system(ABLE, &Arc::default());
    let algorithm = Algorithm { allow_nan: true, ..Algorithm::new(0.1) };
    let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
    let outputs = network.outputs(simulation.system());
    assert!(outputs.iter().all(|output| output.is_nan()), "{outputs:?}");
}
