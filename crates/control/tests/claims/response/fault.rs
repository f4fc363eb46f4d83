//! The loop of the paper under its friction, compared with other software and with the simulation.

use super::{CONTINUOUS, RECORDED};
use crate::paper::CONTROLLER_POLES;
use crate::recorded::{Case, cases};
use control::aso::{Estimator, FaultyPlant, Gains};
use control::controller::{closed_loop, controller};
use control::faults::ExtendedPlant;
use control::hold::zero_order_hold;
use control::placement::real_poles;
use control::response::{
    fault_bounds, fault_gains, fault_rate_system, fault_system, peak_gain, reversal, step_response,
};
use control::sampled::{design, sampled_poles};
use control::{Domain, Error};
use nalgebra::{DMatrix, DVector};

/// Static friction of the paper in N.
const STATIC: f64 = 30.0;
/// Largest rate of the friction in the simulation while the cart sticks, in N/s.
const RATE: f64 = 521.0;
/// Half of the peak-to-peak values of cart, pendulum and their velocities after compensation, in SI
/// units, and the largest errors x - `x_hat` and f - `f_hat`. Cart and pendulum are as in the
/// README's table; the rest is from `aso-ftc run --step 2e-5 --record-every 2e-5 --stop-time 22
/// --set controller.t_on=1`, t > 14 s.
const AMPLITUDES: [f64; 4] = [0.9619e-3, 1.754e-3, 9.989e-3, 20.50e-3];
const STATE_ERRORS: [f64; 4] = [3.437e-8, 7.224e-8, 1.631e-4, 4.603e-4];
const FAULT_ERROR: f64 = 0.8809;

fn ratios(bounds: impl Iterator<Item = f64>, simulated: &[f64]) -> Vec<f64> {
    bounds.zip(simulated).map(|(bound, simulated)| bound / simulated).collect()
}

fn paper() -> (FaultyPlant, Gains, Case) {
    let case = cases(RECORDED, "loop").remove(0);
    let get = |name| case.get(name).clone();
    let plant = FaultyPlant::with_constant_faults(get("A"), get("B"), get("C"), get("F_a"));
    let (k_x, k_f, l_x, l_f) = (get("K_x"), get("K_f"), get("L_x"), get("L_f"));
    (
        plant,
        Gains { estimator: Estimator::Prediction, k_x, k_f, l_x, l_f, p_f: None, integral: None },
        case,
    )
}

#[test]
fn the_gains_of_the_loop_agree_with_modal_decomposition_in_high_precision() {
    let (plant, gains, case) = paper();
    let from_fault = peak_gain(&fault_system(&plant, &gains, CONTINUOUS).unwrap(), 1e-3).unwrap();
    let from_rate = fault_rate_system(&plant, &gains, CONTINUOUS).unwrap();
    let from_rate = peak_gain(&from_rate, 1e-3).unwrap();
    let rows: Vec<usize> = (0..from_fault.upper.nrows()).collect();
    let together = fault_gains(&plant, &gains, CONTINUOUS, &rows, 1e-3).unwrap();
    // Fewer outputs than inputs: by the system itself, in place of the dual one.
    let some = fault_gains(&plant, &gains, CONTINUOUS, &rows[2..4], 1e-3).unwrap();
    for (some, all) in some.iter().zip(&together) {
        assert!((some - all.rows(2, 2)).amax() <= 1.1e-3 * all.amax());
    }
    assert!(fault_gains(&plant, &gains, CONTINUOUS, &[rows.len()], 1e-3).is_err());
    let [of_fault, of_rate, uncancelled] = together;
    assert!((of_fault - &from_fault.upper).amax() <= 1e-12 * from_fault.upper.amax());
    for (together, column) in [(of_rate, 0), (uncancelled, 1)] {
        let alone = from_rate.upper.column(column);
        assert!((together - alone).amax() <= 1e-12 * from_rate.upper.amax(), "input {column}");
    }
    for (name, computed) in [("gain_f", from_fault), ("gain_r", from_rate)] {
        for (output, &exact) in case.get(name).iter().enumerate() {
            let (lower, upper) = (computed.lower[(output, 0)], computed.upper[(output, 0)]);
            assert!(lower <= exact * 1.0001 && upper >= exact * 0.9999, "{name} {output}");
            assert!(upper <= lower * 1.0011, "{name} {output}: {lower:e} to {upper:e}");
        }
    }
}

#[test]
fn the_reversal_agrees_with_modal_decomposition_in_high_precision() {
    let (plant, gains, case) = paper();
    let jump = reversal(&plant, &gains, CONTINUOUS, 0, 1.0, None, 0.02).unwrap();
    let ramp = reversal(&plant, &gains, CONTINUOUS, 0, 60.0, Some(RATE), 0.02).unwrap();
    for (name, computed) in [("step", jump), ("ramp", ramp)] {
        let all =
            computed.states.iter().chain(&computed.state_errors).chain(&computed.fault_errors);
        for (output, (transient, exact)) in all.zip(case.get(name).iter()).enumerate() {
            let error = (transient.peak.abs() / exact - 1.0).abs();
            assert!(error < 1e-4, "{name} {output}: {transient:?} {exact}");
        }
    }
}

