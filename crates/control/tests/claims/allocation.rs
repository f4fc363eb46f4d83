//! Control allocation and equilibria without an actuator.

use crate::matrix;
use control::Error;
use control::allocation::{Actuators, allocate, equilibrium};
use nalgebra::{DMatrix, DVector};

/// Surge, sway and yaw of a vehicle with four vectored thrusters.
fn thrusters() -> DMatrix<f64> {
    matrix(3, 4, &[1.0, 1.0, 1.0, 1.0, 0.8, -0.8, -0.8, 0.8, 2.0, -2.0, 2.0, -2.0])
}

#[test]
fn three_of_four_thrusters_have_the_effect_of_all_with_the_least_weighted_effort() {
    let (b, authority) = (thrusters(), [1.0, 2.0, 0.5, 1.0]);
    for gone in 0..4 {
        let actuators = Actuators { b: &b, gone: &[gone], authority: &authority };
        let commands = allocate(&actuators).unwrap();
        assert!(commands.residual < 1e-14);
        assert!((&b * &commands.matrix - &b).amax() < 1e-13);
        assert!(commands.matrix.row(gone).amax() < 1e-15);
    }
    // With all thrusters: no other command with the same effect needs less effort.
    let intact = Actuators { b: &b, gone: &[], authority: &authority };
    let u = allocate(&intact).unwrap().matrix * DVector::from_vec(vec![1.0, -0.4, 0.3, 2.0]);
    let effort =
        |u: &DVector<f64>| u.iter().zip(authority).map(|(u, a)| (u / a).powi(2)).sum::<f64>();
    // The null space of B.
    let idle = DVector::from_vec(vec![1.0, 1.0, -1.0, -1.0]);
    assert!((&b * &idle).amax() < 1e-15);
    for part in [-0.1, 0.1] {
        assert!(effort(&(&u + &idle * part)) > effort(&u));
    }
}

#[test]
fn what_two_thrusters_cannot_do_is_the_residual() {
    let b = thrusters();
    let actuators = Actuators { b: &b, gone: &[0, 1], authority: &[1.0; 4] };
    let commands = allocate(&actuators).unwrap();
    assert!(commands.residual > 0.1);
    let left = &b * &commands.matrix - &b;
    // Of all commands of the two the effect is nearest to the required one.
    assert!((b.columns(2, 2).transpose() * left).amax() < 1e-13);
}

/// x1' = -x1 + x2 + u1, x2' = x1 - 2 x2 + u2: without u2, u1 holds x1 or x2 at zero, not both.
#[test]
fn a_remaining_input_holds_the_output_that_must_be_kept() {
    let a = matrix(2, 2, &[-1.0, 1.0, 1.0, -2.0]);
    let b = DMatrix::identity(2, 2);
    let w = DVector::from_vec(vec![0.0, 0.6]);
    let actuators = Actuators { b: &b, gone: &[1], authority: &[1.0; 2] };
    for (output, x) in [([1.0, 0.0], [0.0, 0.3]), ([0.0, 1.0], [-0.6, 0.0])] {
        let rest = equilibrium(&a, &actuators, &matrix(1, 2, &output), &w).unwrap();
        assert!(rest.left < 1e-14 && (&rest.x - DVector::from_row_slice(&x)).amax() < 1e-14);
        assert!((&a * &rest.x + &b * &rest.u + &w).amax() < 1e-14 && rest.u[1].abs() < 1e-15);
    }
    let both = equilibrium(&a, &actuators, &DMatrix::identity(2, 2), &w).unwrap();
    // x = (2 t - 0.6, t) is nearest to zero at t = 0.24.
    assert!((&both.x - DVector::from_row_slice(&[-0.12, 0.24])).amax() < 1e-13);
}

/// z1' = -z1 + w, z2' = -2 z2 + u, z3' = -3 z3 + u in other coordinates x = T z: no command moves z1 from w = 1.
#[test]
fn an_output_that_no_remaining_input_moves_is_left() {
    for t in [
        [0.0, 0.0, 2.0, 3.0, -3.0, -2.0, 2.0, 3.0, -2.0],
        [-1.0, 3.0, -1.0, -2.0, 2.0, -2.0, -1.0, 1.0, 0.0],
        [-3.0, -3.0, 3.0, 2.0, 2.0, 0.0, 2.0, -1.0, 0.0],
    ] {
        let t = matrix(3, 3, &t);
        let inverse = t.clone().try_inverse().unwrap();
        let modes = DMatrix::from_diagonal(&DVector::from_vec(vec![-1.0, -2.0, -3.0]));
        let (a, b) = (&t * modes * &inverse, &t * matrix(3, 1, &[0.0, 1.0, 1.0]));
        let w = t.column(0).into_owned();
        let actuators = Actuators { b: &b, gone: &[], authority: &[1.0] };
        let rest = equilibrium(&a, &actuators, &inverse.rows(0, 1).into(), &w).unwrap();
        assert!((rest.left - 1.0).abs() < 1e-12, "{rest:?}");
        assert!((&a * &rest.x + &b * &rest.u + &w).amax() < 1e-12, "{rest:?}");
        assert!(rest.x.amax() < 5.0 && rest.u[0].abs() < 5.0, "{rest:?}");
    }
}

#[test]
fn a_plant_that_cannot_rest_under_the_disturbance_is_refused() {
    let (a, b) = (DMatrix::zeros(2, 2), DMatrix::identity(2, 2));
    let w = DVector::from_vec(vec![0.0, 1.0]);
    let actuators = Actuators { b: &b, gone: &[1], authority: &[1.0; 2] };
    let outcome = equilibrium(&a, &actuators, &DMatrix::identity(2, 2), &w);
    assert_eq!(outcome, Err(Error::NotControllable { rank: 1, n: 2 }));
    let with = |authority| allocate(&Actuators { b: &b, gone: &[0], authority });
    assert!(matches!(with(&[1.0, 0.0]), Err(Error::OutOfRange { .. })));
    assert!(matches!(with(&[1.0]), Err(Error::Shape { .. })));
}
