use crate::matrix;
use crate::paper::plant;
use control::Domain;
use control::aso::FaultyPlant;
use control::detectability::{HiddenFault, detectability};
use nalgebra::{Complex, DMatrix};

#[test]
fn the_friction_of_the_pendulum_can_be_estimated() {
    let actual = detectability(&plant(), Domain::Continuous).unwrap();
    assert!(
        actual.observer_exists() && actual.is_detectable() && actual.invisible_faults().is_empty()
    );
    assert!(actual.hidden.is_empty() && actual.unobservable.is_empty());
    assert!(actual.distance.lower > 0.0 && actual.distance.upper < 1.0, "{:?}", actual.distance);
}

/// A constant force moves the cart for ever, but the angle at rest does not depend on it: the
/// transfer functions have s = 0 as a pole and as a zero.
#[test]
fn a_constant_force_drives_the_cart_away_and_leaves_the_angle() {
    let visibility = detectability(&plant(), Domain::Continuous).unwrap().visibility;
    assert_eq!((visibility[0][0].visible, visibility[0][0].dc_gain), (true, None));
    assert!(visibility[1][0].visible);
    assert!(visibility[1][0].dc_gain.unwrap().abs() < 1e-12, "{visibility:?}");
}

/// A chain x1' = -x1 + f1, x2' = -2 x2 + x1 + f2, x3' = -3 x3 + f3 with x2 measured.
fn chain() -> FaultyPlant {
    FaultyPlant::with_constant_faults(
        matrix(3, 3, &[-1., 0., 0., 1., -2., 0., 0., 0., -3.]),
        matrix(3, 1, &[1., 0., 0.]),
        matrix(1, 3, &[0., 1., 0.]),
        DMatrix::identity(3, 3),
    )
}

#[test]
fn each_fault_is_seen_where_it_acts_with_its_gain_at_rest() {
    let actual = detectability(&chain(), Domain::Continuous).unwrap();
    let row = &actual.visibility[0];
    assert_eq!(row.iter().map(|entry| entry.visible).collect::<Vec<_>>(), [true, true, false]);
    for (entry, expected) in row.iter().zip([0.5, 0.5, 0.0]) {
        assert!((entry.dc_gain.unwrap() - expected).abs() < 1e-15, "{row:?}");
    }
    assert_eq!(actual.invisible_faults(), [2]);
    let (mode, stable) = &actual.unobservable[0];
    assert!(*stable && actual.is_detectable() && !actual.observer_exists());
    assert_eq!(mode.dominant, [2]);
    assert!((mode.eigenvalue + 3.0).norm() < 1e-14);
}

/// y = x2 at rest is (f1 + f2) / 2: their difference is hidden, and so is f3.
#[test]
fn hidden_combinations_are_named_by_their_faults() {
    let actual = detectability(&chain(), Domain::Continuous).unwrap();
    let mut faults: Vec<_> = actual.hidden.iter().map(HiddenFault::faults).collect();
    faults.sort_unstable();
    assert_eq!(faults, [vec![0, 1], vec![2]]);
    let pair = actual.hidden.iter().find(|hidden| hidden.faults().len() == 2).unwrap();
    assert!((pair.fault[0] + pair.fault[1]).norm() < 1e-13, "{pair:?}");
    assert_eq!(pair.states(), [0]);
    assert_eq!(pair.at, Complex::new(0.0, 0.0));
}

/// Two faults act on the same states: their difference moves no state.
#[test]
fn two_faults_with_one_effect_hide_each_other_without_a_motion() {
    let plant = FaultyPlant::with_constant_faults(
        matrix(3, 3, &[0., 1., 0., -4.3, -0.5, 2.1, 0.3, 0.1, -1.7]),
        matrix(3, 1, &[0., 1., 0.]),
        matrix(2, 3, &[1., 0., 0., 0., 0.3, 1.]),
        matrix(3, 2, &[0., 0., 1.3, 1.3, 0.7, 0.7]),
    );
    let actual = detectability(&plant, Domain::Continuous).unwrap();
    let [pair] = actual.hidden.as_slice() else { panic!("{:?}", actual.hidden) };
    assert_eq!((pair.faults(), pair.states()), (vec![0, 1], vec![]));
}

