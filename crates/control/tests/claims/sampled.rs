use crate::data::reference;
use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant};
use crate::{entry_error, matrix};
use control::aso::Estimator;
use control::aso::FaultyPlant;
use control::controller::controller;
use control::eigen::eigenvalues;
use control::faults::{ExtendedPlant, Fault, FaultEntry, FaultKind};
use control::hold::FirstOrderHold;
use control::placement::real_poles;
use control::sampled::{SampledDesign, design, sample, sampled_poles};
use control::{Domain, Error};
use nalgebra::{Complex, DMatrix, DVector};

/// Sample times from a tenth of a millisecond to ten.
const PERIODS: [f64; 7] = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2];

fn on_real_axis(continuous: &[f64], period: f64) -> Vec<f64> {
    in_z(continuous, period).iter().map(|z| z.re).collect()
}

fn in_z(continuous: &[f64], period: f64) -> Vec<Complex<f64>> {
    sampled_poles(&real_poles(continuous), period).expect("poles in range")
}

fn pendulum(period: f64, estimator: Estimator) -> SampledDesign {
    let extended = ExtendedPlant::without_filter(plant());
    let controller = in_z(&CONTROLLER_POLES, period);
    let observer = in_z(&OBSERVER_POLES, period);
    design(&extended, period, estimator, &controller, &observer, None).expect("a design")
}

/// [Phi, Gamma] of the states and the fault model.
fn joined(plant: &FaultyPlant) -> DMatrix<f64> {
    let ((n, m), q) = (plant.b.shape(), plant.a_f.nrows());
    let mut whole = DMatrix::zeros(n + q, n + q + m);
    whole.view_mut((0, 0), (n, n)).copy_from(&plant.a);
    whole.view_mut((0, n), (n, q)).copy_from(&plant.f_a);
    whole.view_mut((n, n), (q, q)).copy_from(&plant.a_f);
    whole.view_mut((0, n + q), (n, m)).copy_from(&plant.b);
    whole
}

#[test]
fn the_sampled_pendulum_is_that_of_scipy() {
    for (name, period) in [("pendulum_0", 1e-4), ("pendulum_1", 1e-2)] {
        let sampled = sample(&ExtendedPlant::without_filter(plant()), period).unwrap();
        let error = entry_error(&joined(&sampled), &reference(name));
        assert!(error < 1e-12, "{period}: {error:e}");
    }
}

#[test]
fn a_ramp_moves_inside_of_the_interval_as_in_scipy() {
    let (a, b, f_a) = (reference("ramp_a"), reference("ramp_b"), reference("ramp_f_a"));
    let fault = |at: usize| Fault {
        entry: FaultEntry::Actuator(f_a.column(at).into()),
        kind: FaultKind::Ramp,
    };
    let c = DMatrix::identity(3, 3);
    let extended = ExtendedPlant::new(&a, &b, &c, &[fault(0), fault(1)], &[]).unwrap();
    let sampled = sample(&extended, 0.25).unwrap();
    let expected = reference("ramp");
    assert!((joined(&sampled) - &expected).amax() < 1e-13 * expected.amax());
}

#[test]
fn a_sampled_plant_is_refused_for_another_sample_time() {
    let domain = Domain::Sampled { period: 0.1 };
    let extended = ExtendedPlant { domain, ..ExtendedPlant::without_filter(plant()) };
    assert_eq!(sample(&extended, 0.1).as_ref(), Ok(&extended.plant));
    let refused = sample(&extended, 0.2);
    assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
}

/// In closed form, for A = 0, w = 2, T = 1: `y_f` changes by 1 - e^-2 times y[k] - `y_f`[k].
#[test]
fn the_filter_runs_on_the_samples() {
    let one = matrix(1, 1, &[1.0]);
    let bias = Fault {
        entry: FaultEntry::Sensor(DVector::from_element(1, 3.0)),
        kind: FaultKind::Constant,
    };
    let extended =
        ExtendedPlant::new(&matrix(1, 1, &[0.0]), &one, &(&one * 5.0), &[bias], &[2.0]).unwrap();
    let sampled = sample(&extended, 1.0).unwrap();
    let kept = (-2.0_f64).exp();
    let expected = matrix(2, 2, &[1., 0., 5.0 * (1.0 - kept), kept]);
    assert!((sampled.a - expected).amax() < 1e-15);
    assert!((sampled.f_a - matrix(2, 1, &[0.0, 3.0 * (1.0 - kept)])).amax() < 1e-15);
    assert_eq!((sampled.b[0], sampled.b[1].to_bits(), sampled.a_f[0]), (1.0, 0, 1.0));
}

