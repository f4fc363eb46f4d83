//! Peak-to-peak gain, energies, frequency response, H-infinity.

use super::{CONTINUOUS, RECORDED, oscillator, single, system};
use crate::matrix;
use crate::recorded::cases;
use control::StateSpace;
use control::response::{energy, frequency_grid, frequency_response, h_infinity, peak_gain};
use control::{Domain, Error};
use nalgebra::DMatrix;
use std::f64::consts::PI;

#[track_caller]
fn assert_bracketed(system: &StateSpace, expected: &DMatrix<f64>, slack: f64) {
    let gains = peak_gain(system, 1e-3).expect("a gain");
    for (index, &exact) in expected.iter().enumerate() {
        let (lower, upper) = (gains.lower[index], gains.upper[index]);
        assert!(lower <= exact * (1.0 + slack), "{index}: {lower} above {exact}");
        assert!(upper >= exact * (1.0 - slack), "{index}: {upper} below {exact}");
        assert!(upper <= lower * 1.0011, "{index}: {lower} to {upper}");
    }
}

/// The tolerance is 1e-4, because the recorded numbers are from a grid.
#[test]
fn peak_gains_agree_with_modal_decomposition_in_high_precision() {
    for case in cases(RECORDED, "peak") {
        assert_bracketed(&system(&case, CONTINUOUS), case.get("gain"), 1e-4);
    }
}

/// Half waves that decrease geometrically add up to coth(pi zeta w / (2 v)), v the damped
/// frequency.
#[test]
fn the_peak_gain_of_an_oscillator_is_a_hyperbolic_cotangent() {
    for zeta in [0.9, 0.3, 0.01, 0.001] {
        let half_turn = PI * zeta / f64::sqrt(1.0 - zeta * zeta);
        let exact = 1.0 / (0.5 * half_turn).tanh();
        assert_bracketed(&oscillator(70.0, zeta), &matrix(1, 1, &[exact]), 1e-9);
    }
}

/// More than 1e5 oscillations in a time constant: the limit is the number of intervals, not the 200 rounds.
#[test]
fn a_peak_gain_that_needs_too_many_intervals_states_the_rounds_that_were_made() {
    let refused = peak_gain(&oscillator(70.0, 1e-6), 1e-3);
    assert!(
        matches!(refused, Err(Error::NotConverged { iterations, .. }) if iterations < 200),
        "{refused:?}"
    );
}

/// The first output sees a lag as it is, and the oscillator, on which the second input acts, 1e16 times more weakly.
#[test]
fn an_output_keeps_the_peak_gain_of_what_it_sees_far_more_weakly() {
    for part in [1e-14, 1e-16, 1e-18] {
        let coth = 1.0 / (0.05 * PI / 0.99_f64.sqrt()).tanh();
        let weak = StateSpace {
            a: matrix(3, 3, &[-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, -0.2]),
            b: matrix(3, 2, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
            c: matrix(2, 3, &[1.0, part, 0.0, 0.0, 1.0, 0.0]),
            d: DMatrix::zeros(2, 2),
            domain: CONTINUOUS,
        };
        assert_bracketed(&weak, &matrix(2, 2, &[1.0, part * coth, 0.0, coth]), 1e-9);
    }
}

#[test]
fn the_peak_gain_of_signals_whose_squares_underflow_is_in_proportion() {
    let (oscillator, coth) = (oscillator(1.0, 0.1), 1.0 / (0.05 * PI / 0.99_f64.sqrt()).tanh());
    let tiny = StateSpace { b: oscillator.b * 1e-100, c: oscillator.c * 1e-100, ..oscillator };
    assert_bracketed(&tiny, &matrix(1, 1, &[1e-200 * coth]), 1e-9);
}

/// h = 5 e^-t - 3e7 e^(-1e6 t) changes its sign once.
#[test]
fn the_peak_gain_of_a_stiff_system_is_the_closed_form() {
    let modes = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![-1.0, -1e6]));
    let stiff = single(modes, &[1.0, 1.0], &[5.0, -3e7], CONTINUOUS);
    let turn = (3e7_f64 / 5.0).ln() / (1e6 - 1.0);
    let integral = |t: f64| 5.0 * -(-t).exp_m1() + 30.0 * (-1e6 * t).exp_m1();
    let exact = (5.0 - 30.0) - 2.0 * integral(turn);
    assert_bracketed(&stiff, &matrix(1, 1, &[exact]), 1e-9);
}

/// Computes the sum sample by sample.
#[test]
fn sampled_peak_gains_are_the_sums_of_the_absolute_samples() {
    let domain = Domain::Sampled { period: 0.1 };
    for case in cases(RECORDED, "norms").iter().filter(|case| case.number("period") > 0.0) {
        let system = system(case, domain);
        let mut sum = system.d.abs();
        let mut state = system.b.clone();
        for _ in 0..3000 {
            sum += (&system.c * &state).abs();
            state = &system.a * state;
        }
        assert_bracketed(&system, &sum, 1e-9);
    }
}