/// x1' = -x1 - 2 x2 + f, x2' = -x2 + f, y = x1: the transfer function from f to y is (s - 1) / (s +
/// 1)^2. It blocks only a fault that grows as e^t.
#[test]
fn a_fault_is_hidden_when_its_model_has_the_eigenvalue_of_a_zero() {
    let constant = FaultyPlant::with_constant_faults(
        matrix(2, 2, &[-1., -2., 0., -1.]),
        matrix(2, 1, &[0., 1.]),
        matrix(1, 2, &[1., 0.]),
        matrix(2, 1, &[1., 1.]),
    );
    let actual = detectability(&constant, Domain::Continuous).unwrap();
    assert_eq!((actual.zeros.finite.len(), actual.hidden.len()), (1, 0));
    assert!((actual.zeros.finite[0] - 1.0).norm() < 1e-14);
    assert!((actual.visibility[0][0].dc_gain.unwrap() + 1.0).abs() < 1e-14);
    let growing = FaultyPlant { a_f: matrix(1, 1, &[1.0]), ..constant };
    let actual = detectability(&growing, Domain::Continuous).unwrap();
    assert_eq!(actual.hidden[0].faults(), [0]);
    assert!((actual.hidden[0].at - 1.0).norm() < 1e-14);
    assert!(growing.check_observer_exists().is_err());
}

/// The transfer function from f to y is (s^2 + 4) / ((s + 1) (s + 2) (s + 3)): it blocks only a
/// fault that oscillates with 2 rad/s.
#[test]
fn a_swinging_fault_is_examined_at_its_own_frequency() {
    let swing = |frequency: f64| FaultyPlant {
        a: matrix(3, 3, &[0., 1., 0., 0., 0., 1., -6., -11., -6.]),
        b: matrix(3, 1, &[0., 0., 1.]),
        c: matrix(1, 3, &[4., 0., 1.]),
        f_a: matrix(3, 2, &[0., 0., 0., 0., 1., 0.]),
        a_f: matrix(2, 2, &[0., frequency, -frequency, 0.]),
    };
    assert!(detectability(&swing(1.9), Domain::Continuous).unwrap().observer_exists());
    let actual = detectability(&swing(2.0), Domain::Continuous).unwrap();
    assert_eq!(actual.hidden.len(), 1);
    assert!((actual.hidden[0].at - Complex::new(0.0, 2.0)).norm() < 1e-14);
    assert!(!actual.observer_exists());
}

/// A sampled integrator x[k+1] = x[k] + f: a constant fault appears in the measurement, and grows
/// without bound.
#[test]
fn sampled_faults_are_examined_at_one() {
    let one = matrix(1, 1, &[1.0]);
    let half = matrix(1, 1, &[0.5]);
    let plant = |a: &DMatrix<f64>| FaultyPlant {
        a: a.clone(),
        b: one.clone(),
        c: one.clone(),
        f_a: one.clone(),
        a_f: one.clone(),
    };
    let domain = Domain::Sampled { period: 0.1 };
    let actual = detectability(&plant(&one), domain).unwrap();
    assert!(actual.observer_exists());
    assert_eq!(actual.visibility[0][0].dc_gain, None);
    let actual = detectability(&plant(&half), domain).unwrap();
    assert!((actual.visibility[0][0].dc_gain.unwrap() - 2.0).abs() < 1e-15);
}

/// The rate of a ramp has no column of its own; it appears in the measurements through the fault.
#[test]
fn the_rate_of_a_ramp_is_seen_through_the_fault() {
    let constant = plant();
    let ramp = FaultyPlant {
        f_a: constant.f_a.clone().resize_horizontally(2, 0.0),
        a_f: matrix(2, 2, &[0., 1., 0., 0.]),
        ..constant
    };
    let actual = detectability(&ramp, Domain::Continuous).unwrap();
    assert!(actual.observer_exists() && actual.invisible_faults().is_empty());
    assert_eq!(actual.visibility[0][1].dc_gain, Some(0.0));
}
