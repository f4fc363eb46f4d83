#![expect(clippy::unwrap_used, reason = "tests")]

use crate::matrix;
use control::bandwidth::{ByBandwidth, NaturalUnits, filter, regulator};
use control::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix, DVector};

/// Two carts on a spring, the first one driven, both positions measured: a rigid and an undamped mode.
fn carts() -> StateSpace {
    StateSpace {
        a: matrix(4, 4, &[0., 0., 1., 0., 0., 0., 0., 1., -4., 4., 0., 0., 1., -1., 0., 0.]),
        b: matrix(4, 1, &[0., 0., 2., 0.]),
        c: matrix(2, 4, &[1., 0., 0., 0., 0., 1., 0., 0.]),
        d: DMatrix::zeros(2, 1),
        domain: Domain::Continuous,
    }
}

/// |K (s I - A)^-1 B| for one input, by a complex factorisation of nalgebra.
fn loop_gain(a: &DMatrix<f64>, b: &DMatrix<f64>, k: &DMatrix<f64>, s: Complex<f64>) -> f64 {
    let complex = |m: &DMatrix<f64>| m.map(|entry| Complex::new(entry, 0.0));
    let pencil = DMatrix::identity(a.nrows(), a.nrows()) * s - complex(a);
    (complex(k) * pencil.lu().solve(&complex(b)).unwrap())[(0, 0)].norm()
}

#[test]
fn an_integrator_has_the_bandwidth_as_its_gain() {
    let (zero, one) = (DMatrix::zeros(1, 1), DMatrix::from_element(1, 1, 1.0));
    for rate in [1e-3, 0.7, 40.0] {
        let units = DVector::repeat(1, 1.0);
        let actual = regulator(&zero, &one, &one, &units, rate, Domain::Continuous).unwrap();
        assert!((actual.result.gain[(0, 0)] / -rate - 1.0).abs() < 1e-5, "{rate}");
        let actual = filter(&zero, &one, &one, &units, rate, Domain::Continuous).unwrap();
        assert!((actual.result.gain[(0, 0)] / rate - 1.0).abs() < 1e-5, "{rate}");
    }
}

#[test]
fn the_loop_gain_is_one_at_the_bandwidth() {
    let StateSpace { a, b, c, .. } = carts();
    let q = c.tr_mul(&c);
    for rate in [0.3, 3.0, 30.0] {
        let actual = regulator(&a, &b, &q, &DVector::repeat(1, 5.0), rate, Domain::Continuous);
        let ByBandwidth { result, loop_gain: stated, .. } = actual.unwrap();
        let gain = loop_gain(&a, &b, &result.gain, Complex::new(0.0, rate));
        assert!((gain - 1.0).abs() < 1e-5 && (gain - stated).abs() < 1e-9, "{rate}: {gain}");
    }
}

#[test]
fn the_loop_gain_of_a_sampled_regulator_is_one_on_the_unit_circle() {
    let StateSpace { a, b, c, .. } = carts();
    let (period, rate): (f64, f64) = (0.01, 3.0);
    let (a, b) = control::hold::zero_order_hold(&a, &b, period).unwrap();
    let domain = Domain::Sampled { period };
    let actual = regulator(&a, &b, &c.tr_mul(&c), &DVector::repeat(1, 1.0), rate, domain).unwrap();
    let at = Complex::from_polar(1.0, rate * period);
    let gain = loop_gain(&a, &b, &actual.result.gain, at);
    assert!((gain - 1.0).abs() < 1e-5, "{gain}");
}

#[test]
fn unstable_modes_that_need_a_larger_bandwidth_are_named_by_the_loop_gain() {
    // x' = 5 x + u: no feedback that stabilises it has a gain below 10.
    let five = DMatrix::from_element(1, 1, 5.0);
    let one = DMatrix::from_element(1, 1, 1.0);
    let actual =
        regulator(&five, &one, &one, &DVector::repeat(1, 1.0), 0.5, Domain::Continuous).unwrap();
    assert!(actual.result.gain[(0, 0)] <= -10.0);
    assert!(actual.loop_gain > 1.9, "{}", actual.loop_gain);
}

