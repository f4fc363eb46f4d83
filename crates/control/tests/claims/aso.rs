use crate::matrix;
use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant, printed, repaired_gains};
use control::Error;
use control::aso::{AsoDesign, FaultyPlant, design};
use control::eigen::eigenvalues;
use control::hold::FirstOrderHold;
use control::placement::real_poles;
use nalgebra::{Complex, DMatrix};

fn designed() -> AsoDesign {
    design(&plant(), &real_poles(&CONTROLLER_POLES), &real_poles(&OBSERVER_POLES), None)
        .expect("the design exists")
}

#[test]
fn the_error_dynamics_of_the_pendulum_have_the_required_eigenvalues() {
    let (plant, design) = (plant(), designed());
    let mut required = OBSERVER_POLES;
    required.sort_by(f64::total_cmp);
    let actual = eigenvalues(&design.gains.error_dynamics(&plant)).unwrap();
    for (actual, required) in actual.iter().zip(required) {
        assert!((actual - required).norm() < 1e-6 * required.abs(), "{actual}");
    }
    let actual = eigenvalues(&design.gains.controlled_dynamics(&plant)).unwrap();
    for (actual, required) in actual.iter().zip([-9.0, -7.5, -6.0, -4.5]) {
        assert!((actual - required).norm() < 1e-9, "{actual}");
    }
}

/// Friction acts where the actuator does, so that it can be cancelled entirely.
#[test]
fn friction_on_the_cart_is_compensated_one_to_one() {
    let design = designed();
    assert!((design.gains.k_f[(0, 0)] - 1.0).abs() < 1e-15);
    assert!(design.cancellation_residual < 1e-15);
}

/// B = diag(1e9, 1e-9) and `F_a` = -B: each actuator compensates its own fault.
#[test]
fn faults_of_actuators_with_very_different_units_are_compensated_one_to_one() {
    let b = matrix(2, 2, &[1e9, 0.0, 0.0, 1e-9]);
    let (a, c) = (DMatrix::zeros(2, 2), DMatrix::identity(2, 2));
    let plant = FaultyPlant::with_constant_faults(a, b.clone(), c, -b);
    let k_f = plant.compensation_gain().unwrap();
    assert!((&k_f - DMatrix::identity(2, 2)).amax() < 1e-15, "{k_f}");
}

/// A force on the pendulum itself, `F_a` = [0, 0, 0, 1]', is not in the range of the actuator.
#[test]
fn a_fault_beside_the_actuator_leaves_the_residual_of_the_projection() {
    let plant = FaultyPlant { f_a: matrix(4, 1, &[0., 0., 0., 1.]), ..plant() };
    let design =
        design(&plant, &real_poles(&CONTROLLER_POLES), &real_poles(&OBSERVER_POLES), None).unwrap();
    let (b_3, b_4) = (plant.b[2], plant.b[3]);
    let sine = b_3 / b_3.hypot(b_4);
    assert!((design.cancellation_residual - sine).abs() < 1e-12);
    assert!((design.gains.k_f[(0, 0)] + b_4 / (b_3 * b_3 + b_4 * b_4)).abs() < 1e-12);
}

/// Eigenvalues about -9.1, -16.3, -21.5, -22.5 +- 7.4i; numpy 2.4.6 linalg.eigvals on `A_0` - L
/// `C_0`.
#[test]
fn the_printed_observer_with_two_signs_repaired_is_stable_and_without_is_not() {
    let plant = printed();
    let expected = [
        Complex::new(-22.527_867_7, -7.418_743_82),
        Complex::new(-22.527_867_7, 7.418_743_82),
        Complex::new(-21.467_686_13, 0.0),
        Complex::new(-16.312_979_61, 0.0),
        Complex::new(-9.124_598_87, 0.0),
    ];
    let actual = eigenvalues(&repaired_gains().error_dynamics(&plant)).unwrap();
    for (actual, expected) in actual.iter().zip(expected) {
        assert!((actual - expected).norm() < 1e-7, "{actual} {expected}");
    }
    for sign in [1.0, -1.0] {
        let mut gains = repaired_gains();
        gains.l_x[(2, 1)] *= -1.0;
        gains.l_x[(3, 1)] *= -1.0;
        gains.l_f *= sign;
        let actual = eigenvalues(&gains.error_dynamics(&plant)).unwrap();
        assert!(actual.iter().any(|value| value.re > 1.0), "{actual:?}");
    }
}