#[test]
fn a_system_without_effect_has_the_gain_of_its_feedthrough() {
    let mut idle = single(-DMatrix::identity(2, 2), &[1.0, 0.0], &[0.0, 1.0], CONTINUOUS);
    idle.d[(0, 0)] = -2.0;
    let computed = peak_gain(&idle, 1e-3).unwrap();
    assert_eq!((computed.lower[(0, 0)], computed.upper[(0, 0)]), (2.0, 2.0));
    assert_eq!(h_infinity(&idle, 1e-6).unwrap().lower.to_bits(), 2.0_f64.to_bits());
}

#[test]
fn unstable_systems_are_refused() {
    let unstable = single(matrix(1, 1, &[0.1]), &[1.0], &[1.0], CONTINUOUS);
    let refused = peak_gain(&unstable, 1e-3);
    assert!(matches!(refused, Err(Error::NotHurwitz { matrix: "A", .. })), "{refused:?}");
    assert!(matches!(h_infinity(&unstable, 1e-3), Err(Error::NotHurwitz { .. })));
    assert!(matches!(energy(&unstable), Err(Error::NotHurwitz { .. })));
    let sampled = StateSpace { domain: Domain::Sampled { period: 1.0 }, ..unstable };
    assert!(peak_gain(&sampled, 1e-3).is_ok());
    let sampled = StateSpace { a: matrix(1, 1, &[-1.0]), ..sampled };
    assert!(matches!(peak_gain(&sampled, 1e-3), Err(Error::NotSchur { .. })));
}

#[test]
fn bad_arguments_are_named() {
    let good = oscillator(1.0, 0.5);
    for width in [0.0, -1.0, f64::NAN] {
        let refused = peak_gain(&good, width);
        assert!(matches!(refused, Err(Error::OutOfRange { name: "width", .. })), "{refused:?}");
    }
    let wrong = StateSpace { d: DMatrix::zeros(2, 1), ..good.clone() };
    let refused = peak_gain(&wrong, 1e-3);
    assert_eq!(refused, Err(Error::Shape { matrix: "D", expected: (1, 1), actual: (2, 1) }));
    let refused = frequency_response(&good, &[1.0, f64::NAN]);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "frequency", .. })), "{refused:?}");
    let period = StateSpace { domain: Domain::Sampled { period: -1.0 }, ..good.clone() };
    let refused = energy(&period);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "period", .. })), "{refused:?}");
    let direct = StateSpace { d: DMatrix::identity(1, 1), ..good };
    assert!(matches!(energy(&direct), Err(Error::OutOfRange { name: "D", .. })));
}

#[test]
fn norms_agree_with_slycot() {
    for case in cases(RECORDED, "norms") {
        let period = case.number("period");
        let domain = if period > 0.0 { Domain::Sampled { period } } else { CONTINUOUS };
        let system = system(&case, domain);
        let (norm, exact) = (h_infinity(&system, 1e-9).unwrap(), case.number("hinf"));
        assert!((norm.lower / exact - 1.0).abs() < 1e-8, "{}: {norm:?} {exact}", case.name);
        assert!(norm.upper <= norm.lower * (1.0 + 1.1e-9));
        let strict = StateSpace { d: system.d.clone() * 0.0, ..system.clone() };
        let (h2, exact) = (energy(&strict).unwrap().h2, case.number("h2"));
        assert!((h2 / exact - 1.0).abs() < 1e-10, "{}: {h2} {exact}", case.name);
        let points = frequency_response(&system, case.get("frequencies").as_slice()).unwrap();
        for (point, exact) in points.iter().zip(case.get("sizes").iter()) {
            assert!((point.singular_values[0] / exact - 1.0).abs() < 1e-11, "{}", case.name);
        }
    }
}

/// z = 1 and z = -1 are zeros of 1 - z^-2, whose modulus is 2 |sin(w T)|.
#[test]
fn a_sampled_response_that_is_zero_at_both_ends_has_the_norm_of_the_middle() {
    let domain = Domain::Sampled { period: 0.1 };
    let mut comb = single(matrix(2, 2, &[0.0, 0.0, 1.0, 0.0]), &[1.0, 0.0], &[0.0, -1.0], domain);
    comb.d[(0, 0)] = 1.0;
    let norm = h_infinity(&comb, 1e-9).unwrap();
    assert!((norm.lower - 2.0).abs() < 1e-8, "{norm:?}");
    assert!((norm.frequency - 5.0 * PI).abs() < 1e-3, "{norm:?}");
}

