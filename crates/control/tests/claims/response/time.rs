//! Step and ramp responses.

use super::{CONTINUOUS, oscillator, single};
use crate::matrix;
use control::StateSpace;
use control::response::{TimeResponse, ramp_response, step_response};
use control::{Domain, Error};
use nalgebra::DMatrix;

fn largest_step(trace: &TimeResponse) -> f64 {
    let range = trace.output.max() - trace.output.min();
    let change = |k: usize| (trace.output[(0, k + 1)] - trace.output[(0, k)]).abs();
    (0..trace.time.len() - 1).map(change).fold(0.0, f64::max) / range
}

#[test]
fn an_oscillator_overshoots_as_the_textbook_says() {
    for zeta in [0.1, 0.5, 0.8] {
        let w = 300.0;
        let trace = step_response(&oscillator(w, zeta), 0).unwrap();
        let damped = w * f64::sqrt(1.0 - zeta * zeta);
        let overshoot = (-zeta * w * std::f64::consts::PI / damped).exp();
        let actual = trace.transient(0, 0.02);
        assert!((actual.peak - 1.0 - overshoot).abs() < 1e-6, "{zeta}: {actual:?}");
        assert!((actual.peak_time * damped / std::f64::consts::PI - 1.0).abs() < 1e-3);
        assert!((actual.final_value - 1.0).abs() < 1e-14);
        for (k, &t) in trace.time.iter().enumerate() {
            let (cosine, sine) = ((damped * t).cos(), (damped * t).sin());
            let exact = 1.0 - (-zeta * w * t).exp() * (cosine + zeta * w / damped * sine);
            assert!((trace.output[(0, k)] - exact).abs() < 1e-12, "{t}");
        }
    }
}

#[test]
fn a_lag_settles_after_the_logarithm_of_the_band() {
    let lag = single(matrix(1, 1, &[-5.0]), &[10.0], &[1.0], CONTINUOUS);
    let actual = step_response(&lag, 0).unwrap().transient(0, 0.02);
    assert!((actual.settling_time - 50.0_f64.ln() / 5.0).abs() < 2e-4, "{actual:?}");
    assert!((actual.final_value - 2.0).abs() < 1e-15);
}

/// Peak k of 1 - e^(-zeta w t) (cos(d t) + zeta w / d sin(d t)), d = w (1 - zeta^2)^(1/2), is e^(-zeta w t) away from 1
/// at t = k pi / d. It is the last one outside of a slightly narrower band, also if no point of the grid is outside.
#[test]
fn a_peak_between_points_counts_for_the_settling_time() {
    let zeta = 0.1;
    let trace = step_response(&oscillator(1.0, zeta), 0).unwrap();
    let extrema = trace.extrema(0);
    let damped = f64::sqrt(1.0 - zeta * zeta);
    for k in 1..=12 {
        let time = f64::from(k) * std::f64::consts::PI / damped;
        let band = (1.0 - 1e-4) * (-zeta * time).exp();
        let late = trace.transient(0, band).settling_time - time;
        assert!((0.0..0.1).contains(&late), "{k}: {late}");
        let is_peak = |extremum: &&(f64, f64)| (extremum.0 - time).abs() < 1e-2;
        let (_, value) = extrema.iter().find(is_peak).expect("a peak");
        assert!(((value - 1.0).abs() - (-zeta * time).exp()).abs() < 1e-6, "{k}: {value}");
    }
}

/// The lag goes to 2, not to 3, and is never within 2 % of 3, the largest distance from it.
#[test]
fn a_response_outside_of_the_band_to_its_end_does_not_settle() {
    let lag = single(matrix(1, 1, &[-5.0]), &[10.0], &[1.0], CONTINUOUS);
    let mut trace = step_response(&lag, 0).unwrap();
    trace.final_value[0] = 3.0;
    assert!(trace.transient(0, 0.02).settling_time.is_infinite());
}

/// 1 - e^-t + 1 - e^(-1e5 t): both parts are resolved, with a few hundred points.
#[test]
fn fast_and_slow_parts_are_both_resolved() {
    let modes = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![-1.0, -1e5]));
    let stiff = single(modes, &[1.0, 1e5], &[1.0, 1.0], CONTINUOUS);
    let trace = step_response(&stiff, 0).unwrap();
    assert!(largest_step(&trace) < 0.06, "{}", largest_step(&trace));
    assert!(trace.time.len() < 1000, "{}", trace.time.len());
    assert!(trace.time.windows(2).all(|pair| pair[1] > pair[0]));
    for (k, &t) in trace.time.iter().enumerate() {
        let exact = -(-t).exp_m1() - (-1e5 * t).exp_m1();
        let error = (trace.output[(0, k)] - exact).abs();
        assert!(error < 1e-11, "{t}: {error:e}");
    }
}

