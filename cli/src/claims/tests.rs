//! Verdicts on synthetic runs with known answers.

use super::*;

/// Time, then the values of [`WATCHED`].
type Sample = (f64, [f64; 5]);

/// A run to 100 s at 1 ms: a square stick-slip cycle of 0.1 m and 0.05 rad before 40 s, then
/// triangles of `cart` m and `angle` rad, with |f_fric - f_hat| = `spike` N every 0.5 s, `late` s
/// after a transition.
fn run(cart: f64, angle: f64, spike: f64, late: f64) -> Vec<Sample> {
    (0..=100_000_u32)
        .map(|k| {
            let time = f64::from(k) * 1e-3;
            if time < 40.0 {
                let side = if (time / 10.0) % 2.0 < 1.0 { 1.0 } else { -1.0 };
                let rests = f64::from(u8::from(time % 10.0 > 0.5));
                return (time, [0.1 * side, 0.05 * side, 0.0, 0.0, 1.0 - rests]);
            }
            let phase = (time + 1e-9) % 0.5;
            let triangle = 1.0 - 8.0 * (phase - 0.25).abs();
            let at_spike = (phase - late).abs() < 5e-4;
            let f_fric = if at_spike { spike } else { 0.01 };
            let regime = if phase < 0.25 { 0.0 } else { 1.0 };
            (time, [cart * triangle, angle * triangle, f_fric, 0.0, regime])
        })
        .collect()
}

fn judged(samples: &[Sample], lost: bool) -> Vec<Claim> {
    let mut measurement = Measurement::new(40.0, false);
    for (time, values) in samples {
        measurement.add(*time, *values);
    }
    measurement.claims(samples.last().map_or(0.0, |(time, _)| *time), lost)
}

fn verdicts(samples: &[Sample], lost: bool) -> Vec<Option<bool>> {
    judged(samples, lost).iter().map(|claim| claim.holds).collect()
}

const YES: Option<bool> = Some(true);
const NO: Option<bool> = Some(false);

#[test]
fn a_run_like_the_papers_makes_every_claim_hold() {
    assert_eq!(verdicts(&run(0.9e-3, 1.9e-3, 1.0, 0.001), false), [YES; 7]);
}

#[test]
fn amplitudes_are_half_of_peak_to_peak() {
    let claims = judged(&run(0.9e-3, 1.9e-3, 1.0, 0.001), false);
    let expected = [0.1, 0.05, 3.0, 0.9, 1.9];
    for (claim, expected) in claims.iter().zip(expected) {
        assert!((claim.measured - expected).abs() < 1e-6, "{claim:?}");
    }
}

#[test]
fn a_cart_or_a_pendulum_that_moves_too_far_breaks_its_own_claim_only() {
    let cart = verdicts(&run(1.1e-3, 1.9e-3, 1.0, 0.001), false);
    assert_eq!(cart, [YES, YES, YES, NO, YES, YES, YES]);
    let pendulum = verdicts(&run(0.9e-3, 2.1e-3, 1.0, 0.001), false);
    assert_eq!(pendulum, [YES, YES, YES, YES, NO, YES, YES]);
}

#[test]
fn a_difference_that_peaks_away_from_the_transitions_is_no_spike_of_theirs() {
    let actual = verdicts(&run(0.9e-3, 1.9e-3, 1.0, 0.1), false);
    assert_eq!(actual, [YES, YES, YES, YES, YES, YES, NO]);
}

#[test]
fn an_estimate_far_from_the_friction_is_not_accurate() {
    let actual = verdicts(&run(0.9e-3, 1.9e-3, 200.0, 0.001), false);
    assert_eq!(actual, [YES, YES, YES, YES, YES, NO, YES]);
}

#[test]
fn a_loop_at_rest_is_no_limit_cycle() {
    let still: Vec<Sample> = (0..=4000_u32).map(|k| (f64::from(k) * 0.01, [0.0; 5])).collect();
    assert_eq!(verdicts(&still, false)[..3], [NO; 3]);
}

#[test]
fn a_run_that_is_lost_or_falls_breaks_the_claims_after_the_activation() {
    let mut samples = run(0.9e-3, 1.9e-3, 1.0, 0.001);
    assert_eq!(verdicts(&samples, true)[3..], [NO; 4]);
    samples[50_000].1[1] = 1.6;
    assert_eq!(verdicts(&samples, false), [YES, YES, YES, NO, NO, NO, NO]);
}

/// With a compensation from 0 s on there is no time before it.
#[test]
fn a_part_of_the_run_without_two_samples_is_not_judged() {
    let mut measurement = Measurement::new(0.0, false);
    for (time, values) in run(0.9e-3, 1.9e-3, 1.0, 0.001) {
        measurement.add(time, values);
    }
    let claims = measurement.claims(100.0, false);
    assert!(claims[..3].iter().all(|claim| claim.holds.is_none()), "{claims:?}");
    assert!(claims[2].measured.is_nan() && claims[3].holds.is_some(), "{claims:?}");
}
