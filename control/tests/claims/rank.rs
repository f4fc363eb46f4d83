use crate::paper::plant;
use crate::{integers, matrix};
use control::rank::{controllability, observability};
use nalgebra::DMatrix;

#[test]
fn the_pendulum_is_controllable_and_its_augmented_pair_observable() {
    let plant = plant();
    assert!(controllability(&plant.a, &plant.b).unwrap().is_full());
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    let found = observability(&a_0, &c_0).unwrap();
    assert_eq!((found.rank, found.n), (5, 5));
    assert!(found.margin > 1e6 * found.tolerance);
}

/// The position of a cart does not follow from its velocity.
#[test]
fn velocities_alone_do_not_show_the_position() {
    let velocities = matrix(2, 4, &[0., 0., 1., 0., 0., 0., 0., 1.]);
    assert_eq!(observability(&plant().a, &velocities).unwrap().rank, 3);
}

/// Three controllable states and two that nothing reaches, hidden by a change of coordinates with
/// determinant one.
#[test]
fn the_controllable_part_is_counted_in_any_coordinates() {
    let mut a = integers(5, 5, |i, j| (3 * i * i + 2 * i * j + j) % 7 - 3);
    a.view_mut((3, 0), (2, 3)).fill(0.0);
    let b = matrix(5, 1, &[0., 1., 0., 0., 0.]);
    assert_eq!(controllability(&a, &b).unwrap().rank, 3);
    let lower = DMatrix::from_fn(5, 5, |i, j| if i >= j { 1.0 } else { 0.0 });
    let inverse = lower.clone().try_inverse().unwrap();
    let turned = controllability(&(&lower * &a * &inverse), &(&lower * b)).unwrap();
    assert_eq!(turned.rank, 3);
}

#[test]
fn units_do_not_decide_the_rank() {
    let plant = plant();
    let units = [1.0, 1e9, 1e-6, 1e12];
    let a = DMatrix::from_fn(4, 4, |i, j| plant.a[(i, j)] * units[i] / units[j]);
    let b = DMatrix::from_fn(4, 1, |i, _| plant.b[i] * units[i] * 1e-20);
    assert!(controllability(&a, &b).unwrap().is_full());
}

/// A chain of fifteen integrators: its controllability matrix is a permutation.
#[test]
fn a_long_chain_is_controllable_from_its_end_only() {
    let chain = DMatrix::from_fn(15, 15, |i, j| if j == i + 1 { 1.0 } else { 0.0 });
    let at = |row: usize| DMatrix::from_fn(15, 1, |i, _| if i == row { 1.0 } else { 0.0 });
    assert_eq!(controllability(&chain, &at(14)).unwrap().rank, 15);
    assert_eq!(controllability(&chain, &at(6)).unwrap().rank, 7);
}

#[test]
fn without_an_effective_input_nothing_is_reached() {
    let found = controllability(&DMatrix::identity(3, 3), &DMatrix::zeros(3, 2)).unwrap();
    assert_eq!((found.rank, found.margin.to_bits()), (0, 0));
}