/// 1 / (s + 1) with an input that rises over T: t - 1 + e^-t over T, then the difference of two.
#[test]
fn a_ramp_is_the_difference_of_two_integrals_of_the_step() {
    let lag = single(matrix(1, 1, &[-1.0]), &[1.0], &[1.0], CONTINUOUS);
    let rise = 0.37;
    let trace = ramp_response(&lag, 0, rise).unwrap();
    let integral = |t: f64| if t > 0.0 { t + (-t).exp_m1() } else { 0.0 };
    for (k, &t) in trace.time.iter().enumerate() {
        let exact = (integral(t) - integral(t - rise)) / rise;
        assert!((trace.output[(0, k)] - exact).abs() < 1e-13, "{t}");
    }
    assert!(trace.time.iter().any(|&t| (t - rise).abs() < 1e-15));
}

/// The fast mode has decayed at 25 / 3, less than a step before the end of the ramp.
#[test]
fn a_ramp_ends_in_time_also_if_a_mode_has_decayed_just_before() {
    let a = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![-3.0, -0.1]));
    let direct = matrix(1, 1, &[1.0]);
    let input = StateSpace { d: direct, ..single(a, &[1.0, 1.0], &[0.0, 0.0], CONTINUOUS) };
    for rise in [8.3333, 8.34, 8.36, 8.5] {
        let trace = ramp_response(&input, 0, rise).unwrap();
        assert!(trace.time.iter().any(|t| (t - rise).abs() < 1e-12), "{rise}");
        for (t, w) in trace.time.iter().zip(trace.output.iter()) {
            assert!((w - (t / rise).min(1.0)).abs() < 1e-12, "{rise} {t}: {w}");
        }
    }
}

/// The recursion, sample by sample, for a slow and a fast mode, one of them alternating.
#[test]
fn sampled_responses_are_those_of_the_recursion() {
    let a = matrix(3, 3, &[0.99, 0.1, 0.0, 0.0, -0.6, 0.5, 0.0, 0.0, 0.0]);
    let period = 0.01;
    let system = single(a, &[1.0, 0.5, 1.0], &[1.0, 2.0, -1.0], Domain::Sampled { period });
    // The ends of the last two ramps lie between two samples.
    for rise in [0.0, 7.0, 7.4, 0.3] {
        let trace = if rise > 0.0 {
            ramp_response(&system, 0, rise * period).unwrap()
        } else {
            step_response(&system, 0).unwrap()
        };
        let mut state = matrix(3, 1, &[0.0; 3]);
        let mut seen = 0;
        for k in 0..4000_i32 {
            let time = f64::from(k) * period;
            if seen < trace.time.len() && (trace.time[seen] - time).abs() < 1e-9 {
                let exact = (&system.c * &state)[0];
                assert!((trace.output[(0, seen)] - exact).abs() < 1e-11, "{rise} {k}");
                seen += 1;
            }
            let input = if rise > 0.0 { (f64::from(k) / rise).min(1.0) } else { 1.0 };
            state = &system.a * state + &system.b * input;
        }
        assert_eq!(seen, trace.time.len());
        assert!((trace.final_value[0] - (&system.c * &state)[0]).abs() < 1e-9);
    }
}

#[test]
fn bad_arguments_are_named() {
    let good = oscillator(1.0, 0.5);
    let refused = step_response(&good, 1);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "input", .. })), "{refused:?}");
    let refused = ramp_response(&good, 0, 0.0);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "duration", .. })), "{refused:?}");
    let unstable = StateSpace { a: -good.a.clone(), ..good };
    assert!(matches!(step_response(&unstable, 0), Err(Error::NotHurwitz { .. })));
}

#[test]
fn an_oscillation_that_hardly_decays_has_exact_points_that_do_not_follow_it() {
    // y'' + 2 zeta y' + y = 1: 1 - e^(-zeta t) (cos(w t) + zeta / w sin(w t)), w^2 = 1 - zeta^2.
    let zeta = 1e-6;
    let trace = step_response(&oscillator(1.0, zeta), 0).unwrap();
    let w = (1.0 - zeta * zeta).sqrt();
    assert!((100_000..500_000).contains(&trace.time.len()), "{}", trace.time.len());
    for (time, y) in trace.time.iter().zip(trace.output.row(0).iter()) {
        let (sin, cos) = (w * time).sin_cos();
        let exact = 1.0 - (-zeta * time).exp() * (cos + zeta / w * sin);
        assert!((y - exact).abs() < 1e-6, "{time}: {y} {exact}");
    }
    let actual = trace.transient(0, 0.02);
    assert!((1.99..2.0).contains(&actual.peak), "{actual:?}");
    assert!((actual.settling_time * zeta / 50_f64.ln() - 1.0).abs() < 0.01, "{actual:?}");
}