/// Plant and observer are simulated together, uncompensated and with a constant fault. The estimate
/// converges to the fault for every command.
#[test]
fn the_estimate_reaches_a_constant_fault_for_any_actuator_command() {
    let (plant, gains) = (plant(), designed().gains);
    let (fault, command) = (12.5, -3.0);
    let observer = &gains.l_x * &plant.c;
    let mut a = DMatrix::zeros(9, 9);
    a.view_mut((0, 0), (4, 4)).copy_from(&plant.a);
    a.view_mut((4, 0), (4, 4)).copy_from(&observer);
    a.view_mut((4, 4), (4, 4)).copy_from(&(&plant.a - observer));
    a.view_mut((4, 8), (4, 1)).copy_from(&plant.f_a);
    let correction = &gains.l_f * &plant.c;
    a.view_mut((8, 0), (1, 4)).copy_from(&correction);
    a.view_mut((8, 4), (1, 4)).copy_from(&-correction);
    let mut b = DMatrix::zeros(9, 2);
    b.view_mut((0, 0), (4, 1)).copy_from(&plant.b);
    b.view_mut((4, 0), (4, 1)).copy_from(&plant.b);
    b.view_mut((0, 1), (4, 1)).copy_from(&plant.f_a);
    let mut x = [0.01, -0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let step = FirstOrderHold::new(&a, &b, 1e-3).unwrap();
    for _ in 0..50 {
        let mut next = [0.0; 9];
        step.step_into(&x, &[command, fault], &[0.0; 2], &mut next).unwrap();
        x = next;
    }
    assert!((x[8] - fault).abs() < 1e-4 * fault, "{x:?}");
}

/// Three faults, two measurements.
#[test]
fn more_faults_than_measurements_are_refused() {
    let FaultyPlant { a, b, c, .. } = plant();
    let plant = FaultyPlant::with_constant_faults(a, b, c, DMatrix::identity(4, 3));
    let refused = plant.check_observer_exists();
    assert_eq!(refused, Err(Error::TooManyFaults { faults: 3, measurements: 2 }));
}

/// A constant error f of the rate, x' = v + f, has the same effect as another velocity if only x is
/// measured.
#[test]
fn a_fault_that_looks_like_a_state_is_refused() {
    let plant = FaultyPlant::with_constant_faults(
        matrix(2, 2, &[0., 1., 0., 0.]),
        matrix(2, 1, &[0., 1.]),
        matrix(1, 2, &[1., 0.]),
        matrix(2, 1, &[1., 0.]),
    );
    let refused =
        design(&plant, &real_poles(&[-1.0, -2.0]), &real_poles(&[-3.0, -4.0, -5.0]), None);
    let at = Complex::new(0.0, 0.0);
    assert_eq!(refused, Err(Error::HiddenFault { at, rank: 2, expected: 3, faults: vec![1] }));
    assert_eq!(
        refused.unwrap_err().to_string(),
        "a fault that develops with s = 0 cannot be told from a state: rank [A - s I, F_a; C, 0] \
         is 2, expected 3; it hides in the columns [1] of F_a"
    );
}

#[test]
fn an_unobservable_plant_is_refused() {
    let plant = FaultyPlant { c: matrix(1, 4, &[0., 0., 1., 0.]), ..plant() };
    let refused =
        design(&plant, &real_poles(&CONTROLLER_POLES), &real_poles(&OBSERVER_POLES), None);
    assert_eq!(refused, Err(Error::NotObservable { rank: 3, n: 4 }));
}

/// Two actuators, two faults, three measurements: the general sizes.
#[test]
fn two_faults_with_three_measurements_are_designed() {
    let plant = FaultyPlant::with_constant_faults(
        crate::integers(5, 5, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5),
        crate::integers(5, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3),
        matrix(3, 5, &[1., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 0., 1., 0., 0.]),
        crate::integers(5, 2, |i, j| (5 * i * i + 3 * j + 2 * i * j + i) % 7 - 3) * -0.5,
    );
    let observer_poles = [-10., -11., -12., -13., -14., -15., -16.];
    let design =
        design(&plant, &real_poles(&[-1., -2., -3., -4., -5.]), &real_poles(&observer_poles), None)
            .unwrap();
    let half = DMatrix::from_diagonal_element(2, 2, 0.5);
    assert!((&design.gains.k_f - half).amax() < 1e-13);
    assert_eq!((design.gains.l_x.shape(), design.gains.l_f.shape()), ((5, 3), (2, 3)));
    assert!(design.observer.pole_error < 1e-9, "{:?}", design.observer);
}
