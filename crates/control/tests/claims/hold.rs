use crate::recorded::cases;
use crate::reference::{
    CONTROLLER, CONTROLLER_PICOSECOND, CONTROLLER_SECOND, CONTROLLER_TENTH_MILLISECOND,
    MEASUREMENTS,
};
use crate::{integers, matrix};
use control::Error;
use control::hold::{FirstOrderHold, continuous, zero_order_hold};
use nalgebra::{DMatrix, DVector};

/// Natural units of the controller's states; its entries are proportional to powers of 1800 / s.
const UNITS: [f64; 5] = [1.0, 1.0, 1800.0, 1800.0, 3_240_000.0];

fn controller(h: f64) -> FirstOrderHold {
    FirstOrderHold::new(&matrix(5, 5, &CONTROLLER), &matrix(5, 2, &MEASUREMENTS), h)
        .expect("the discretisation exists")
}

/// Largest distance in natural units, relative to the largest entry of the expected block.
fn error_in_units(actual: &DMatrix<f64>, expected: &DMatrix<f64>, inputs_are_states: bool) -> f64 {
    let scaled = |m: &DMatrix<f64>| {
        DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
            m[(i, j)] / UNITS[i] * if inputs_are_states { UNITS[j] } else { 1.0 }
        })
    };
    (scaled(actual) - scaled(expected)).amax() / scaled(expected).amax()
}

fn assert_agrees(hold: &FirstOrderHold, expected: &DMatrix<f64>, allowed: f64) {
    let block = |from: usize, cols: usize| expected.columns(from, cols).into();
    let errors = [
        error_in_units(&hold.phi, &block(0, 5), true),
        error_in_units(&hold.gamma_0, &block(5, 2), false),
        error_in_units(&hold.gamma_1, &block(7, 2), false),
    ];
    assert!(errors.iter().all(|&error| error < allowed), "{errors:?}");
}

#[test]
fn the_controller_agrees_with_high_precision_at_a_picosecond() {
    assert_agrees(&controller(1e-12), &matrix(5, 9, &CONTROLLER_PICOSECOND), 1e-15);
}

#[test]
fn the_controller_agrees_with_high_precision_at_a_tenth_of_a_millisecond() {
    assert_agrees(&controller(1e-4), &matrix(5, 9, &CONTROLLER_TENTH_MILLISECOND), 1e-14);
}

/// A step of one second is thousands of time constants long.
#[test]
fn the_controller_agrees_with_high_precision_at_a_second() {
    assert_agrees(&controller(1.0), &matrix(5, 9, &CONTROLLER_SECOND), 1e-12);
}

#[test]
fn two_half_steps_are_a_whole_one() {
    for h in [1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.1, 1.0] {
        let (half, whole) = (controller(h / 2.0), controller(h));
        let phi = &half.phi * &half.phi;
        let gamma_0 = &half.phi * &half.gamma_0 + &half.gamma_0;
        let late = &half.gamma_0 * (h / 2.0) + &half.gamma_1;
        let gamma_1 = &half.phi * &half.gamma_1 + late;
        let error = error_in_units(&phi, &whole.phi, true)
            .max(error_in_units(&gamma_0, &whole.gamma_0, false))
            .max(error_in_units(&gamma_1, &whole.gamma_1, false));
        assert!(error < 1e-14, "h = {h}: {error:e}");
    }
}

/// x'' = w with w = w0 + w1 t: position and velocity by integration.
#[test]
fn a_double_integrator_moves_by_powers_of_the_step() {
    let h = 0.25;
    let hold = FirstOrderHold::new(&matrix(2, 2, &[0., 1., 0., 0.]), &matrix(2, 1, &[0., 1.]), h);
    let hold = hold.unwrap();
    let mut out = [0.0; 2];
    hold.step_into(&[1.0, 2.0], &[3.0], &[4.0], &mut out).unwrap();
    let position = 1.0 + 2.0 * h + 3.0 * h * h / 2.0 + 4.0 * h * h * h / 6.0;
    let velocity = 2.0 + 3.0 * h + 4.0 * h * h / 2.0;
    assert!((out[0] - position).abs() < 1e-15 && (out[1] - velocity).abs() < 1e-15, "{out:?}");
}

/// x(t) = c + d t solves x' = A x + B w exactly when B w(t) = d - A c - A d t.
#[test]
fn a_straight_solution_is_followed_exactly() {
    let a = integers(4, 4, |i, j| (3 * i * i + 2 * i * j + j) % 7 - 3);
    let (c, d) = ([1.0, -2.0, 0.5, 3.0], [0.3, 0.1, -0.7, 2.0]);
    let (c, d) = (matrix(4, 1, &c), matrix(4, 1, &d));
    let (w0, w1) = (&d - &a * &c, -(&a * &d));
    let hold = FirstOrderHold::new(&a, &DMatrix::identity(4, 4), 0.7).unwrap();
    let mut out = [0.0; 4];
    hold.step_into(c.as_slice(), w0.as_slice(), w1.as_slice(), &mut out).unwrap();
    let error = (matrix(4, 1, &out) - (&c + &d * 0.7)).amax();
    assert!(error < 1e-12 * hold.phi.amax().max(1.0), "{error:e}");
}

