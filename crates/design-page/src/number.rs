//! Formats numbers.

use maud::{Markup, html};

use design_report::number::{NO_LIMIT, rounded};

/// Returns a text with the fewest significant digits that parse to the same finite number in TOML, numpy and MATLAB.
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
    html! { data value=(exact(value)) title=(exact(value)) { (rounded(value)) } }
}

/// Formats a time in a sentence; an infinite one has no unit.
pub(super) fn seconds(time: f64) -> Markup {
    html! { @if time.is_finite() { (number(time)) " s" } @else { (NO_LIMIT) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complex_number_has_two_parts_and_a_real_one_has_none() {
        assert_eq!(complex([-4.5, -3.25], rounded), "-4.5 - 3.25i");
        assert_eq!(complex([-4.5, 0.0], rounded), "-4.5");
    }
}
