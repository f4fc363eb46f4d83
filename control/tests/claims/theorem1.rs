use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant, printed, repaired_gains};
use control::Error;
use control::aso::{Estimator, FaultyPlant, Gains, design};
use control::placement::real;
use control::theorem1::certify;
use nalgebra::DMatrix;

fn gains() -> Gains {
    let designed = design(&plant(), &real(&CONTROLLER_POLES), &real(&OBSERVER_POLES), None);
    designed.expect("the design exists").gains
}

#[test]
fn the_certificate_of_the_pendulum_satisfies_equation_12() {
    let (plant, gains) = (plant(), gains());
    let certificate = certify(&plant, &gains, 1.0, 30.0).unwrap();
    let f = gains.error_dynamics(&plant);
    let right = DMatrix::from_diagonal_element(5, 5, 30.0);
    let left = &certificate.p * &f + f.transpose() * &certificate.p;
    assert!((left + &right).norm() < 1e-2 * right.norm());
    assert!(certificate.residual < 1e-14 && certificate.defect < 1e-2);
    assert!(certificate.p_range.0 > 0.0);
    assert!(certificate.controllability.is_full() && certificate.observability.is_full());
    assert!((certificate.observer_abscissa + 1200.0).abs() < 1e-3);
    assert!((certificate.controller_abscissa + 4.5).abs() < 1e-9);
}

/// Other than the paper says: P grows with alpha as fast as 2 / alpha falls.
#[test]
fn alpha_does_not_shrink_the_region() {
    let (plant, gains) = (printed(), repaired_gains());
    let reference = certify(&plant, &gains, 1.0, 30.0).unwrap();
    for alpha in [1e-3, 7.0, 1e6] {
        let other = certify(&plant, &gains, alpha, 30.0).unwrap();
        assert!((other.delta / reference.delta - 1.0).abs() < 1e-10, "alpha = {alpha}");
        assert!((other.p.norm() / (alpha * reference.p.norm()) - 1.0).abs() < 1e-10);
    }
}

/// For one state with `A_0` - L `C_0` = [-a, k; -b, 0]: P from the three equations by hand.
#[test]
fn a_plant_of_one_state_gives_the_region_found_by_hand() {
    let one = |value| DMatrix::from_element(1, 1, value);
    let plant = FaultyPlant::with_constant_faults(one(1.0), one(2.0), one(1.0), one(-2.0));
    let gains = Gains {
        estimator: Estimator::Prediction,
        k_x: one(-1.0),
        k_f: one(1.0),
        l_x: one(6.0),
        l_f: one(-3.0),
    };
    let (a, k, b, beta) = (5.0, 2.0, 3.0, 4.0);
    let p_12 = -1.0 / (2.0 * k);
    let p_11 = (1.0 - 2.0 * b * p_12) / (2.0 * a);
    let p_22 = (a * p_12 - k * p_11) / -b;
    let certificate = certify(&plant, &gains, 1.0, beta).unwrap();
    let expected = crate::matrix(2, 2, &[p_11, p_12, p_12, p_22]) * beta;
    assert!((&certificate.p - expected).amax() < 1e-13, "{}", certificate.p);
    let by_hand = 2.0 * beta * k * p_11.hypot(p_12);
    assert!((certificate.delta / by_hand - 1.0).abs() < 1e-13);
}

/// The error system driven by the worst constant fault ends inside of the region.
#[test]
fn the_error_under_a_constant_fault_ends_inside_of_the_region() {
    let (plant, gains) = (printed(), repaired_gains());
    let beta = 30.0;
    let certificate = certify(&plant, &gains, 1.0, beta).unwrap();
    let f = gains.error_dynamics(&plant);
    let end = f.lu().solve(&(plant.augmented_fault() * beta)).unwrap();
    assert!(end.norm() <= certificate.delta && end.norm() > 0.9 * beta, "{}", end.norm());
}

#[test]
fn an_unstable_observer_has_no_certificate() {
    let mut gains = repaired_gains();
    gains.l_f = -gains.l_f;
    let refused = certify(&printed(), &gains, 1.0, 30.0);
    assert!(matches!(refused, Err(Error::NotHurwitz { matrix: "A_0 - L C_0", .. })), "{refused:?}");
}