/// Without a rate the error of the fault estimate is that of the jump, and no other bound exists.
#[test]
fn a_reversal_of_friction_as_a_jump_predicts_the_residual_within_a_factor_of_three() {
    let (plant, gains, _) = paper();
    let turn = reversal(&plant, &gains, CONTINUOUS, 0, 2.0 * STATIC, None, 0.02).unwrap();
    let ratios = ratios(turn.states.iter().map(|state| state.peak.abs()), &AMPLITUDES);
    assert!(ratios[..3].iter().all(|ratio| (1.0..3.0).contains(ratio)), "{ratios:?}");
    assert!(ratios[3] > 3.0, "{ratios:?}");
    assert!(turn.states[0].peak.abs() < 1.3 * AMPLITUDES[0]);
    assert!(turn.states[1].peak.abs() < 1.5 * AMPLITUDES[1]);
    assert!((turn.fault_errors[0].peak + 2.0 * STATIC).abs() < 1e-9);
    assert!(turn.fault_errors[0].settling_time < 0.01);
    assert!(turn.states[0].settling_time > 0.3 && turn.states[0].settling_time < 3.0);
}

#[test]
fn a_reversal_at_the_rate_of_the_simulation_predicts_every_quantity_within_a_quarter() {
    let (plant, gains, _) = paper();
    let turn = reversal(&plant, &gains, CONTINUOUS, 0, 2.0 * STATIC, Some(RATE), 0.02).unwrap();
    let states = ratios(turn.states.iter().map(|state| state.peak.abs()), &AMPLITUDES);
    assert!(states.iter().all(|ratio| (0.8..1.25).contains(ratio)), "{states:?}");
    let errors = ratios(turn.state_errors.iter().map(|error| error.peak.abs()), &STATE_ERRORS);
    assert!(errors.iter().all(|ratio| (0.99..1.01).contains(ratio)), "{errors:?}");
    let ratio = turn.fault_errors[0].peak.abs() / FAULT_ERROR;
    assert!((0.99..1.01).contains(&ratio), "{ratio}");
}

/// Upper bounds that exceed the simulated values by at most a factor of three: positions from the
/// magnitude of the fault alone, errors from its rate. The tolerance of 1 % allows for the rate,
/// which is rounded to 521 N/s, and for the jump of the friction by 0.07 N when the cart stops.
#[test]
fn the_bounds_exceed_the_simulated_peaks_by_less_than_a_factor_of_three() {
    let (plant, gains, _) = paper();
    let slow = fault_bounds(&plant, &gains, CONTINUOUS, &[STATIC], &[RATE]).unwrap();
    let any = fault_bounds(&plant, &gains, CONTINUOUS, &[STATIC], &[f64::INFINITY]).unwrap();
    let from_magnitude = ratios(any.states.iter().copied(), &AMPLITUDES);
    assert!(from_magnitude[..2].iter().all(|x| (1.0..3.0).contains(x)), "{from_magnitude:?}");
    let from_both = ratios(slow.states.iter().copied(), &AMPLITUDES);
    assert!(from_both[2..].iter().all(|x| (1.0..4.0).contains(x)), "{from_both:?}");
    assert!(from_magnitude[2..].iter().all(|&x| x > 4.0), "{from_magnitude:?}");
    let errors = ratios(slow.state_errors.iter().copied(), &STATE_ERRORS);
    assert!(errors.iter().all(|x| (0.99..1.02).contains(x)), "{errors:?}");
    let errors = ratios(any.state_errors.iter().copied(), &STATE_ERRORS);
    assert!(errors.iter().all(|&x| x > 40.0), "{errors:?}");
    let ratio = slow.fault_errors[0] / FAULT_ERROR;
    assert!((0.99..1.02).contains(&ratio), "{ratio}");
    assert!((any.fault_errors[0] / (2.0 * STATIC) - 1.0).abs() < 2e-3);
}

/// The worst fault by the bound, f = F sign(h(T - t)), reaches the bound at T.
#[test]
fn the_bound_of_the_cart_is_reached_by_the_worst_friction() {
    let (plant, gains, _) = paper();
    let system = fault_system(&plant, &gains, CONTINUOUS).unwrap();
    let bounds = fault_bounds(&plant, &gains, CONTINUOUS, &[STATIC], &[f64::INFINITY]).unwrap();
    let (phi, gamma) = zero_order_hold(&system.a, &system.b, 1e-4).unwrap();
    let steps = 40_000;
    let mut response = gamma.clone();
    let mut reached = 0.0;
    for _ in 0..steps {
        reached += STATIC * response[0].abs();
        response = &phi * response;
    }
    assert!(reached <= bounds.states[0] && reached > 0.998 * bounds.states[0], "{reached:e}");
}