/// Sizes below, at and above the largest that is multiplied in registers, compared with nalgebra's
/// products.
#[test]
fn a_step_of_any_order_is_the_sum_of_the_products() {
    for n in 1..=12 {
        let entry = |i: usize, j: usize| {
            f64::from(u32::try_from(5 * i + 3 * j + i * j).unwrap() % 11) - 5.0
        };
        let vector = |size, factor| DMatrix::from_fn(size, 1, |i, _| factor * entry(i, i + 2));
        let (a, b) = (DMatrix::from_fn(n, n, entry), DMatrix::from_fn(n, 2, entry));
        let hold = FirstOrderHold::new(&a, &b, 0.01).unwrap();
        let (x, w0, w1) = (vector(n, 0.7), vector(2, 1.3), vector(2, -2.1));
        let mut out = vec![f64::NAN; n];
        hold.step_into(x.as_slice(), w0.as_slice(), w1.as_slice(), &mut out).unwrap();
        let expected = &hold.phi * &x + &hold.gamma_0 * &w0 + &hold.gamma_1 * &w1;
        let error = (matrix(n, 1, &out) - &expected).amax();
        assert!(error <= 1e-14 * expected.amax().max(1.0), "n = {n}: {error:e}");
    }
}

#[test]
fn a_wrong_length_is_refused_and_leaves_the_output_untouched() {
    let hold = controller(1e-3);
    let mut out = [7.0; 5];
    let wrong = hold.step_into(&[0.0; 5], &[0.0; 2], &[0.0; 3], &mut out);
    assert_eq!(wrong, Err(Error::Shape { matrix: "w1", expected: (2, 1), actual: (3, 1) }));
    assert_eq!(out.map(f64::to_bits), [7.0_f64.to_bits(); 5]);
}

/// `SciPy` writes its first-order hold for the state x - `Gamma_1` w / h.
#[test]
fn holds_agree_with_scipy() {
    for case in cases(include_str!("../data/riccati.txt"), "hold") {
        let (a, b, c, h) = (case.get("A"), case.get("B"), case.get("C"), case.number("h"));
        let near = |computed: &DMatrix<f64>, name: &str| {
            let error = (computed - case.get(name)).amax() / case.get(name).amax();
            assert!(error < 1e-12, "{} {name}: {error:e}", case.name);
        };
        let (phi, gamma) = zero_order_hold(a, b, h).unwrap();
        near(&phi, "phi");
        near(&gamma, "gamma");
        let first = FirstOrderHold::new(a, b, h).unwrap();
        let ramp = &first.gamma_1 / h;
        near(&(&first.gamma_0 - &ramp + &first.phi * &ramp), "foh_b");
        near(&(c * ramp), "foh_d");
    }
}

#[test]
fn the_zero_order_hold_is_the_first_order_hold_without_slope() {
    let (a, b) = (matrix(5, 5, &CONTROLLER), matrix(5, 2, &MEASUREMENTS));
    for h in [1e-12, 1e-6, 1e-3, 1.0] {
        let (phi, gamma) = zero_order_hold(&a, &b, h).unwrap();
        let first = controller(h);
        assert!(error_in_units(&phi, &first.phi, true) < 1e-14);
        assert!(error_in_units(&gamma, &first.gamma_0, false) < 1e-14);
    }
}

#[test]
fn the_continuous_plant_of_samples_is_the_one_that_was_sampled() {
    let a = matrix(3, 3, &[-1e-3, 1.0, 0.0, -40.0, -0.4, 2.0, 0.0, 0.0, 0.0]);
    let b = matrix(3, 2, &[0.0, 1e4, 5.0, 0.0, 0.0, 1e-4]);
    for h in [1e-4, 0.05, 0.4] {
        let (phi, gamma) = zero_order_hold(&a, &b, h).unwrap();
        let (computed, input) = continuous(&phi, &gamma, h).unwrap();
        assert!((&computed - &a).amax() < 1e-10 * a.amax() / h, "{h}: {computed}");
        assert!((&input - &b).amax() < 1e-10 * b.amax() / h, "{h}: {input}");
    }
}

/// With x = S `x_s` and u = k `u_s` the matrices of the same plant are S^-1 A S and k S^-1 B.
#[test]
fn the_continuous_plant_does_not_depend_on_the_units_of_states_and_inputs() {
    let a = matrix(3, 3, &[-1e-3, 1.0, 0.0, -40.0, -0.4, 2.0, 0.0, 0.0, 0.0]);
    let b = matrix(3, 2, &[0.0, 1.0, 5.0, 0.0, 0.0, 1.0]);
    for h in [1e-4, 0.05, 0.4] {
        let (phi, gamma) = zero_order_hold(&a, &b, h).unwrap();
        for (unit, factor) in [(1.0, 1e-9), (1.0, 1e9), (1e9, 1.0)] {
            let s = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, unit, 1.0 / unit]));
            let inverse = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0 / unit, unit]));
            let (phi, gamma) = (&inverse * &phi * &s, &inverse * &gamma * factor);
            let (computed, input) = continuous(&phi, &gamma, h).unwrap();
            let error = (&s * computed * &inverse - &a).amax() / a.amax();
            let input_error = (&s * input / factor - &b).amax() / b.amax();
            assert!(error < 1e-11 && input_error < 1e-11, "{h} {unit} {factor}: {error:e}");
        }
    }
}

#[test]
fn samples_with_an_eigenvalue_that_is_negative_or_zero_have_no_continuous_plant() {
    for eigenvalue in [-0.3, 0.0] {
        let one = matrix(1, 1, &[1.0]);
        let computed = continuous(&matrix(1, 1, &[eigenvalue]), &one, 0.1);
        assert_eq!(computed, Err(Error::NoContinuousPlant));
    }
}
