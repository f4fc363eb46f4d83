//! Numbers in messages, rounded to the digits that mean something.

use std::fmt;

/// Significant digits of a time; the rounding error of a sum of steps is smaller than the last digit.
const TIME: usize = 12;

/// Returns `value`, rounded to `digits` significant digits (1 to 15), without trailing zeros after the decimal point.
/// Has an exponent if the magnitude is below 1e-4, or if there are more digits before the decimal point than both
/// `digits` and 6. NaN and infinity are `NaN` and `inf`.
#[must_use]
pub fn rounded(value: f64, digits: usize) -> String {
    let mut text = String::new();
    // Writing to a `String` does not fail.
    let _ = write_rounded(&mut text, value, digits);
    text
}

/// Writes [`rounded`] without heap allocation.
fn write_rounded(out: &mut impl fmt::Write, value: f64, digits: usize) -> fmt::Result {
    if value == 0.0 || !value.is_finite() {
        return write!(out, "{value}");
    }
    // Uses integers, because formatting with a precision and parsing need tables that are large in WebAssembly.
    let (mut mantissa, exponent) = scaled(value.abs(), digits);
    while mantissa > 9 && mantissa.is_multiple_of(10) {
        mantissa /= 10;
    }
    let sign = if value < 0.0 { "-" } else { "" };
    let longest = i32::try_from(digits.max(6)).unwrap_or(i32::MAX);
    let has_exponent = !(-4..longest).contains(&exponent);
    // Number of digits after the decimal point; if negative, of zeros before it.
    let decimals = mantissa.ilog10().cast_signed() - if has_exponent { 0 } else { exponent };
    let unit = 10_u64.pow(decimals.unsigned_abs());
    if decimals > 0 {
        let width = decimals.unsigned_abs() as usize;
        let (whole, rest) = (mantissa / unit, mantissa % unit);
        write!(out, "{sign}{whole}.{rest:0width$}")?;
    } else {
        write!(out, "{sign}{}", mantissa * unit)?;
    }
    if has_exponent { write!(out, "e{exponent}") } else { Ok(()) }
}

/// Returns the first `digits` (at least 1, at most 15) significant digits of a positive number, rounded, as an
/// integer, and the power of ten of the first digit.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 15 digits")]
fn scaled(value: f64, digits: usize) -> (u64, i32) {
    let digits = i32::try_from(digits.clamp(1, 15)).unwrap_or(15);
    let largest = 10f64.powi(digits);
    let mut exponent = value.log10().floor() as i32;
    loop {
        let shift = digits - 1 - exponent;
        // Two factors, because a single power of ten could overflow.
        let first = shift.clamp(-300, 300);
        let mantissa = (value * 10f64.powi(first) * 10f64.powi(shift - first)).round();
        if mantissa >= largest {
            exponent += 1;
        } else if mantissa < largest / 10.0 {
            exponent -= 1;
        } else {
            return (mantissa as u64, exponent);
        }
    }
}

/// Returns a time in s, or the length of a step, without the rounding errors of its computation:
/// `37.547` for the sum of 37547 steps of 0.001 s, which is 37.547000000000004.
#[must_use]
pub fn seconds(time: f64) -> String {
    rounded(time, TIME)
}

/// Writes [`seconds`] without heap allocation, for signal handlers.
///
/// # Errors
///
/// [`fmt::Error`] if `out` refuses a part.
pub fn write_seconds(out: &mut impl fmt::Write, time: f64) -> fmt::Result {
    write_rounded(out, time, TIME)
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
            (0.999_96, 3, "1"),
            (999_960.0, 3, "1e6"),
            (5e-324, 3, "4.94e-324"),
            (f64::MAX, 3, "1.8e308"),
            (1e-15, 12, "1e-15"),
            (1.0 / 3.0, 12, "0.333333333333"),
            (f64::INFINITY, 3, "inf"),
            (f64::NAN, 3, "NaN"),
        ];
        for (value, digits, text) in cases {
            assert_eq!(rounded(value, digits), text);
        }
    }

    #[test]
    fn rounding_is_as_near_as_that_of_the_standard_library() {
        for k in 1..4000_i32 {
            let value = f64::from(k).sqrt() * 10f64.powi(k % 601 - 300);
            for digits in [1, 3, 6, 12] {
                let decimals = digits - 1;
                let expected: f64 = format!("{value:.decimals$e}").parse().unwrap();
                let result: f64 = rounded(value, digits).parse().unwrap();
                // They differ only if `value` is halfway between two numbers with so many digits.
                let (error, least) = ((result - value).abs(), (expected - value).abs());
                assert!(error <= 1.001 * least, "{value:e} {digits}: {result:e}, {expected:e}");
            }
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
