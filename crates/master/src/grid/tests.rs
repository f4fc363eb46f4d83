//! Sizes of steps to the ulp.
#![expect(clippy::float_cmp, reason = "tests; exact by construction")]

use super::{Grid, size_between};
use crate::system::System;

/// Returns the next number of a reproducible pseudo-random sequence.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 11
}

/// Returns a random number from 10^-exponent to 10^exponent.
#[expect(clippy::cast_precision_loss, reason = "53 bits")]
fn magnitude(state: &mut u64, exponent: f64) -> f64 {
    let unit = random(state) as f64 / (1_u64 << 53) as f64;
    10_f64.powf(exponent * (2.0 * unit - 1.0))
}

fn grid(step: f64, start: f64, stop: f64) -> Grid {
    Grid::new(&System::default(), step, &[], start, Some(stop)).unwrap().0
}

#[test]
fn a_step_ends_where_it_is_to_end_or_as_little_before_as_numbers_allow() {
    let (mut state, mut exact) = (1, 0);
    for _ in 0..100_000 {
        let start = magnitude(&mut state, 8.0) - magnitude(&mut state, 4.0);
        let end = start + magnitude(&mut state, 6.0);
        if end == start {
            continue;
        }
        let size = size_between(start, end);
        assert!(start + size <= end, "{start} {end}");
        assert!(start + size == end || start + size.next_up() > end, "{start} {end}");
        exact += i32::from(start + size == end);
    }
    assert!(exact > 99_000, "{exact}");
}

#[test]
fn no_step_ends_beyond_the_stop_time_and_the_last_one_ends_at_it() {
    let mut state = 7;
    let mut known = vec![(0.01, 0.0, 20.0), (0.1, 0.0, 0.3), (0.1, 0.7, 1.0), (0.3, 0.0, 1.0)];
    known.extend((0..200).map(|_| {
        let (step, start) = (magnitude(&mut state, 4.0), magnitude(&mut state, 2.0) - 1.0);
        let steps = f64::from(u32::try_from(random(&mut state) % 500 + 1).unwrap());
        (step, start, start + steps * step)
    }));
    let mut beyond = 0;
    for (step, start, stop) in known {
        let mut grid = grid(step, start, stop);
        while !grid.is_finished() {
            let (end, size) = grid.next();
            assert!(grid.time + size <= stop, "{step} {start} {stop}: {}", grid.time);
            let ulp = |time: f64| time.abs().next_up() - time.abs();
            let rounding = 4.0 * ulp(start).max(ulp(stop));
            assert!((grid.time + size - end).abs() <= rounding, "{step} {start} {stop}");
            beyond += i32::from(grid.time + step > stop && end == stop);
            if end < stop {
                assert_eq!(size, step);
            } else {
                let longer = grid.time + size.next_up();
                assert!(grid.time + size == stop || longer > stop, "{step} {start} {stop}");
                assert_eq!(end, stop);
            }
            grid.reach(end);
        }
        assert_eq!(grid.time, stop);
    }
    assert!(beyond > 20, "whole steps would often have ended an ulp beyond: {beyond}");
}

/// The stop time differs from the grid point 10 by rounding, at most 2.4e-7 s.
#[test]
fn a_run_in_seconds_since_1970_has_no_step_of_rounding_at_its_end() {
    let start = 1_700_000_000.3;
    let point = grid(0.01, start, start + 1.0).point(10);
    for stop in [point.next_down(), point, point.next_up()] {
        let mut grid = grid(0.01, start, stop);
        let mut steps = 0;
        while !grid.is_finished() {
            let (end, _) = grid.next();
            grid.reach(end);
            steps += 1;
        }
        assert_eq!((grid.time, steps, grid.count), (stop, 10, 10));
        grid.resume(stop, 10);
        assert_eq!(grid.count, 10);
    }
}

#[test]
fn a_start_or_stop_time_that_is_no_finite_number_is_refused() {
    let message = |start, stop| {
        let grid = Grid::new(&System::default(), 0.1, &[], start, stop);
        grid.err().unwrap().to_string()
    };
    for (time, text) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
        for stop in [None, Some(1.0)] {
            let expected = format!("the start time is {text} s, expected a finite number");
            assert_eq!(message(time, stop), expected);
        }
        let expected = format!("the stop time is {text} s, expected a finite number");
        assert_eq!(message(0.0, Some(time)), expected);
    }
}

#[test]
fn a_run_that_goes_on_after_a_shorter_last_step_returns_to_the_grid() {
    let mut first = grid(0.1, 0.0, 1.05);
    while !first.is_finished() {
        let (end, _) = first.next();
        first.reach(end);
    }
    let mut second = grid(0.1, 0.0, 2.0);
    second.resume(first.time, first.count);
    let (end, size) = second.next();
    assert_eq!((end, 1.05 + size), (1.1, 1.1));
    second.reach(end);
    assert_eq!(second.next(), (0.0 + 12.0 * 0.1, 0.1));
}

/// -0.9 + 3 * 0.3 is -1.1e-16 in double precision.
#[test]
fn a_run_that_starts_before_0_s_has_its_grid_point_at_0_s() {
    for (step, start, number) in
        [(0.3, -0.9, 3), (0.1, -0.3, 3), (0.1, -1.7, 17), (0.01, -0.35, 35)]
    {
        assert_eq!(grid(step, start, 10.0).point(number), 0.0, "{step} {start}");
    }
    assert_eq!(grid(0.25, 1e-3, 10.0).point(0), 1e-3);
}