/// The largest singular value on a dense grid is close to the norm and does not exceed it.
#[test]
fn no_frequency_exceeds_the_h_infinity_norm() {
    for case in cases(RECORDED, "norms") {
        let period = case.number("period");
        let domain = if period > 0.0 { Domain::Sampled { period } } else { CONTINUOUS };
        let system = system(&case, domain);
        let norm = h_infinity(&system, 1e-9).unwrap();
        let grid = frequency_grid(&system, 200).unwrap();
        let points = frequency_response(&system, &grid).unwrap();
        let largest = points.iter().map(|point| point.singular_values[0]).fold(0.0, f64::max);
        assert!(largest < norm.upper, "{}: {largest} {norm:?}", case.name);
        assert!(largest > 0.95 * norm.lower, "{}: {largest} {norm:?}", case.name);
    }
}

/// 1 / (2 zeta sqrt(1 - zeta^2)) at w sqrt(1 - 2 zeta^2), for a very sharp resonance.
#[test]
fn a_sharp_resonance_is_found() {
    let zeta = 1e-5;
    let norm = h_infinity(&oscillator(3.0, zeta), 1e-9).unwrap();
    assert!((norm.lower * 2.0 * zeta - 1.0).abs() < 1e-8, "{norm:?}");
    assert!((norm.frequency - 3.0).abs() < 1e-6);
}

#[test]
fn the_grid_reaches_from_a_tenth_of_the_slowest_to_ten_times_the_fastest() {
    let modes = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![-2.0, -300.0]));
    let slow = single(modes, &[1.0, 1.0], &[1.0, 1.0], CONTINUOUS);
    let grid = frequency_grid(&slow, 10).unwrap();
    assert!((grid[0] - 0.2).abs() < 1e-12 && (grid[grid.len() - 1] - 3000.0).abs() < 1e-9);
    assert!(grid.windows(2).all(|pair| pair[1] > pair[0] && pair[1] / pair[0] < 1.26));
    let sampled = StateSpace {
        a: slow.a.map(|x| (0.01 * x).exp()),
        domain: Domain::Sampled { period: 0.01 },
        ..slow
    };
    let sampled = StateSpace { a: DMatrix::from_diagonal(&sampled.a.diagonal()), ..sampled };
    let grid = frequency_grid(&sampled, 10).unwrap();
    assert!((grid[grid.len() - 1] - PI / 0.01).abs() < 1e-9);
}

/// s^2 + 10 s + 100 has two eigenvalues of modulus 10, in any units of its states.
#[test]
fn the_grid_does_not_depend_on_the_units_of_the_states() {
    for unit in [1.0, 1e9, 1e18, 1e-18] {
        let a = matrix(2, 2, &[0.0, unit, -100.0 / unit, -10.0]);
        let system = single(a, &[0.0, 1.0 / unit], &[1.0, 0.0], CONTINUOUS);
        let grid = frequency_grid(&system, 10).unwrap();
        let ends = [grid[0], grid[grid.len() - 1] / 100.0];
        assert!(ends.iter().all(|end| (end - 1.0).abs() < 1e-9), "{unit}: {ends:?}");
    }
}

/// For c' (s I - A)^-1 b the largest |z| at energy one is reached by the time-reversed impulse
/// response.
#[test]
fn the_energy_to_peak_norm_is_reached_by_the_reversed_impulse_response() {
    // 1 / (s + a): the energy of the impulse response is 1 / (2 a).
    let lag = single(matrix(1, 1, &[-4.0]), &[3.0], &[2.0], CONTINUOUS);
    let computed = energy(&lag).unwrap();
    assert!((computed.peak - (36.0_f64 / 8.0).sqrt()).abs() < 1e-14);
    // Two outputs of one state: the Euclidean peak is the longer diagonal.
    let two = StateSpace { c: matrix(2, 1, &[2.0, -1.5]), d: DMatrix::zeros(2, 1), ..lag };
    let computed = energy(&two).unwrap();
    assert!((computed.peak - 2.5 * (9.0_f64 / 8.0).sqrt()).abs() < 1e-14);
    assert!((computed.peaks[1] - 1.5 * (9.0_f64 / 8.0).sqrt()).abs() < 1e-14);
    let sampled = StateSpace {
        a: matrix(1, 1, &[0.5]),
        d: matrix(2, 1, &[1.0, 0.0]),
        domain: Domain::Sampled { period: 0.1 },
        ..two
    };
    let computed = energy(&sampled).unwrap();
    assert!((computed.peaks[0] - (1.0 + 36.0_f64 / 0.75).sqrt()).abs() < 1e-14);
}

#[test]
fn a_covariance_that_overflows_is_no_norm_of_zero() {
    // The output is -1e200 times a lag: its covariance is 1e400 / 2.
    let a = -DMatrix::identity(2, 2);
    let refused = energy(&single(a, &[1.0, 2.0], &[1e200, -1e200], CONTINUOUS));
    assert!(matches!(refused, Err(Error::Overflow { .. })), "{refused:?}");
}
