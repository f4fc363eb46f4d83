use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant, printed, repaired_gains};
use control::Error;
use control::aso::{Estimator, FaultyPlant, Gains, design};
use control::placement::real_poles;
use control::theorem1::certify;
use nalgebra::DMatrix;

fn gains() -> Gains {
    let designed =
        design(&plant(), &real_poles(&CONTROLLER_POLES), &real_poles(&OBSERVER_POLES), None);
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

/// Contrary to the paper, P grows with alpha as fast as 2 / alpha decreases.
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

/// One state with `A_0` - L `C_0` = [-a, k; -b, 0]: P solved from the three equations.
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
        p_f: None,
        integral: None,
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

/// Under the worst constant fault the errors finally are inside of the region.
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

#[cfg(feature = "lmi")]
mod free {
    use super::gains;
    use crate::matrix;
    use crate::paper::{plant, repaired_gains};
    use crate::recorded::cases;
    use control::lmi::Outcome;
    use control::theorem1::{certify, largest_decay, smallest_radius, ultimate_bound};
    use nalgebra::DMatrix;

    const DATA: &str = include_str!("../data/lmi.txt");

    #[test]
    fn the_smallest_radius_is_that_of_a_semidefinite_program_stated_elsewhere() {
        for case in cases(DATA, "radius") {
            let actual = smallest_radius(case.get("F"), case.get("G"), 1.0).unwrap();
            let delta = actual.optimal().unwrap().delta;
            let ratio = delta / case.number("free");
            assert!(ratio > 1.0 - 1e-6 && ratio < 1.001, "{}: {ratio}", case.name);
            assert!(delta < case.number("printed") * 1.000_01);
        }
    }

    /// w does not move the second state; the first has the radius of z' = -z + w: P = 1/2.
    #[test]
    fn a_state_that_the_disturbance_does_not_move_leaves_the_radius_of_the_others() {
        let f = matrix(2, 2, &[-1.0, 0.0, 0.0, -2.0]);
        let radius = |entry: f64| {
            let g = matrix(2, 1, &[entry, 0.0]);
            smallest_radius(&f, &g, 3.0).unwrap().optimal().unwrap().delta
        };
        let delta = radius(1.0);
        assert!((2.999_99..3.001).contains(&delta), "{delta}");
        assert!(radius(0.0) <= 0.0);
    }

    /// A trolley with one measurement, the observer at -3, -4 and -5: solutions of F' P + P F = -`E_ij` have entries that
    /// are zero. The radius is that of scipy's `minimize` over the factors of Y.
    #[test]
    fn zeros_in_solutions_for_indefinite_matrices_do_not_prevent_a_radius() {
        let f = matrix(3, 3, &[-11.5, 1.0, 0.0, -41.25, -0.5, -0.5, 120.0, 0.0, 0.0]);
        let g = matrix(3, 1, &[0.0, -0.5, 0.0]);
        let ratio = smallest_radius(&f, &g, 1.0).unwrap().optimal().unwrap().delta / 3.270_170_4;
        assert!(ratio > 1.0 - 1e-6 && ratio < 1.001, "{ratio}");
    }

    /// For the paper's example the radius decreases by a factor of 6, for the corrected printed
    /// gains by 3.
    #[test]
    fn the_best_p_shrinks_the_region_of_the_paper() {
        let plant = plant();
        for (gains, factor) in [(gains(), 6.0), (repaired_gains(), 3.0)] {
            let printed = certify(&plant, &gains, 1.0, 30.0).unwrap().delta;
            let f = gains.error_dynamics(&plant);
            let actual = smallest_radius(&f, &plant.augmented_fault(), 30.0).unwrap();
            let actual = actual.optimal().unwrap();
            assert!(actual.delta * factor < printed, "{} {printed}", actual.delta);
            let left = &actual.p * &f + f.transpose() * &actual.p + DMatrix::identity(5, 5);
            let root = left.diagonal().map(|entry| (-entry).sqrt());
            let scaled = DMatrix::from_fn(5, 5, |i, j| -left[(i, j)] / (root[i] * root[j]));
            assert!(scaled.symmetric_eigenvalues().min() > 0.0 && actual.margin > 0.0);
        }
    }

    /// The slowest eigenvalue is -1200.
    #[test]
    fn the_decay_rate_of_the_paper_is_certified_to_a_thousandth() {
        let decay = largest_decay(&gains().error_dynamics(&plant())).unwrap().optimal().unwrap();
        assert!(decay.alpha > 1198.8 && decay.alpha < 1200.0, "{}", decay.alpha);
        assert!(decay.certificate.margin > 0.0);
    }

    /// A defective eigenvalue at -1 has a certificate for every smaller rate only.
    #[test]
    fn the_decay_rate_of_a_defective_eigenvalue_is_approached() {
        let jordan = matrix(2, 2, &[-1., 1., 0., -1.]);
        let decay = largest_decay(&jordan).unwrap().optimal().unwrap();
        assert!(decay.alpha > 0.99 && decay.alpha < 1.0);
    }

    /// Under the fault that switches with the sign of its own response the error stays in the
    /// ellipsoid; under a constant fault it ends inside.
    #[test]
    fn the_ultimate_bound_holds_for_constant_and_for_switching_faults() {
        let plant = plant();
        let gains = repaired_gains();
        let (f, g) = (gains.error_dynamics(&plant), plant.augmented_fault());
        let bound = ultimate_bound(&f, &g, 30.0).unwrap().optimal().unwrap();
        let end = f.clone().lu().solve(&(&g * 30.0)).unwrap();
        assert!(end.norm() < bound.radius && end.norm() > 0.5 * bound.radius);
        for state in 0..5 {
            assert!(end[state].abs() < bound.peaks[state]);
        }
        let step = control::hold::FirstOrderHold::new(&f, &g, 1e-3).unwrap();
        let inverse = bound.shape.clone().try_inverse().unwrap();
        let mut z = DMatrix::zeros(5, 1);
        for _ in 0..5000 {
            let worst = 30.0 * (g.transpose() * &inverse * &z)[(0, 0)].signum();
            z = &step.phi * z + &step.gamma_0 * worst;
            for state in 0..5 {
                assert!(z[state].abs() < bound.peaks[state]);
            }
        }
        assert!(z.norm() > 0.3 * bound.radius, "{} {}", z.norm(), bound.radius);
    }

    #[test]
    fn an_unstable_observer_conflicts_with_stability() {
        let (f, g) = (matrix(1, 1, &[0.5]), matrix(1, 1, &[1.0]));
        let expected = vec!["stability"];
        assert_eq!(largest_decay(&f), Ok(Outcome::Infeasible { conflict: expected.clone() }));
        let actual = smallest_radius(&f, &g, 1.0);
        assert_eq!(actual, Ok(Outcome::Infeasible { conflict: expected.clone() }));
        assert_eq!(ultimate_bound(&f, &g, 1.0), Ok(Outcome::Infeasible { conflict: expected }));
    }
}
