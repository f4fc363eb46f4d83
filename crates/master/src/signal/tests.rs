//! Signals against values computed by hand; `tests/foreign/test_signals.py` compares with FMPy.
#![expect(clippy::float_cmp, reason = "exact by construction")]

use super::*;

fn track(points: &[(f64, f64)], between: Interpolation) -> Signal {
    let (times, values): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
    Signal::Track(Track::new(times.into(), values.into(), between).unwrap())
}

fn assert_at(signal: &Signal, time: f64, value: f64, slope: f64) {
    assert_eq!(signal.value(time), value, "value at {time}");
    assert_eq!(signal.slope(time), slope, "slope at {time}");
}

fn breaks(signal: &Signal, from: f64) -> Vec<f64> {
    std::iter::successors(signal.next_break(from), |&last| signal.next_break(last)).collect()
}

#[test]
fn a_ramp_is_a_line_between_two_constants() {
    let ramp = Signal::Ramp { from: 10.0, until: 20.0, begin: 1.0, end: 6.0 };
    for (time, value, slope) in
        [(0.0, 1.0, 0.0), (10.0, 1.0, 0.5), (14.0, 3.0, 0.5), (20.0, 6.0, 0.0), (99.0, 6.0, 0.0)]
    {
        assert_at(&ramp, time, value, slope);
    }
    assert_eq!(breaks(&ramp, 0.0), [10.0, 20.0]);
    assert_eq!(ramp.next_break(10.0 - 1e-10), Some(20.0));
}

#[test]
fn a_sine_starts_at_its_time_and_its_slope_is_a_cosine() {
    let sine = Signal::Sine { amplitude: 2.0, frequency: 0.25, phase: 0.0, offset: 1.0, from: 3.0 };
    assert_at(&sine, 2.0, 1.0, 0.0);
    assert_at(&sine, 3.0, 1.0, TAU * 0.25 * 2.0);
    assert_eq!(sine.value(4.0), 3.0);
    assert!(sine.slope(4.0).abs() < 1e-15);
    // A phase of a quarter period.
    let ahead =
        Signal::Sine { amplitude: 2.0, frequency: 0.25, phase: TAU / 4.0, offset: 1.0, from: 3.0 };
    assert!((ahead.value(3.0) - 3.0).abs() < 1e-15);
    assert!((ahead.value(4.0) - 1.0).abs() < 1e-15);
}

#[test]
fn lines_go_through_the_points_and_the_ends_are_held() {
    let signal = track(&[(1.0, 10.0), (2.0, 20.0), (4.0, 10.0)], Interpolation::Line);
    for (time, value, slope) in [
        (0.0, 10.0, 0.0),
        (1.0, 10.0, 10.0),
        (1.5, 15.0, 10.0),
        (2.0, 20.0, -5.0),
        (3.0, 15.0, -5.0),
        (4.0, 10.0, 0.0),
        (5.0, 10.0, 0.0),
    ] {
        assert_at(&signal, time, value, slope);
    }
    assert_eq!(signal.next_break(0.0), None);
}

#[test]
fn a_time_that_occurs_twice_is_a_jump_to_the_later_value() {
    let signal =
        track(&[(0.0, 0.0), (1.0, 2.0), (1.0, 5.0), (1.0, 8.0), (3.0, 4.0)], Interpolation::Line);
    assert_at(&signal, 0.5, 1.0, 2.0);
    assert_at(&signal, 1.0, 8.0, -2.0);
    assert_at(&signal, 1.0 - 1e-12, 8.0, -2.0);
    assert_at(&signal, 2.0, 6.0, -2.0);
    assert_eq!(breaks(&signal, 0.0), [1.0]);
}

#[test]
fn held_values_start_at_their_time() {
    let signal = track(&[(0.0, 1.0), (1.0, 2.0), (2.0, 2.0), (3.0, 5.0)], Interpolation::Hold);
    for (time, value) in
        [(-1.0, 1.0), (0.0, 1.0), (0.999, 1.0), (1.0, 2.0), (2.5, 2.0), (3.0, 5.0), (9.0, 5.0)]
    {
        assert_at(&signal, time, value, 0.0);
    }
    // Three steps of 0.1 s in doubles are past 0.3, seven are before 0.7: both are reached.
    let steps = track(&[(0.0, 0.0), (0.3, 3.0), (0.7, 7.0)], Interpolation::Hold);
    assert_eq!(steps.value(0.1 + 0.1 + 0.1), 3.0);
    assert_eq!(steps.value(0.7 - 1e-15), 7.0);
    assert_eq!(breaks(&signal, -1.0), [1.0, 3.0]);
}

