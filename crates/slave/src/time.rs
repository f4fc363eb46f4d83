//! Equality of times.

/// Returns the largest difference in s of two equal times near `time`, for steps or intervals of `size` s: 1e-9 of
/// `size`, or a few units in the last place of the time.
///
/// Two ways to compute one time are rounded differently: the end of a step is the sum of its start and its size, the
/// next grid point is `start + k size`, an FMU may add up its own steps, and a file states decimal numbers. A unit in
/// the last place of seconds since 1970 is 2.4e-7 s, more than 1e-9 of most steps.
#[inline]
#[must_use]
pub fn time_rounding(time: f64, size: f64) -> f64 {
    (1e-9 * size).max(4.0 * f64::EPSILON * time.abs())
}

#[cfg(test)]
mod tests {
    use super::time_rounding;

    /// Starts and sizes in s. From -0.9 s, a sum next to 0 s differs from it by all of its digits.
    #[test]
    fn sums_quotients_and_grid_points_are_equal_and_a_thousandth_of_a_step_is_not_rounding() {
        for (start, size) in [
            (0.0, 1e-6),
            (0.3, 1e-6),
            (12.5, 1.0 / 3.0),
            (-0.9, 0.3),
            (-100.0, 1e-3),
            (1.7e9, 0.002),
            (1_700_000_000.3, 0.01),
            (-1.7e9, 0.1),
        ] {
            for k in 0..1000 {
                let point = |k: i32| start + f64::from(k) * size;
                let next = point(k + 1);
                let rounding = time_rounding(next, size);
                for equal in [point(k) + size, start + f64::from(k + 1) / (1.0 / size)] {
                    assert!((equal - next).abs() <= rounding, "{start} {size} {k}");
                }
                assert!(rounding < 1e-3 * size, "{start} {size} {k}");
            }
        }
    }

    #[test]
    fn without_an_interval_times_are_equal_up_to_a_few_units_in_the_last_place() {
        for time in [1e-3, 1e3, 1.7e9, -1.7e9_f64] {
            let unit = time.abs().next_up() - time.abs();
            let units = time_rounding(time, 0.0) / unit;
            assert!((4.0..8.0).contains(&units), "{time}: {units}");
        }
        assert!(time_rounding(0.0, 0.0) <= 0.0);
    }
}