#[test]
fn the_pendulum_is_stable_at_every_sample_time() {
    for period in PERIODS {
        for estimator in [Estimator::Prediction, Estimator::Current] {
            let actual = pendulum(period, estimator);
            let slowest = (-4.5 * period).exp();
            assert!((actual.radius - slowest).abs() < 1e-6 * (1.0 - slowest) + 1e-9, "{actual:?}");
            assert!(actual.observer.pole_error < 1e-6 && actual.observer.balanced_condition < 1e6);
        }
    }
}

/// The friction as a ramp, with one more pole.
fn pendulum_with_ramp(period: f64) -> SampledDesign {
    let FaultyPlant { a, b, c, f_a, .. } = plant();
    let friction =
        Fault { entry: FaultEntry::Actuator(f_a.column(0).into()), kind: FaultKind::Ramp };
    let extended = ExtendedPlant::new(&a, &b, &c, &[friction], &[]).expect("shapes that fit");
    let controller = in_z(&CONTROLLER_POLES, period);
    let observer = in_z(&[&OBSERVER_POLES[..], &[-2500.0]].concat(), period);
    design(&extended, period, Estimator::Current, &controller, &observer, None).expect("a design")
}

/// The sum over all samples of `K_f` eps - `K_x` e after a step of the fault, by the recursion of
/// the error.
fn impulse_of_a_step(design: &SampledDesign) -> f64 {
    let (a_0, c_0) = (design.plant.augmented_dynamics(), design.plant.augmented_output());
    let order = a_0.nrows();
    let corrected = DMatrix::identity(order, order) - design.gains.observer_gain() * c_0;
    let mut error = DVector::zeros(order);
    error[4] = -1.0;
    let (k_x, k_f) = (&design.gains.k_x, &design.gains.k_f);
    let mut sum = 0.0;
    for _ in 0..1000 {
        let now = &corrected * &error;
        sum += (k_f * now.rows(4, order - 4) - k_x * now.rows(0, 4))[0];
        error = &a_0 * now;
    }
    sum
}

/// In samples times the step: the constant model lacks force after the step, the ramp model makes
/// up for it.
#[test]
fn a_step_of_the_fault_leaves_an_impulse_unless_the_model_is_a_ramp() {
    for period in PERIODS {
        let constant = impulse_of_a_step(&pendulum(period, Estimator::Current));
        let ramp = impulse_of_a_step(&pendulum_with_ramp(period));
        assert!(constant < -1.5, "{period}: {constant}");
        assert!(ramp.abs() < 0.02, "{period}: {ramp}");
    }
}

#[test]
fn the_pendulum_with_a_ramp_model_is_stable_at_every_sample_time() {
    for period in PERIODS {
        let actual = pendulum_with_ramp(period);
        assert!((actual.radius - (-4.5 * period).exp()).abs() < 1e-7, "{actual:?}");
        assert!((actual.gains.k_f[(0, 1)] - 0.5 * period).abs() < 1e-15, "{actual:?}");
        assert!(actual.observer.pole_error < 1e-6, "{actual:?}");
    }
}

/// e[k+1] = (I - M `C_0`) `A_0` e[k], formed here from the controller's equations for u = 0.
#[test]
fn the_estimation_error_has_the_required_eigenvalues() {
    for period in [1e-4, 1e-3, 1e-2] {
        let actual = pendulum(period, Estimator::Current);
        let (a_0, c_0) = (actual.plant.augmented_dynamics(), actual.plant.augmented_output());
        let m = actual.gains.observer_gain();
        let error = (DMatrix::identity(5, 5) - m * c_0) * a_0;
        let mut required = on_real_axis(&OBSERVER_POLES, period);
        required.sort_by(f64::total_cmp);
        for (reached, required) in eigenvalues(&error).unwrap().iter().zip(required) {
            assert!(
                (reached - required).norm() < 1e-5 * required,
                "{period}: {reached} {required}"
            );
        }
    }
}

