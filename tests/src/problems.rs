//! The test problems; all numbers are our choice, in SI units.

use crate::linear::Block;
use crate::network::Network;

/// Two oscillators, each of 1 kg on a spring and a damper to a wall, with a spring of 2 N/m between
/// them. Each gets the displacement of the other: there is no direct dependency.
#[must_use]
pub fn coupled_oscillators() -> Network {
    let oscillator = |stiffness: f64, damping: f64, start: &[f64]| {
        Block::new(
            &[&[0.0, 1.0], &[-stiffness - 2.0, -damping]],
            &[&[0.0], &[2.0]],
            &[&[1.0, 0.0]],
            &[&[0.0]],
            start,
        )
    };
    Network {
        blocks: vec![oscillator(1.0, 0.1, &[1.0, 0.0]), oscillator(3.0, 0.2, &[0.0, 0.5])],
        links: vec![((0, 0), (1, 0)), ((1, 0), (0, 0))],
    }
}

/// The linear two-mass oscillator, coupled by force and displacement, with the given stiffness in
/// N/m and damping in N s/m of the coupling.
///
/// Spring and damper of the coupling belong to the block of the second mass. This block gets displacement and velocity
/// of the first mass, on which its output, the force on the first mass, depends directly.
#[must_use]
pub fn two_masses(stiffness: f64, damping: f64) -> Network {
    let first = Block::new(
        &[&[0.0, 1.0], &[-10.0, -0.1]],
        &[&[0.0], &[1.0]],
        &[&[1.0, 0.0], &[0.0, 1.0]],
        &[&[0.0], &[0.0]],
        &[1.0, 0.0],
    );
    let second = Block::new(
        &[&[0.0, 1.0], &[-(10.0 + stiffness), -(0.1 + damping)]],
        &[&[0.0, 0.0], &[stiffness, damping]],
        &[&[stiffness, damping]],
        &[&[-stiffness, -damping]],
        &[0.0, 0.0],
    );
    Network {
        blocks: vec![first, second],
        links: vec![((0, 0), (1, 0)), ((0, 1), (1, 1)), ((1, 0), (0, 0))],
    }
}

/// Two first-order lags with direct feedthrough, `y = x + g u`, each with the output of the other as input. The
/// algebraic loop has the gain `g1 g2`.
#[must_use]
pub fn algebraic_loop(first: f64, second: f64) -> Network {
    let lag = |rate: f64, gain: f64, start: f64| {
        Block::new(&[&[-rate]], &[&[0.5]], &[&[1.0]], &[&[gain]], &[start])
    };
    Network {
        blocks: vec![lag(1.0, first, 1.0), lag(2.0, second, -0.5)],
        links: vec![((0, 0), (1, 0)), ((1, 0), (0, 0))],
    }
}

/// A fast lag (10 ms, initial value 1) in a loop with a slow oscillator: a short transient, then a smooth solution.
#[must_use]
pub fn transient() -> Network {
    let fast = Block::new(&[&[-100.0]], &[&[100.0]], &[&[1.0]], &[&[0.0]], &[1.0]);
    let slow = Block::new(
        &[&[0.0, 1.0], &[-1.0, -0.2]],
        &[&[0.0], &[0.5]],
        &[&[1.0, 0.0]],
        &[&[0.0]],
        &[0.0, 0.5],
    );
    Network { blocks: vec![fast, slow], links: vec![((0, 0), (1, 0)), ((1, 0), (0, 0))] }
}