/// The same loop with a short sample time: constant fault, prediction estimator with the exact
/// error dynamics.
#[test]
fn a_fast_sampled_loop_tends_to_the_continuous_one() {
    let one = |value| DMatrix::from_element(1, 1, value);
    let plant = |a, b: f64| FaultyPlant::with_constant_faults(one(a), one(b), one(1.0), one(-b));
    let gains = |l_x: f64, l_f: f64| Gains {
        estimator: Estimator::Prediction,
        k_x: DMatrix::from_element(1, 1, -2.0),
        k_f: DMatrix::identity(1, 1),
        l_x: DMatrix::from_element(1, 1, l_x),
        l_f: DMatrix::from_element(1, 1, l_f),
        p_f: None,
        integral: None,
    };
    let slow = reversal(&plant(0.5, 1.0), &gains(10.0, -20.0), CONTINUOUS, 0, 2.0, None, 0.05);
    let slow = slow.unwrap();
    let h = 1e-4;
    let system = fault_system(&plant(0.5, 1.0), &gains(10.0, -20.0), CONTINUOUS).unwrap();
    let sampled = control::StateSpace {
        a: DMatrix::identity(3, 3) + &system.a * h,
        b: &system.b * h,
        domain: Domain::Sampled { period: h },
        ..system
    };
    let trace = step_response(&sampled, 0).unwrap();
    for output in 0..3 {
        let computed = trace.transient(output, 0.05);
        let exact = [slow.states[0], slow.state_errors[0], slow.fault_errors[0]][output];
        assert!((computed.peak * 2.0 / exact.peak - 1.0).abs() < 2e-3, "{computed:?} {exact:?}");
        assert!((computed.settling_time / exact.settling_time - 1.0).abs() < 5e-2);
    }
}

/// The loop of errors, compared with the plant and the controller's own equations at every sample.
#[test]
fn the_sampled_loop_of_either_estimator_is_that_of_plant_and_controller() {
    let extended = ExtendedPlant::without_filter(crate::paper::plant());
    let period = 2e-3;
    let in_z = |required: &[f64]| sampled_poles(&real_poles(required), period).unwrap();
    for estimator in [Estimator::Prediction, Estimator::Current] {
        let (k, l) = (in_z(&CONTROLLER_POLES), in_z(&[-50., -60., -70., -80., -90.]));
        let computed = design(&extended, period, estimator, &k, &l, None).unwrap();
        let (plant, gains) = (&computed.plant, &computed.gains);
        let domain = Domain::Sampled { period };
        let controller = controller(plant, gains, domain).unwrap();
        let whole = closed_loop(plant, &controller, &[1.0]).unwrap();
        let system = fault_system(plant, gains, domain).unwrap();
        let (mut both, mut state) = (DVector::zeros(9), DVector::zeros(9));
        let (mut largest, mut difference) = (0.0_f64, 0.0_f64);
        for _ in 0..2000 {
            both = &whole * both;
            let mut x = both.rows_mut(0, 4);
            x += &plant.f_a;
            state = &system.a * state + &system.b;
            largest = largest.max(both.rows(0, 4).amax());
            difference = difference.max((both.rows(0, 4) - state.rows(0, 4)).amax());
        }
        assert!(difference < 1e-9 * largest, "{estimator:?}: {difference:e} of {largest:e}");
        // The estimate converges to the fault.
        assert!((state[8] - 1.0).abs() < 1e-9, "{}", state[8]);
    }
}

#[test]
fn bad_arguments_are_named() {
    let (plant, gains, _) = paper();
    let bounds = |magnitudes: &[f64], rates: &[f64]| {
        fault_bounds(&plant, &gains, CONTINUOUS, magnitudes, rates).unwrap_err()
    };
    let refused = bounds(&[1.0, 2.0], &[1.0]);
    assert_eq!(refused, Error::Shape { matrix: "magnitudes", expected: (1, 1), actual: (2, 1) });
    assert!(matches!(bounds(&[0.0], &[1.0]), Error::OutOfRange { name: "magnitude", .. }));
    assert!(matches!(bounds(&[1.0], &[f64::NAN]), Error::OutOfRange { name: "rate", .. }));
    let turn = |fault: usize, change: f64, rate: f64, fraction: f64| {
        reversal(&plant, &gains, CONTINUOUS, fault, change, Some(rate), fraction).unwrap_err()
    };
    assert!(matches!(turn(1, 1.0, 1.0, 0.1), Error::OutOfRange { name: "input", .. }));
    assert!(matches!(turn(0, -1.0, 1.0, 0.1), Error::OutOfRange { name: "change", .. }));
    assert!(matches!(turn(0, 1.0, f64::NAN, 0.1), Error::OutOfRange { name: "rate", .. }));
    assert!(matches!(turn(0, 1.0, 1.0, 0.0), Error::OutOfRange { name: "fraction", .. }));
}