/// The error of the predicted fault and the largest state after a number of samples: the plant by
/// its exact solution between samples, the controller by its equations.
fn run(
    extended: &ExtendedPlant,
    design: &SampledDesign,
    (b, f_a): (&DMatrix<f64>, &DMatrix<f64>),
    (f0, f1): (f64, f64),
    samples: u32,
) -> (f64, f64) {
    let n = extended.states;
    let equations =
        controller(&design.plant, &design.gains, Domain::Sampled { period: design.period })
            .expect("gains that fit");
    let inputs = DMatrix::from_columns(&[b.column(0), f_a.column(0)]);
    let a: DMatrix<f64> = extended.plant.a.view((0, 0), (n, n)).into();
    let hold = FirstOrderHold::new(&a, &inputs, design.period).expect("a hold");
    let (mut x, mut z) = (DVector::from_element(n, 0.01), DVector::zeros(equations.a.nrows()));
    for step in 0..samples {
        let t = design.period * f64::from(step);
        let y = &extended.plant.c * &x;
        let u = (&equations.c * &z + &equations.d * &y)[0];
        z = &equations.a * z + &equations.b * y;
        let mut next = DVector::zeros(n);
        let (w0, w1) = ([u, f0 + f1 * t], [0.0, f1]);
        hold.step_into(x.as_slice(), &w0, &w1, next.as_mut_slice()).expect("lengths that fit");
        x = next;
    }
    let end = f0 + f1 * design.period * f64::from(samples);
    ((z[n] - end).abs(), x.amax())
}

#[test]
fn constant_and_ramp_faults_are_estimated_in_the_sampled_loop() {
    let FaultyPlant { a, b, c, f_a, .. } = plant();
    for (kind, slope) in [(FaultKind::Constant, 0.0), (FaultKind::Ramp, 2.0)] {
        let friction = Fault { entry: FaultEntry::Actuator(f_a.column(0).into()), kind };
        let extended = ExtendedPlant::new(&a, &b, &c, &[friction], &[]).unwrap();
        for estimator in [Estimator::Prediction, Estimator::Current] {
            let period = 2e-3;
            let observer: Vec<f64> =
                [-50., -60., -70., -80., -90., -100.][..4 + extended.plant.f_a.ncols()].into();
            let actual = design(
                &extended,
                period,
                estimator,
                &in_z(&CONTROLLER_POLES, period),
                &in_z(&observer, period),
                None,
            );
            let (error, state) = run(&extended, &actual.unwrap(), (&b, &f_a), (5.0, slope), 2500);
            assert!(error < 1e-6, "{kind:?} {estimator:?}: {error:e}");
            assert!(state < 1e-4, "{kind:?} {estimator:?}: {state:e}");
        }
    }
}

/// Poles that would all be zero in double precision keep enough distance to be placed.
#[test]
fn fast_poles_are_slowed_in_order_and_slow_ones_are_not() {
    let actual = on_real_axis(&[-1e6, -1e5, -2e3, -50.0, -1.0], 1e-2);
    assert!(actual.windows(2).all(|pair| pair[0] < 0.99 * pair[1]), "{actual:?}");
    assert!((actual[0] - (-4.0_f64).exp()).abs() < 1e-15);
    assert!((actual[3] - (-0.5_f64).exp()).abs() < 1e-15);
    let turning = sampled_poles(&[Complex::new(-1.0, 100.0)], 1e-2).unwrap();
    assert!((turning[0] - Complex::new(-0.01, 1.0).exp()).norm() < 1e-15);
    let aliased = sampled_poles(&[Complex::new(-1.0, 400.0)], 1e-2);
    assert!(matches!(aliased, Err(Error::OutOfRange { name: "Im(p) T", .. })), "{aliased:?}");
    assert!(matches!(
        sampled_poles(&[], 0.0),
        Err(Error::OutOfRange { name: "the sample time", .. })
    ));
}
