//! Formats numbers.

use maud::{Markup, html};

/// Returns the shortest text that parses to the same number in TOML, numpy and MATLAB.
pub(super) fn exact(value: f64) -> String {
    format!("{value:?}")
}

/// Returns the number with five digits, more for whole numbers.
pub(crate) fn rounded(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return if value.is_nan() {
            "undefined"
        } else {
            ["∞", "-∞"][usize::from(value < 0.0)]
        }
        .to_owned();
    }
    if value.abs() < 1e7 && value.fract() == 0.0 {
        return format!("{value:.0}");
    }
    let scientific = format!("{value:.4e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    match exponent {
        "-4" | "-3" | "-2" | "-1" | "0" | "1" | "2" | "3" | "4" | "5" => {
            let decimals = 4 - exponent.parse::<i32>().unwrap_or(0);
            trimmed(&format!("{value:.*}", usize::try_from(decimals).unwrap_or(0))).to_owned()
        }
        _ => format!("{}e{exponent}", trimmed(mantissa)),
    }
}

/// Removes trailing zeros of the decimals.
fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// Formats a complex number; `part` formats each part.
pub(super) fn complex([re, im]: [f64; 2], part: fn(f64) -> String) -> String {
    if im == 0.0 {
        return part(re);
    }
    let sign = if im < 0.0 { '-' } else { '+' };
    format!("{} {sign} {}i", part(re), part(im.abs()))
}

/// Formats a number in a sentence: rounded, with all digits in the tooltip.
pub(super) fn number(value: f64) -> Markup {
    html! { data value=(exact(value)) title=(exact(value)) { (rounded(value)) } }
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
        assert_eq!(complex([-4.5, -3.25], rounded), "-4.5 - 3.25i");
        assert_eq!(complex([-4.5, 0.0], rounded), "-4.5");
    }
}
