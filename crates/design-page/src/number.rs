//! Formats numbers.

use maud::{Markup, html};

use design_report::number::rounded;

/// Returns the shortest text that parses to the same finite number in TOML, numpy and MATLAB.
pub(super) fn exact(value: f64) -> String {
    format!("{value:?}")
}

/// Formats a complex number, a real one without its imaginary part; `part` formats each part.
pub(super) fn complex([re, im]: [f64; 2], part: fn(f64) -> String) -> String {
    if im == 0.0 {
        return part(re);
    }
    let sign = if im < 0.0 { '-' } else { '+' };
    format!("{} {sign} {}i", part(re), part(im.abs()))
}

/// Formats a number in a sentence: rounded, with all digits in the tooltip.
pub(super) fn number(value: f64) -> Markup {
    with_digits(value, &rounded(value))
}

/// Formats a part of `whole` in a sentence, as [`number`] does, rounded by [`rounded_part`].
pub(super) fn part(value: f64, whole: f64) -> Markup {
    with_digits(value, &rounded_part(value, whole))
}

fn with_digits(value: f64, text: &str) -> Markup {
    html! { data value=(exact(value)) title=(exact(value)) { (text) } }
}

/// Rounds a part of `whole`, such as 100 %, to five digits; a smaller part is not rounded up to the whole.
pub(super) fn rounded_part(value: f64, whole: f64) -> String {
    rounded(if value < whole { value.min(whole * (1.0 - 1e-5)) } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complex_number_has_two_parts_and_a_real_one_has_none() {
        assert_eq!(complex([-4.5, -3.25], rounded), "-4.5 - 3.25i");
        assert_eq!(complex([-4.5, 0.0], rounded), "-4.5");
    }

    #[test]
    fn a_part_is_rounded_to_the_whole_only_if_it_is_the_whole() {
        let stable = 299_999.0 / 300_000.0;
        assert_eq!(rounded(100.0 * stable), "100");
        assert_eq!(rounded_part(100.0 * stable, 100.0), "99.999");
        assert_eq!(rounded_part(stable, 1.0), "0.99999");
        assert_eq!(rounded_part(100.0, 100.0), "100");
        assert_eq!(rounded_part(87.5, 100.0), "87.5");
    }
}
