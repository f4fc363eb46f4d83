//! Control allocation and equilibria without an actuator.

use crate::matrix;
use control::Error;
use control::allocation::{allocate, equilibrium};
use nalgebra::{DMatrix, DVector};

/// Surge, sway and yaw of a vehicle with four vectored thrusters.
fn thrusters() -> DMatrix<f64> {
    matrix(3, 4, &[1.0, 1.0, 1.0, 1.0, 0.8, -0.8, -0.8, 0.8, 2.0, -2.0, 2.0, -2.0])
}

#[test]
fn three_of_four_thrusters_have_the_effect_of_all_with_the_least_weighted_effort() {
    let (b, authority) = (thrusters(), [1.0, 2.0, 0.5, 1.0]);
    for gone in 0..4 {
        let found = allocate(&b, &[gone], &authority).unwrap();
        assert!(found.residual < 1e-14);
        assert!((&b * &found.matrix - &b).amax() < 1e-13);
        assert!(found.matrix.row(gone).amax() < 1e-15);
    }
    // With all thrusters: no other command with the same effect needs less effort.
    let found = allocate(&b, &[], &authority).unwrap();
    let wanted = DVector::from_vec(vec![1.0, -0.4, 0.3, 2.0]);
    let u = &found.matrix * &wanted;
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
    let found = allocate(&thrusters(), &[0, 1], &[1.0; 4]).unwrap();
    assert!(found.residual > 0.1);
    let left = &thrusters() * &found.matrix - thrusters();
    // Of all commands of the two the effect is nearest to the required one.
    assert!((thrusters().columns(2, 2).transpose() * left).amax() < 1e-13);
}

/// x1' = -x1 + x2 + u1, x2' = x1 - 2 x2 + u2: without u2, u1 holds x1 or x2 at zero, not both.
#[test]
fn a_remaining_input_holds_the_output_that_must_be_kept() {
    let a = matrix(2, 2, &[-1.0, 1.0, 1.0, -2.0]);
    let b = DMatrix::identity(2, 2);
    let w = DVector::from_vec(vec![0.0, 0.6]);
    for (kept, x) in [([1.0, 0.0], [0.0, 0.3]), ([0.0, 1.0], [-0.6, 0.0])] {
        let found = equilibrium((&a, &b, &matrix(1, 2, &kept)), &w, &[1], &[1.0; 2]).unwrap();
        assert!(found.left < 1e-14 && (&found.x - DVector::from_row_slice(&x)).amax() < 1e-14);
        assert!((&a * &found.x + &b * &found.u + &w).amax() < 1e-14 && found.u[1].abs() < 1e-15);
    }
    let both = equilibrium((&a, &b, &DMatrix::identity(2, 2)), &w, &[1], &[1.0; 2]).unwrap();
    // x = (2 t - 0.6, t) is nearest to zero at t = 0.24.
    assert!((&both.x - DVector::from_row_slice(&[-0.12, 0.24])).amax() < 1e-13);
}

#[test]
fn a_plant_that_cannot_rest_under_the_disturbance_is_refused() {
    let (a, b) = (DMatrix::zeros(2, 2), DMatrix::identity(2, 2));
    let w = DVector::from_vec(vec![0.0, 1.0]);
    let found = equilibrium((&a, &b, &DMatrix::identity(2, 2)), &w, &[1], &[1.0; 2]);
    assert_eq!(found, Err(Error::NotControllable { rank: 1, n: 2 }));
    assert!(matches!(allocate(&b, &[0], &[1.0, 0.0]), Err(Error::OutOfRange { .. })));
    assert!(matches!(allocate(&b, &[0], &[1.0]), Err(Error::Shape { .. })));
}