#[test]
fn natural_units_follow_the_units_of_outputs() {
    let plain = carts();
    let scale = DMatrix::from_diagonal(&DVector::from_vec(vec![1e3, 0.02]));
    let scaled = StateSpace { c: scale * &plain.c, ..plain.clone() };
    let (one, other) =
        (NaturalUnits::new(&plain, 2.0).unwrap(), NaturalUnits::new(&scaled, 2.0).unwrap());
    assert!((one.inputs[0] - other.inputs[0]).abs() < 1e-9);
    assert!((one.outputs[0] / other.outputs[0] - 1e3).abs() < 1e-6);
    assert!((one.outputs[1] / other.outputs[1] - 0.02).abs() < 1e-9);
    // The strongest effect is one: the energy of the response e^(-s t) g, summed over 20000 samples.
    let (rate, h) = (2.0, 1e-3);
    let (phi, _) = control::hold::zero_order_hold(&plain.a, &plain.b, h).unwrap();
    let (mut x, mut energy) = (plain.b.clone() * one.inputs[0], 0.0);
    for step in 0..20_000 {
        let y = one.outputs[0] * (&plain.c * &x)[0] * (-rate * h * f64::from(step)).exp();
        energy += h * y * y;
        x = &phi * x;
    }
    assert!((energy - 1.0).abs() < 2e-3, "{energy}");
}

/// With `x_i`' = `a_i` `x_i` + `b_i` `u_i` the energies are (`c_ji` `b_i`)^2 / (2 (rate - `a_i`)): here 1e-18 / 6 and
/// 0.25 / 8 in the first row, 0.04e-18 / 6 and 1 / 8 in the second, but for the units of the outputs.
#[test]
fn natural_units_follow_units_of_any_size() {
    let (c, unit) = ([[1.0, 0.5], [0.2, 1.0]], [1e-9, 1e9]);
    let plant = StateSpace {
        a: DMatrix::from_diagonal(&DVector::from_vec(vec![-1.0, -2.0])),
        b: DMatrix::from_diagonal(&DVector::from_vec(vec![1e-9, 1.0])),
        c: DMatrix::from_fn(2, 2, |row, column| unit[row] * c[row][column]),
        d: DMatrix::zeros(2, 2),
        domain: Domain::Continuous,
    };
    let NaturalUnits { inputs, outputs } = NaturalUnits::new(&plant, 2.0).unwrap();
    assert!((inputs[0] / (1e9 * (6.0_f64 / 32.0).sqrt()) - 1.0).abs() < 1e-9, "{inputs}");
    assert!((inputs[1] - 1.0).abs() < 1e-9, "{inputs}");
    for (actual, expected) in outputs.iter().zip([32f64.sqrt() * 1e9, 8f64.sqrt() * 1e-9]) {
        assert!((actual / expected - 1.0).abs() < 1e-9, "{outputs}");
    }
}

#[test]
fn weights_and_units_of_the_wrong_shape_are_refused_by_name() {
    let StateSpace { a, b, c, .. } = carts();
    let (domain, one, two) = (Domain::Continuous, DVector::repeat(1, 1.0), DVector::repeat(2, 1.0));
    let (three, four) = (DMatrix::identity(3, 3), DMatrix::identity(4, 4));
    let name = |error: Error| match error {
        Error::Shape { matrix, .. } => matrix,
        other => panic!("{other}"),
    };
    assert_eq!(name(regulator(&a, &b, &four, &two, 1.0, domain).unwrap_err()), "units");
    assert_eq!(name(regulator(&a, &b, &three, &one, 1.0, domain).unwrap_err()), "Q");
    assert_eq!(name(filter(&a, &c, &four, &one, 1.0, domain).unwrap_err()), "units");
    assert_eq!(name(filter(&a, &c, &three, &two, 1.0, domain).unwrap_err()), "W");
}

#[test]
fn a_sampled_loop_has_a_bandwidth_below_its_nyquist_frequency() {
    let one = DMatrix::from_element(1, 1, 1.0);
    let domain = Domain::Sampled { period: 0.1 };
    let refused = regulator(&one, &one, &one, &DVector::repeat(1, 1.0), 32.0, domain);
    assert!(matches!(refused, Err(Error::OutOfRange { .. })), "{refused:?}");
}
