//! Laws that estimate faults: existence against counterexamples, error dynamics against closed forms and
//! inequalities by their residuals.

use super::{integers, matrix};
use control::aso::{Estimator, FaultyPlant, Gains, design};
use control::controller::{closed_loop, controller};
use control::eigen::eigenvalues;
use control::estimation::{
    DirectForm, FastAdaptive, Learning, OwnModel, SlidingMode, fast_adaptive, learning, mean_rate,
    proportional_integral, sliding_mode,
};
use control::faults::ExtendedPlant;
use control::lyapunov::lyapunov;
use control::placement::real_poles;
use control::response::{fault_rate_system, fault_system, step_response};
use control::sampled::sample;
use control::zeros::zeros;
use control::{Domain, Error};
use nalgebra::DMatrix;

const T: f64 = 0.1;

/// Three states, the first two measured, a fault on the first; no invariant zeros.
fn plant() -> FaultyPlant {
    FaultyPlant::with_constant_faults(
        matrix(3, 3, &[0.5, 1.0, -1.0, 0.0, -1.0, 2.0, 1.0, 0.0, -2.0]),
        matrix(3, 1, &[2.0, 0.0, 0.0]),
        matrix(2, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        matrix(3, 1, &[2.0, 0.0, 0.0]),
    )
}

fn augmented(plant: &FaultyPlant) -> Gains {
    let (feedback, observer) = (real_poles(&[-1.0, -2.0, -3.0]), [-6.0, -7.0, -8.0, -9.0]);
    design(plant, &feedback, &real_poles(&observer), None).expect("a design").gains
}

/// The plant every 0.1 s, and gains whose feedback and estimator the laws take over.
fn sampled() -> (FaultyPlant, Gains, Domain) {
    let plant = plant();
    let sampled =
        sample(&ExtendedPlant::without_filter(plant.clone()), T).expect("a sampled plant");
    let gains = Gains { estimator: Estimator::Current, ..augmented(&plant) };
    (sampled, gains, Domain::Sampled { period: T })
}

fn sorted_real(m: &DMatrix<f64>) -> Vec<f64> {
    let mut all: Vec<_> =
        eigenvalues(m).expect("eigenvalues").iter().map(|value| value.re).collect();
    all.sort_by(f64::total_cmp);
    all
}

fn close(actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (a, b) in actual.iter().zip(expected) {
        assert!((a - b).abs() < tolerance, "{actual:?} {expected:?}");
    }
}

#[test]
fn a_measured_position_does_not_show_a_force_directly() {
    let plant = FaultyPlant::with_constant_faults(
        matrix(2, 2, &[0.0, 1.0, 0.0, 0.0]),
        matrix(2, 1, &[0.0, 1.0]),
        matrix(1, 2, &[1.0, 0.0]),
        matrix(2, 1, &[0.0, 1.0]),
    );
    let computed = DirectForm::new(&plant, Domain::Continuous);
    assert_eq!(computed.unwrap_err(), Error::FaultsNotDirect { rank: 0, faults: 1 });
}

#[test]
fn a_zero_in_the_right_half_plane_or_on_its_border_is_named() {
    for zero in [3.0, 0.0] {
        // (s - zero) / (s^2 + 2 s + 5)
        let plant = FaultyPlant::with_constant_faults(
            matrix(2, 2, &[0.0, 1.0, -5.0, -2.0]),
            matrix(2, 1, &[0.0, 1.0]),
            matrix(1, 2, &[-zero, 1.0]),
            matrix(2, 1, &[0.0, 1.0]),
        );
        match DirectForm::new(&plant, Domain::Continuous) {
            Err(Error::UnstableZeros { zeros }) => assert!((zeros[0] - zero).norm() < 1e-12),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn its_zeros_are_the_invariant_zeros() {
    // With as many measurements as faults there are n - q zeros, with more of them none in general.
    for (p, q, count) in [(1, 1, 3), (2, 2, 2), (2, 1, 0), (3, 2, 0)] {
        let a = integers(4, 4, |i, j| (3 * i + 5 * j * j + i * j) % 7 - 3)
            - DMatrix::identity(4, 4) * 9.0;
        let f_a = integers(4, q, |i, j| (2 * i + 3 * j + 2) % 5 - 1);
        let c = integers(p, 4, |i, j| (4 * i + j + i * j + 2) % 5 - 1);
        let plant =
            FaultyPlant::with_constant_faults(a.clone(), f_a.clone(), c.clone(), f_a.clone());
        let expected = zeros(&a, &f_a, &c).unwrap().finite;
        let computed = match DirectForm::new(&plant, Domain::Continuous) {
            Ok(form) => form.zeros,
            Err(Error::UnstableZeros { zeros }) => zeros,
            Err(error) => panic!("{error}"),
        };
        assert_eq!((computed.len(), expected.len()), (count, count), "{p} {q}");
        for zero in &computed {
            let distance = expected.iter().map(|other| (other - zero).norm()).fold(9.0, f64::min);
            assert!(distance < 1e-9, "{p} {q}: {zero} of {expected:?}");
        }
    }
}

#[test]
fn the_matrix_p_of_the_form_makes_the_error_strictly_positive_real() {
    let plant = plant();
    let form = DirectForm::new(&plant, Domain::Continuous).unwrap();
    let l_x = form.observer_gain(-4.0, 5.0).unwrap();
    let to = form.coordinates();
    let inverse = to.clone().try_inverse().unwrap();
    let a_l = &plant.a - &l_x * &plant.c;
    let inside = to * &a_l * inverse;
    close(inside.view((0, 0), (3, 1)).clone_owned().as_slice(), &[-4.0, 0.0, 0.0], 1e-12);
    let rest: DMatrix<f64> = inside.view((1, 1), (2, 2)).into();
    let p_w = lyapunov(&rest, &DMatrix::identity(2, 2)).unwrap().p;
    let mut scale = 1.0;
    loop {
        let mut p = DMatrix::identity(3, 3);
        p.view_mut((1, 1), (2, 2)).copy_from(&(&p_w * scale));
        let p = to.transpose() * p * to;
        assert!((plant.f_a.transpose() * &p - &form.m_1 * &plant.c).amax() < 1e-12);
        let decay = &p * &a_l + (&p * &a_l).transpose();
        if decay.symmetric_eigenvalues().max() < 0.0 && p.symmetric_eigenvalues().min() > 0.0 {
            return;
        }
        scale *= 2.0;
        assert!(scale < 1e6, "no P was found");
    }
}

#[test]
fn a_fast_adaptive_estimate_is_the_fault_behind_a_first_order_lag() {
    let plant = plant();
    let form = DirectForm::new(&plant, Domain::Continuous).unwrap();
    let law = FastAdaptive { sigma: 4.0, gamma: vec![10.0] };
    let gains = fast_adaptive(&plant, &form, &augmented(&plant), &law, 5.0).unwrap();
    let computed = sorted_real(&gains.error_dynamics(&plant));
    close(&computed, &[-10.0, -5.0 * 2_f64.sqrt(), -5.0, -4.0], 1e-8);
    let step =
        step_response(&fault_system(&plant, &gains, Domain::Continuous).unwrap(), 0).unwrap();
    for (k, time) in step.time.iter().enumerate() {
        assert!((step.output[(6, k)] + (-10.0 * time).exp()).abs() < 1e-9, "{time}");
    }
}

#[test]
fn a_sampled_fast_adaptive_estimate_closes_the_same_part_of_its_error_in_each_sample() {
    let (plant, gains, domain) = sampled();
    let form = DirectForm::new(&plant, domain).unwrap();
    let law = FastAdaptive { sigma: 4.0, gamma: vec![10.0] };
    let gains = fast_adaptive(&plant, &form, &gains, &law, 5.0).unwrap();
    let step = step_response(&fault_system(&plant, &gains, domain).unwrap(), 0).unwrap();
    for (k, time) in step.time.iter().enumerate() {
        assert!((step.output[(6, k)] + (-(time / T).round()).exp()).abs() < 1e-9, "{time}");
    }
}

#[test]
fn a_proportional_part_removes_the_lag_and_leaves_the_error_dynamics() {
    let (with_law, plain) = (plant(), augmented(&plant()));
    let (discrete, _, domain) = sampled();
    let poles: Vec<_> = [-6.0_f64, -7.0, -8.0, -9.0].iter().map(|p| (p * T).exp()).collect();
    let extended = ExtendedPlant::without_filter(plant());
    let feedback: Vec<_> = [-1.0_f64, -2.0, -3.0].iter().map(|p| (p * T).exp()).collect();
    let current = control::sampled::design(
        &extended,
        T,
        Estimator::Current,
        &real_poles(&feedback),
        &real_poles(&poles),
        None,
    );
    let current = current.unwrap().gains;
    for (plant, gains, domain) in
        [(&with_law, &plain, Domain::Continuous), (&discrete, &current, domain)]
    {
        let computed = proportional_integral(plant, gains, domain, 1.0).unwrap();
        assert_eq!(computed.error_dynamics(plant), gains.error_dynamics(plant));
        let lag = |gains: &Gains| {
            let system = fault_rate_system(plant, gains, domain).unwrap();
            step_response(&system, 0).unwrap().final_value[6]
        };
        assert!(lag(gains).abs() > 0.1 && lag(&computed).abs() < 1e-10);
        let half = proportional_integral(plant, gains, domain, 0.5).unwrap();
        assert!((lag(&half) - 0.5 * lag(gains)).abs() < 1e-10);
    }
}

#[test]
fn a_direct_term_leaves_feedback_and_observer_their_eigenvalues() {
    let plant = plant();
    let gains = proportional_integral(&plant, &augmented(&plant), Domain::Continuous, 1.0).unwrap();
    let with_law = controller(&plant, &gains, Domain::Continuous).unwrap();
    assert!(with_law.d.amax() > 0.1);
    let computed = sorted_real(&closed_loop(&plant, &with_law, &[1.0]).unwrap());
    close(&computed, &[-9.0, -8.0, -7.0, -6.0, -3.0, -2.0, -1.0], 1e-6);
}

#[test]
fn the_boundary_layer_leaves_one_part_in_a_hundred_of_a_small_fault() {
    let (mut plant, gains, domain) = sampled();
    let form = DirectForm::new(&plant, domain).unwrap();
    let law = SlidingMode { rho: vec![3.0], delta: None };
    let (OwnModel { gains: computed, a_f, .. }, delta) =
        sliding_mode(&plant, &form, &gains, &law, 5.0).unwrap();
    plant.a_f = a_f;
    let fast = (-0.5_f64).exp();
    let step = step_response(&fault_system(&plant, &computed, domain).unwrap(), 0).unwrap();
    assert!((step.final_value[6] + 0.01).abs() < 1e-4, "{}", step.final_value[6]);
    let eigenvalues = sorted_real(&computed.error_dynamics(&plant));
    // It is a double eigenvalue here, known to the root of the precision.
    assert!(eigenvalues.iter().any(|value| (value - fast).abs() < 1e-7), "{eigenvalues:?}");
    let law = SlidingMode { delta: Some(vec![delta[0] / 10.0]), ..law };
    plant.a_f = DMatrix::identity(1, 1);
    let refused = sliding_mode(&plant, &form, &gains, &law, 5.0);
    assert!(matches!(refused, Err(Error::NotSchur { .. })), "{refused:?}");
}

#[test]
fn a_learning_observer_has_the_double_eigenvalue_that_its_gains_are_for() {
    let (mut plant, gains, domain) = sampled();
    let form = DirectForm::new(&plant, domain).unwrap();
    let fast = (-0.5_f64).exp();
    for kept in [1.0, 0.9] {
        plant.a_f = DMatrix::identity(1, 1);
        let computed = learning(&plant, &form, &gains, &Learning { kept }, 5.0).unwrap();
        plant.a_f = computed.a_f;
        let all = eigenvalues(&computed.gains.error_dynamics(&plant)).unwrap();
        let near = all.iter().filter(|value| (*value - fast).norm() < 1e-5).count();
        assert!(near >= 2, "{all:?}");
        let step =
            step_response(&fault_system(&plant, &computed.gains, domain).unwrap(), 0).unwrap();
        let lambda = fast * fast / kept;
        let g = lambda + kept - 2.0 * fast;
        let left = (1.0 - lambda) * (1.0 - kept);
        assert!((step.final_value[6] + left / (left + g)).abs() < 1e-9);
    }
}

#[test]
fn sliding_mode_and_learning_are_laws_of_sampled_controllers_with_a_current_estimator() {
    let (plant, gains, domain) = sampled();
    let form = DirectForm::new(&plant, domain).unwrap();
    let gains = Gains { estimator: Estimator::Prediction, ..gains };
    let law = SlidingMode { rho: vec![3.0], delta: None };
    assert!(sliding_mode(&plant, &form, &gains, &law, 5.0).is_err());
    assert!(learning(&plant, &form, &gains, &Learning { kept: 0.9 }, 5.0).is_err());
    let law = FastAdaptive { sigma: 4.0, gamma: vec![10.0] };
    assert!(fast_adaptive(&plant, &form, &gains, &law, 5.0).is_err());
}

#[test]
fn a_sliding_mode_without_a_rate_of_decay_is_refused() {
    let (plant, gains, domain) = sampled();
    let form = DirectForm::new(&plant, domain).unwrap();
    let law = SlidingMode { rho: vec![3.0], delta: None };
    for rate in [f64::NAN, f64::INFINITY, 0.0, -5.0] {
        let refused = sliding_mode(&plant, &form, &gains, &law, rate);
        assert!(matches!(refused, Err(Error::OutOfRange { name: "rate", .. })), "{refused:?}");
    }
}

#[test]
fn the_mean_rate_of_equal_poles_is_their_rate_in_both_domains() {
    let m = DMatrix::from_diagonal_element(2, 2, -5.0);
    assert!((mean_rate(&m, Domain::Continuous).unwrap() - 5.0).abs() < 1e-12);
    let m = DMatrix::from_diagonal_element(2, 2, (-0.5_f64).exp());
    assert!((mean_rate(&m, Domain::Sampled { period: T }).unwrap() - 5.0).abs() < 1e-12);
}
