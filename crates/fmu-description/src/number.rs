//! Numbers in messages, rounded to the digits that mean something.

/// Significant digits of a time. The rounding errors of a sum of steps are behind them.
const TIME: usize = 12;

/// Returns `value`, rounded to `digits` significant digits, without trailing zeros; with an exponent
/// if it is below 1e-4, or has more digits before the decimal point than both `digits` and 6.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> String {
    let decimals = digits.saturating_sub(1);
    let rounded: f64 = format!("{value:.decimals$e}").parse().unwrap_or(value);
    let longest = i32::try_from(digits.max(6)).unwrap_or(i32::MAX);
    let is_plain = rounded == 0.0 || (1e-4..10f64.powi(longest)).contains(&rounded.abs());
    if is_plain || !rounded.is_finite() { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// Returns a time in s, or the length of a step, without the rounding errors of its computation:
/// `37.547` for the sum of 37547 steps of 0.001 s, which is 37.547000000000004.
#[must_use]
pub fn seconds(time: f64) -> String {
    rounded(time, TIME)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digits_that_remain_are_those_of_the_value() {
        let cases = [
            (289.701, 3, "290"),
            (0.028_970_1, 3, "0.029"),
            (28_970_100.0, 3, "2.9e7"),
            (123_456.0, 3, "123000"),
            (-0.000_012_345, 3, "-1.23e-5"),
            (0.0, 3, "0"),
            (f64::INFINITY, 3, "inf"),
            (f64::NAN, 3, "NaN"),
        ];
        for (value, digits, text) in cases {
            assert_eq!(rounded(value, digits), text);
        }
    }

    #[test]
    fn a_time_has_no_rounding_errors_and_keeps_its_digits() {
        let mut sum = 0.0;
        (0..37_547).for_each(|_| sum += 0.001);
        assert_eq!(seconds(sum), "37.547");
        assert_eq!(seconds(0.1 + 0.2), "0.3");
        assert_eq!(seconds(1_000_000.001), "1000000.001");
        assert_eq!(seconds(0.000_012_5), "1.25e-5");
    }
}