/// Such times differ by less than a relative 1e-9.
#[test]
fn points_in_seconds_since_1970_are_apart() {
    let epoch = 1.7e9;
    let points = [(epoch, 1.0), (epoch + 1.0, 3.0), (epoch + 2.0, 2.0)];
    let line = track(&points, Interpolation::Line);
    assert_at(&line, epoch, 1.0, 2.0);
    assert_at(&line, epoch + 0.5, 2.0, 2.0);
    assert_at(&line, epoch + 1.5, 2.5, -1.0);
    assert!(breaks(&line, epoch - 1.0).is_empty());
    let hold = track(&points, Interpolation::Hold);
    assert_eq!([0.5, 1.0, 1.5].map(|time| hold.value(epoch + time)), [1.0, 3.0, 3.0]);
    assert_eq!(breaks(&hold, epoch - 1.0), [epoch + 1.0, epoch + 2.0]);
    // One unit in the last place is rounding.
    assert_eq!(hold.value((epoch + 1.0).next_down()), 3.0);
    let ticks = track(&points, Interpolation::Points);
    assert_eq!([0.5, 1.0].map(|time| ticks.value(epoch + time)), [0.0, 3.0]);
}

/// A jump of another column of the same table repeats the time.
#[test]
fn a_tick_counts_in_every_row_of_its_time() {
    for rows in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
        let [first, second, third] = rows;
        let points = [(0.0, 0.0), (1.0, first), (1.0, second), (1.0, third), (2.0, 0.0)];
        let ticks = track(&points, Interpolation::Points);
        assert_eq!(breaks(&ticks, 0.0), [1.0], "{rows:?}");
        for time in [1.0 - 1e-10, 1.0, 1.0 + 1e-10] {
            assert_at(&ticks, time, 1.0, 0.0);
        }
        for time in [0.0, 0.5, 1.5, 2.0] {
            assert_at(&ticks, time, 0.0, 0.0);
        }
    }
    assert_at(&track(&[(0.0, 0.0), (0.0, 1.0)], Interpolation::Points), 0.0, 1.0, 0.0);
}

#[test]
fn a_single_point_is_a_constant() {
    for between in [Interpolation::Line, Interpolation::Hold] {
        let signal = track(&[(1.0, 4.0)], between);
        for time in [0.0, 1.0, 2.0] {
            assert_at(&signal, time, 4.0, 0.0);
        }
    }
}

#[test]
fn time_may_run_either_way_under_a_cursor() {
    let points: Vec<_> =
        (0..200).map(|k| (f64::from(k / 2) * 0.1, f64::from(k * k % 37))).collect();
    for between in [Interpolation::Line, Interpolation::Hold] {
        let signal = track(&points, between);
        let mut cursor = Cursor::default();
        let mut time = 5.0;
        for k in 0..5000 {
            time += [0.013, -0.007, 0.001, -3.1, 3.05, 0.1][k % 6];
            let expected = Sample { value: signal.value(time), slope: signal.slope(time) };
            assert_eq!(signal.at(time, &mut cursor), expected, "at {time}");
        }
    }
}

#[test]
fn scaling_scales_values_slopes_and_offsets() {
    let signals = [
        Signal::Constant(3.0),
        Signal::Ramp { from: 0.0, until: 2.0, begin: 1.0, end: 5.0 },
        Signal::Sine { amplitude: 1.0, frequency: 0.3, phase: 0.2, offset: 4.0, from: 0.5 },
        track(&[(0.0, 1.0), (2.0, 4.0)], Interpolation::Line),
    ];
    for signal in signals {
        let scaled = signal.clone().scaled(2.0, -1.0);
        for time in [0.0, 0.4, 0.7, 1.9, 3.0] {
            let expected = 2.0 * signal.value(time) - 1.0;
            assert!((scaled.value(time) - expected).abs() < 1e-14, "{signal:?}");
            assert!((scaled.slope(time) - 2.0 * signal.slope(time)).abs() < 1e-14, "{signal:?}");
        }
    }
}

#[test]
fn invalid_points_are_refused() {
    let refused = |points: &[(f64, f64)]| {
        let (times, values): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
        Track::new(times.into(), values.into(), Interpolation::Line).unwrap_err().to_string()
    };
    assert_eq!(refused(&[]), "there are no points, expected at least one");
    assert_eq!(
        refused(&[(0.0, 1.0), (f64::NAN, 1.0)]),
        "point 2: the time is NaN, expected a finite number"
    );
    assert_eq!(
        refused(&[(0.0, f64::INFINITY)]),
        "point 1: the value is inf, expected a finite number"
    );
    assert_eq!(
        refused(&[(2.0, 0.0), (1.0, 0.0)]),
        "point 2: the time 1 s comes after 2 s, expected ascending times"
    );
    let lengths = Track::new([0.0].into(), [0.0, 1.0].into(), Interpolation::Hold).unwrap_err();
    assert_eq!(lengths.to_string(), "there are 2 values, expected 1, one for each time");
}

#[test]
fn points_at_the_ends_of_the_doubles_give_finite_values() {
    let signal = track(&[(0.0, f64::MAX), (5e-324, f64::MIN), (1e300, 0.0)], Interpolation::Line);
    for time in [-1.0, 0.0, 5e-324, 1.0, 1e299, 1e300, 1e301] {
        assert!(signal.value(time).is_finite() && signal.slope(time).is_finite(), "{time}");
    }
}
