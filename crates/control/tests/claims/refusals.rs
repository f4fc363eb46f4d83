//! Invalid arguments: one matrix at a time, which the error must name.

use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant, repaired_gains};
use crate::{integers, matrix};
use control::StateSpace;
use control::aso::{FaultyPlant, design};
use control::controller::{closed_loop, controller};
use control::detectability::detectability;
use control::distance::{from_uncontrollable, from_unobservable};
use control::eigen::eigenvalues;
use control::exponential::exponential;
use control::faults::ExtendedPlant;
use control::hold::FirstOrderHold;
use control::losses::loss_tolerance;
use control::lyapunov::lyapunov;
use control::placement::{place, real_poles};
use control::rank::{controllability, observability, uncontrollable_modes, unobservable_modes};
use control::sampled::sample;
use control::theorem1::certify;
use control::zeros::zeros;
use control::{Domain, Error};
use nalgebra::DMatrix;

fn name_of<T: std::fmt::Debug>(result: Result<T, Error>) -> &'static str {
    match result.expect_err("a refusal") {
        Error::Shape { matrix, .. }
        | Error::NotFinite { matrix, .. }
        | Error::Empty { matrix, .. } => matrix,
        other => panic!("{other}"),
    }
}

#[test]
fn an_entry_that_is_not_a_number_is_named_in_every_matrix() {
    let bad = matrix(2, 2, &[0.0, 1.0, f64::NAN, 0.0]);
    let good = -DMatrix::identity(2, 2);
    let place_of = Error::NotFinite { matrix: "A", row: 2, col: 1, value: f64::INFINITY };
    assert_eq!(place_of.to_string(), "A[2,1] is inf, expected a finite number");
    assert_eq!(name_of(eigenvalues(&bad)), "A");
    assert_eq!(name_of(exponential(&bad)), "A");
    assert_eq!(name_of(lyapunov(&bad, &good)), "A");
    assert_eq!(name_of(lyapunov(&good, &bad)), "Q");
    assert_eq!(name_of(controllability(&bad, &good)), "A");
    assert_eq!(name_of(controllability(&good, &bad)), "B");
    assert_eq!(name_of(observability(&good, &bad)), "C");
    assert_eq!(name_of(uncontrollable_modes(&bad, &good)), "A");
    assert_eq!(name_of(unobservable_modes(&good, &bad)), "C");
    assert_eq!(name_of(from_uncontrollable(&good, &bad)), "B");
    assert_eq!(name_of(from_unobservable(&good, &bad)), "C");
    assert_eq!(name_of(zeros(&bad, &good, &good)), "A");
    assert_eq!(name_of(zeros(&good, &bad, &good)), "B");
    assert_eq!(name_of(zeros(&good, &good, &bad)), "C");
    assert_eq!(name_of(FirstOrderHold::new(&bad, &good, 1.0)), "A");
    assert_eq!(name_of(FirstOrderHold::new(&good, &bad, 1.0)), "B");
    assert_eq!(name_of(place(&bad, &good, &real_poles(&[-1.0, -2.0]))), "A");
    assert_eq!(name_of(place(&good, &bad, &real_poles(&[-1.0, -2.0]))), "B");
    assert_eq!(name_of(place(&good, &good, &real_poles(&[-1.0, f64::NAN]))), "poles");
}

#[test]
fn a_wrong_shape_is_reported_with_the_expected_one() {
    let (wide, tall, good) = (DMatrix::zeros(2, 3), DMatrix::zeros(3, 1), DMatrix::identity(2, 2));
    assert_eq!(name_of(eigenvalues(&wide)), "A");
    assert_eq!(name_of(exponential(&wide)), "A");
    assert_eq!(name_of(lyapunov(&good, &wide)), "Q");
    assert_eq!(name_of(controllability(&good, &tall)), "B");
    assert_eq!(name_of(observability(&good, &wide)), "C");
    let refused = FirstOrderHold::new(&good, &tall, 1.0);
    assert_eq!(refused, Err(Error::Shape { matrix: "B", expected: (2, 1), actual: (3, 1) }));
    assert_eq!(name_of(place(&good, &DMatrix::zeros(2, 0), &real_poles(&[-1.0, -2.0]))), "B");
    let refused = place(&good, &good, &real_poles(&[-1.0]));
    assert_eq!(refused, Err(Error::PoleCount { expected: 2, actual: 1 }));
}

