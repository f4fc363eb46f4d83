//! Polynomials through points of `1 + 2 t + 3 t^2`, computed by hand.

use super::{OutputHistory, Polynomial};
use crate::algorithm::Extrapolation;

/// Values at t = -0.5, 0.5, 1 and 3 s: 0.75, 2.75, 6 and 34; at 1 s the slope is 8 and the
/// curvature 6.
const PAST: OutputHistory = OutputHistory {
    earlier: 0.75,
    before: 2.75,
    start: 6.0,
    end: 34.0,
    slope: None,
    curvature: None,
    earlier_size: 1.0,
    last_size: 0.5,
    size: 2.0,
    jumps: false,
};
const PARABOLA: Polynomial = Polynomial { value: 6.0, slope: 8.0, curvature: 6.0 };

fn line(slope: f64) -> Polynomial {
    Polynomial { value: 6.0, slope, curvature: 0.0 }
}

#[test]
fn three_values_or_two_and_a_slope_or_both_derivatives_make_the_parabola() {
    let slope = OutputHistory { slope: Some(8.0), ..PAST };
    let both = OutputHistory { curvature: Some(6.0), before: 100.0, ..slope };
    for known in [PAST, slope, both] {
        assert_eq!(known.extrapolated(Extrapolation::Quadratic), PARABOLA);
    }
}

#[test]
fn a_line_has_the_given_slope_or_the_last_difference_quotient() {
    assert_eq!(PAST.extrapolated(Extrapolation::Linear), line(6.5));
    let slope = OutputHistory { slope: Some(8.0), ..PAST };
    assert_eq!(slope.extrapolated(Extrapolation::Linear), line(8.0));
}

#[test]
fn a_limited_line_has_the_smaller_slope_or_zero_if_the_signs_differ() {
    for (slope, expected) in [(8.0, 6.5), (5.0, 5.0), (-1.0, 0.0), (0.0, 0.0)] {
        let known = OutputHistory { slope: Some(slope), ..PAST };
        assert_eq!(known.extrapolated(Extrapolation::Limited), line(expected));
    }
    assert_eq!(PAST.extrapolated(Extrapolation::Limited), line(6.5));
}

#[test]
fn a_held_value_is_the_start_value_or_the_known_end_value() {
    assert_eq!(PAST.extrapolated(Extrapolation::Hold), Polynomial::held(6.0));
    assert_eq!(PAST.interpolated(Extrapolation::Hold), Polynomial::held(34.0));
}

#[test]
fn interpolation_is_a_line_or_the_parabola_with_the_slope_or_the_value_before() {
    assert_eq!(PAST.interpolated(Extrapolation::Linear), line(14.0));
    assert_eq!(PAST.interpolated(Extrapolation::Limited), line(14.0));
    assert_eq!(PAST.interpolated(Extrapolation::Quadratic), PARABOLA);
    let slope = OutputHistory { slope: Some(8.0), before: 100.0, ..PAST };
    assert_eq!(slope.interpolated(Extrapolation::Quadratic), PARABOLA);
}

/// From 1 s on: 17 at 2 s with slope 14; 34 at 3 s; the integral from 1 to 3 s is 36.
#[test]
fn shifted_origin_end_value_and_mean_agree_with_the_parabola() {
    let later = Polynomial { value: 17.0, slope: 14.0, curvature: 6.0 };
    assert_eq!(PARABOLA.later(1.0), later);
    assert_eq!((PARABOLA.end(2.0), PARABOLA.mean(2.0)), (34.0, 18.0));
}

/// Without past values an extrapolation uses the given derivatives; with one value before, a line.
#[test]
fn missing_past_values_add_no_curvature() {
    let first = OutputHistory {
        earlier: 6.0,
        before: 6.0,
        earlier_size: f64::MAX,
        last_size: f64::MAX,
        ..PAST
    };
    for extrapolation in [
        Extrapolation::Hold,
        Extrapolation::Limited,
        Extrapolation::Linear,
        Extrapolation::Quadratic,
    ] {
        assert_eq!(first.extrapolated(extrapolation), Polynomial::held(6.0));
    }
    let second = OutputHistory { earlier: 2.75, earlier_size: f64::MAX, ..PAST };
    assert_eq!(second.extrapolated(Extrapolation::Quadratic).end(2.0), 19.0);
    let slope = OutputHistory { slope: Some(8.0), ..first };
    assert_eq!(slope.extrapolated(Extrapolation::Quadratic).end(2.0), 22.0);
    assert_eq!(first.interpolated(Extrapolation::Quadratic).mean(2.0), 20.0);
}

/// The values before are on the other side of a jump.
#[test]
fn an_output_that_jumps_is_extrapolated_by_its_own_derivatives_only() {
    let jump = OutputHistory { jumps: true, ..PAST };
    let slope = OutputHistory { slope: Some(8.0), ..jump };
    for extrapolation in [Extrapolation::Limited, Extrapolation::Linear, Extrapolation::Quadratic] {
        assert_eq!(jump.extrapolated(extrapolation), Polynomial::held(6.0));
        assert_eq!(slope.extrapolated(extrapolation), line(8.0));
    }
    let both = OutputHistory { curvature: Some(6.0), ..slope };
    assert_eq!(both.extrapolated(Extrapolation::Quadratic).end(2.0), 34.0);
}
