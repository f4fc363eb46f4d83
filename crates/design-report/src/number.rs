//! Rounds numbers, and formats them with five digits. Says what an infinite time means.

/// Takes the place of an infinite number and its unit in a sentence, where nothing limits the quantity.
pub const NO_LIMIT: &str = "no limit";

/// Describes when a response stays within its band, with the time formatted by `number`; `time` is infinite if the
/// response is outside the band at the end of its trace.
#[must_use]
pub fn settled(time: f64, number: impl Fn(f64) -> String) -> String {
    if time.is_finite() {
        format!("settled after {} s", number(time))
    } else {
        "not settled at the end of the response".to_owned()
    }
}

/// Formats a number with five digits, or more for whole numbers below 1e7 and for numbers from 1e5 to 1e6. NaN is
/// `undefined`.
#[must_use]
pub fn rounded(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if value.is_nan() {
        return "undefined".to_owned();
    }
    if value.is_infinite() {
        return if value < 0.0 { "-∞" } else { "∞" }.to_owned();
    }
    if value.abs() < 1e7 && value.fract() == 0.0 {
        return format!("{value:.0}");
    }
    let scientific = format!("{value:.4e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    match exponent.parse::<i32>() {
        Ok(power @ -4..=5) => {
            let decimals = usize::try_from(4 - power).unwrap_or(0);
            trimmed(&format!("{value:.decimals$}")).to_owned()
        }
        _ => format!("{}e{exponent}", trimmed(mantissa)),
    }
}

/// Removes trailing zeros of the decimals.
fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// Rounds a number above 0 to the nearest 1, 2 or 5 times a power of ten, on the logarithmic scale.
#[must_use]
pub fn round(x: f64) -> f64 {
    let exponent = x.log10().floor();
    let part = x.log10() - exponent;
    let distance = |factor: &f64| (factor.log10() - part).abs();
    let factors = [1.0, 2.0, 5.0, 10.0].into_iter();
    let factor = factors.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(1.0);
    // A division rounds 0.1, 0.01 and so on to the nearest double; a product does not.
    if exponent < 0.0 { factor / 10_f64.powf(-exponent) } else { factor * 10_f64.powf(exponent) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_digits_are_shown_without_needless_zeros() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1200.0, "1200"),
            (-3_000_000.0, "-3000000"),
            (0.320_516_673_912_271_3, "0.32052"),
            (-1.933_251_723_650_304, "-1.9333"),
            (3_652.463_863_193_069_3, "3652.5"),
            (0.5, "0.5"),
            (0.000_123_456, "0.00012346"),
            (0.000_012_345_6, "1.2346e-5"),
            (10_959_555.984_926_537, "1.096e7"),
            (123_456.7, "123457"),
            (999_999.7, "1e6"),
            (0.999_999_9, "1"),
            (f64::INFINITY, "∞"),
            (f64::MIN_POSITIVE, "2.2251e-308"),
        ] {
            assert_eq!(rounded(value), text, "{value}");
        }
    }
}