#[test]
fn each_matrix_of_the_plant_and_of_the_gains_is_checked() {
    let zeros = DMatrix::zeros(3, 3);
    let of_plant = |plant: FaultyPlant| {
        name_of(design(&plant, &real_poles(&CONTROLLER_POLES), &real_poles(&OBSERVER_POLES), None))
    };
    assert_eq!(of_plant(FaultyPlant { a: DMatrix::zeros(4, 3), ..plant() }), "A");
    assert_eq!(of_plant(FaultyPlant { b: zeros.clone(), ..plant() }), "B");
    assert_eq!(of_plant(FaultyPlant { c: zeros.clone(), ..plant() }), "C");
    assert_eq!(of_plant(FaultyPlant { f_a: zeros.clone(), ..plant() }), "F_a");
    assert_eq!(of_plant(FaultyPlant { a_f: zeros.clone(), ..plant() }), "A_f");
    let refused = design(
        &plant(),
        &real_poles(&CONTROLLER_POLES),
        &real_poles(&OBSERVER_POLES),
        Some(&zeros),
    );
    assert_eq!(name_of(refused), "K_f");
    let mut gains = [repaired_gains(), repaired_gains(), repaired_gains(), repaired_gains()];
    gains[0].k_x = zeros.clone();
    gains[1].k_f = zeros.clone();
    gains[2].l_x = zeros.clone();
    gains[3].l_f = zeros;
    for (gains, name) in gains.iter().zip(["K_x", "K_f", "L_x", "L_f"]) {
        assert_eq!(name_of(certify(&plant(), gains, 1.0, 30.0)), name);
    }
}

#[test]
fn numbers_out_of_range_are_refused_with_the_rule() {
    let a = DMatrix::identity(2, 2);
    for h in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        let refused = FirstOrderHold::new(&a, &a, h);
        assert!(matches!(refused, Err(Error::OutOfRange { name: "h", .. })), "{refused:?}");
    }
    let refused = certify(&plant(), &repaired_gains(), -1.0, 30.0).unwrap_err();
    assert_eq!(refused.to_string(), "alpha is -1, expected a finite number above zero");
    let refused = certify(&plant(), &repaired_gains(), 1.0, 0.0).unwrap_err();
    assert_eq!(refused.to_string(), "beta is 0, expected a finite number above zero");
}

#[test]
fn a_controller_or_a_loss_that_does_not_fit_is_refused() {
    let plant = plant();
    let controller = controller(&plant, &repaired_gains(), Domain::Continuous).unwrap();
    let tolerance = |controller: &StateSpace, inputs: &[usize], largest: f64| {
        loss_tolerance(&plant, controller, inputs, largest)
    };
    let wrong = StateSpace { d: DMatrix::zeros(2, 2), ..controller.clone() };
    assert_eq!(name_of(tolerance(&wrong, &[0], 0.5)), "the controller's D");
    assert_eq!(name_of(closed_loop(&plant, &controller, &[1.0, 1.0])), "effectiveness");
    for (inputs, largest) in [(&[1][..], 0.5), (&[][..], 0.5), (&[0][..], 0.0), (&[0][..], 1.5)] {
        let refused = tolerance(&controller, inputs, largest);
        assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
    }
}

/// Entries from 1e-150 to 1e150: an answer or an error, never a panic or a run without end.
#[test]
fn entries_near_the_ends_of_the_range_end_in_an_answer_or_an_error() {
    for case in 0..40 {
        let wild = |rows: usize, cols: usize, seed: i32| {
            integers(rows, cols, |i, j| {
                (case * 13 + seed + 7 * i * i + 5 * i * j + 3 * j) % 31 - 15
            })
            .map(|k| k.signum() * (10.0 * k).exp2().powf(1.0 + k.abs() / 6.0))
        };
        let (a, b, f_a) = (wild(4, 4, 0), wild(4, 2, 1), wild(4, 1, 2));
        let finite = |m: DMatrix<f64>| assert!(m.iter().all(|entry| entry.is_finite()), "{m}");
        let identity = DMatrix::identity(4, 4);
        let _ = eigenvalues(&a)
            .map(|computed| assert!(computed.iter().all(|value| value.re.is_finite())));
        let _ = exponential(&a).map(finite);
        let _ = FirstOrderHold::new(&a, &b, 0.1).map(|hold| finite(hold.gamma_1));
        let _ = lyapunov(&a, &identity).map(|solution| finite(solution.p));
        let _ =
            place(&a, &b, &real_poles(&CONTROLLER_POLES)).map(|placement| finite(placement.gain));
        let plant = FaultyPlant::with_constant_faults(a, b, wild(2, 4, 3), f_a);
        let designed =
            design(&plant, &real_poles(&CONTROLLER_POLES), &real_poles(&OBSERVER_POLES), None);
        let _ = designed.map(|design| finite(design.gains.l_x));
        let _ = detectability(&plant, Domain::Continuous)
            .map(|computed| assert!(computed.zeros.finite.iter().all(|zero| zero.re.is_finite())));
        let _ = from_uncontrollable(&plant.a, &plant.b)
            .map(|computed| assert!(computed.lower <= computed.upper, "{computed:?}"));
        let _ = sample(&ExtendedPlant::without_filter(plant), 0.1).map(|plant| finite(plant.b));
    }
}
