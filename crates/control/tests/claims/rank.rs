use crate::paper::plant;
use crate::{integers, matrix};
use control::rank::{controllability, observability, uncontrollable_modes, unobservable_modes};
use nalgebra::{Complex, DMatrix};

#[test]
fn the_pendulum_is_controllable_and_its_augmented_pair_observable() {
    let plant = plant();
    assert!(controllability(&plant.a, &plant.b).unwrap().is_full());
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    let actual = observability(&a_0, &c_0).unwrap();
    assert_eq!((actual.rank, actual.n), (5, 5));
    assert!(actual.margin > 1e6 * actual.tolerance);
}

/// The position of a cart does not follow from its velocity.
#[test]
fn velocities_alone_do_not_show_the_position() {
    let velocities = matrix(2, 4, &[0., 0., 1., 0., 0., 0., 0., 1.]);
    assert_eq!(observability(&plant().a, &velocities).unwrap().rank, 3);
}

/// Three controllable and two uncontrollable states, in other coordinates by a transformation with
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

/// The heading of a ship is the integral of its rate of turn, whatever its unit is. It acts on nothing. What may be a
/// rounding error of A is none of its effects.
#[test]
fn the_unit_of_a_state_that_acts_on_nothing_does_not_decide_the_rank() {
    let b = matrix(3, 1, &[0.108, -0.918, 0.]);
    for (unit, rank) in [(1e-17, 2), (1e-14, 3), (1e-12, 3), (1.0, 3), (1e18, 3), (0.0, 2)] {
        let a = matrix(3, 3, &[-0.895, -0.286, 0., -4.367, -0.918, 0., 0., unit, 0.]);
        assert_eq!(controllability(&a, &b).unwrap().rank, rank, "{unit:e}");
    }
}

/// A sampled oscillator with a fault that is a ramp; the fault adds to a command in any unit.
#[test]
fn the_unit_of_a_command_does_not_decide_whether_its_fault_is_observable() {
    let c = matrix(1, 4, &[1., 0., 0., 0.]);
    for (unit, rank) in [(1e-17, 2), (1e-14, 4), (1e-12, 4), (1.0, 4), (0.0, 2)] {
        let a = matrix(
            4,
            4,
            &[0.995, 0.097, 0., 0., -0.097, 0.937, unit, 0., 0., 0., 1., 0.1, 0., 0., 0., 1.],
        );
        assert_eq!(observability(&a, &c).unwrap().rank, rank, "{unit:e}");
    }
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
    let actual = controllability(&DMatrix::identity(3, 3), &DMatrix::zeros(3, 2)).unwrap();
    assert_eq!((actual.rank, actual.margin.to_bits()), (0, 0));
}

/// The input and output decoupling zeros of the example of `AB08ND` in SLICOT 5.
#[test]
fn the_modes_that_a_rank_lacks_are_those_of_slicot() {
    let (a, b, c) = crate::zeros::slicot();
    let modes = uncontrollable_modes(&a, &b).unwrap();
    assert_eq!((modes.len(), modes[0].dominant.clone()), (1, vec![3]));
    assert!((modes[0].eigenvalue + 4.0).norm() < 1e-13, "{modes:?}");
    let modes = unobservable_modes(&a, &c).unwrap();
    assert_eq!((modes.len(), modes[0].dominant.clone()), (1, vec![4]));
    assert!((modes[0].eigenvalue + 1.0).norm() < 1e-13, "{modes:?}");
}

/// Two cascades in other coordinates: each vector must satisfy A v = s v and C v = 0, by its
/// residual.
#[test]
fn the_vectors_of_unobservable_modes_are_eigenvectors_that_the_measurements_do_not_show() {
    let mut a = integers(6, 6, |i, j| (3 * i * i + 2 * i * j + 5 * j) % 9 - 4);
    a.view_mut((0, 3), (3, 3)).fill(0.0);
    let seen = matrix(1, 6, &[1., -2., 0., 0., 0., 0.]);
    let lower = DMatrix::from_fn(6, 6, |i, j| if i >= j { 1.0 } else { 0.0 });
    let inverse = lower.clone().try_inverse().unwrap();
    let (a, c) = (&lower * &a * &inverse, seen * &inverse);
    let modes = unobservable_modes(&a, &c).unwrap();
    assert_eq!(modes.len(), 3);
    let complex = |m: &DMatrix<f64>| m.map(|entry| Complex::new(entry, 0.0));
    for mode in modes {
        let residual = complex(&a) * &mode.vector - &mode.vector * mode.eigenvalue;
        assert!(residual.norm() < 1e-12 * a.norm(), "{mode:?}");
        assert!((complex(&c) * &mode.vector).norm() < 1e-12 * c.norm(), "{mode:?}");
        assert!((mode.vector.norm() - 1.0).abs() < 1e-14);
    }
}

/// A double eigenvalue with two eigenvectors gives both.
#[test]
fn two_constant_unmeasured_states_are_two_modes() {
    let modes = unobservable_modes(&DMatrix::zeros(3, 3), &matrix(1, 3, &[0., 1., 0.])).unwrap();
    let mut states: Vec<_> = modes.iter().flat_map(|mode| mode.dominant.clone()).collect();
    states.sort_unstable();
    assert_eq!(states, [0, 2]);
}

/// A slow state, and a sensor whose three states a long sample forgets.
#[test]
fn a_slow_state_is_observable_behind_states_that_samples_forget() {
    let a = DMatrix::from_row_slice(
        4,
        4,
        &[0.975, 0., 0., 0., 2., 1e-40, 3e-41, 0., -3., 0., 2e-42, 1e-41, 1., 2e-41, 0., 1e-43],
    );
    // C x and C A x differ by the slow state alone: c A = [5, ...] is far above rounding.
    let c = DMatrix::from_row_slice(1, 4, &[1., -1., 0., 0.]);
    let dual = uncontrollable_modes(&a.transpose(), &c.transpose()).unwrap();
    assert!(dual.iter().all(|mode| mode.eigenvalue.norm() < 0.5), "{dual:?}");
}
