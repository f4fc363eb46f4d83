use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant, printed};
use crate::{entry_error, integers, matrix};
use control::Error;
use control::eigen::eigenvalues;
use control::placement::{Placement, place};
use nalgebra::DMatrix;

fn assert_assigned(a: &DMatrix<f64>, b: &DMatrix<f64>, placement: &Placement, poles: &[f64]) {
    let mut wanted = poles.to_vec();
    wanted.sort_by(f64::total_cmp);
    for (found, wanted) in
        eigenvalues(&(a + b * &placement.gain)).expect("eigenvalues exist").iter().zip(wanted)
    {
        assert!((found - wanted).norm() < 1e-6 * wanted.abs(), "{found} {wanted}");
    }
}

/// Published as rounded here, from the printed A and B.
#[test]
fn one_input_gives_the_published_gain() {
    let placement = place(&printed().a, &printed().b, &CONTROLLER_POLES).unwrap();
    let published = matrix(1, 4, &[184.10, 365.71, 123.66, 63.86]);
    assert!((&placement.gain - published).amax() < 5.1e-3, "{}", placement.gain);
}

/// `-place_poles(A, B, [-4.5, -6, -7.5, -9]).gain_matrix` of scipy 1.17.1, A and B from the
/// parameters.
#[test]
fn one_input_gives_the_gain_of_scipy() {
    let placement = place(&plant().a, &plant().b, &CONTROLLER_POLES).unwrap();
    let scipy = [184.088_126_31, 365.721_398_02, 123.654_284_82, 63.865_665_69];
    assert!(entry_error(&placement.gain, &matrix(1, 4, &scipy)) < 1e-9);
}

/// Condition numbers of `place_poles(A_0', C_0', ..., rtol=1e-14).X` of scipy 1.17.1, the best over
/// maxiter: KNV0 3.24746e7 (200), YT 6.47955e7 (30). The gain itself is where a search over the
/// five free angles (Nelder-Mead, 60 random starts, scipy) found its lowest value, 3.198767e7.
#[test]
fn the_observer_of_the_pendulum_is_better_conditioned_than_scipy_makes_it() {
    let plant = plant();
    let a = plant.augmented_dynamics().transpose();
    let c = plant.augmented_output().transpose();
    let placement = place(&a, &c, &OBSERVER_POLES).unwrap();
    assert!(placement.quality.condition < 3.24746e7, "{:?}", placement.quality);
    assert!((placement.quality.condition / 3.198_767e7 - 1.0).abs() < 1e-6);
    assert!(placement.quality.pole_error < 1e-9);
    assert_assigned(&a, &c, &placement, &OBSERVER_POLES);
}

/// The chemical reactor, example 1 of Kautsky, Nichols and Van Dooren (1985); scipy 1.17.1
/// `place_poles` with YT reaches 4.2721613.
#[test]
fn the_chemical_reactor_is_at_least_as_well_conditioned_as_scipy_makes_it() {
    let a = [
        1.38, -0.2077, 6.715, -5.676, -0.5814, -4.29, 0.0, 0.675, //
        1.067, 4.273, -6.654, 5.893, 0.048, 4.273, 1.343, -2.104,
    ];
    let a = matrix(4, 4, &a);
    let b = matrix(4, 2, &[0.0, 0.0, 5.679, 0.0, 1.136, -3.146, 1.136, 0.0]);
    let poles = [-0.2, -0.5, -5.0566, -8.6659];
    let placement = place(&a, &b, &poles).unwrap();
    assert!(placement.quality.condition <= 4.272_162, "{:?}", placement.quality);
    assert_assigned(&a, &b, &placement, &poles);
}

/// Lowest condition number of scipy 1.17.1 `place_poles` over YT and KNV0, maxiter 30 and 2000,
/// rtol 1e-14, for poles -1, ..., -n.
#[test]
fn several_inputs_are_at_least_as_well_conditioned_as_scipy_makes_them() {
    let cases = [(4, 2, 19.564_951), (5, 3, 9.307_912), (6, 2, 48.289_836), (8, 3, 107.817_401)];
    for (n, m, scipy) in cases {
        let a = integers(n, n, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
        let b = integers(n, m, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3);
        let poles: Vec<f64> = (1..=n).map(|k| -f64::from(u8::try_from(k).unwrap())).collect();
        let placement = place(&a, &b, &poles).unwrap();
        assert!(placement.quality.condition <= scipy, "{n}, {m}: {:?}", placement.quality);
        assert_assigned(&a, &b, &placement, &poles);
    }
}

/// With as many inputs as states every matrix can be made: the best has orthogonal eigenvectors.
#[test]
fn as_many_inputs_as_states_give_orthogonal_eigenvectors() {
    let a = integers(3, 3, |i, j| (3 * i * i + 2 * i * j + j) % 7 - 3);
    let b = matrix(3, 3, &[1., 2., 0., 0., 1., 3., 1., 0., 1.]);
    let placement = place(&a, &b, &[-1.0, -2.0, -3.0]).unwrap();
    assert!(placement.quality.condition < 1.0 + 1e-7, "{:?}", placement.quality);
}

#[test]
fn an_eigenvalue_may_come_as_often_as_there_are_inputs() {
    let a = integers(4, 4, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
    let b = integers(4, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3);
    let poles = [-2.0, -1.0, -2.0, -1.0];
    assert_assigned(&a, &b, &place(&a, &b, &poles).unwrap(), &poles);
    let refused = place(&a, &b, &[-2.0, -1.0, -2.0, -2.0]);
    assert_eq!(refused, Err(Error::RepeatedPole { pole: -2.0, times: 3, inputs: 2 }));
}

/// Two equal motors share the work of one.
#[test]
fn dependent_inputs_get_the_smallest_gain() {
    let (a, one) = (plant().a, plant().b);
    let both = DMatrix::from_fn(4, 2, |i, _| one[i]);
    let single = place(&a, &one, &CONTROLLER_POLES).unwrap().gain;
    let shared = place(&a, &both, &CONTROLLER_POLES).unwrap().gain;
    let expected = DMatrix::from_fn(2, 4, |_, j| single[j] / 2.0);
    assert!(entry_error(&shared, &expected) < 1e-12, "{shared}");
}

#[test]
fn an_eigenvalue_of_the_plant_may_be_kept_and_zero_may_be_assigned() {
    let a = matrix(2, 2, &[0.0, 1.0, 0.0, -3.0]);
    let b = matrix(2, 1, &[0.0, 1.0]);
    let kept = place(&a, &b, &[-3.0, 0.0]).unwrap();
    assert!(kept.gain.amax() < 1e-13, "{}", kept.gain);
}

#[test]
fn a_state_out_of_reach_is_refused() {
    let a = matrix(2, 2, &[1.0, 0.0, 0.0, 2.0]);
    let refused = place(&a, &matrix(2, 1, &[1.0, 0.0]), &[-1.0, -2.0]);
    assert_eq!(refused, Err(Error::NotControllable { rank: 1, n: 2 }));
}
