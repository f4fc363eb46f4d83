//! Modes that no gain moves, in words.

use control::Domain;
use control::rank::Mode;
use nalgebra::Complex;

/// Whether the eigenvalue of a sampled mode is e^(p T) of a rate p, real or one of a complex pair: 0 and negative
/// numbers are not.
pub(crate) fn has_rate(mode: &Mode) -> bool {
    mode.eigenvalue.re > 0.0 || mode.eigenvalue.im != 0.0
}

/// Describes a mode, for example `the eigenvalue -2 1/s, which x2 dominates`.
///
/// In sampled time the eigenvalue is that of the sampled loop if `sampled`, or if it has no rate, see [`has_rate`];
/// otherwise it is the rate in 1/s. `name` returns the name of a state.
pub(crate) fn described_in(
    mode: &Mode,
    domain: Domain,
    sampled: bool,
    name: impl Fn(usize) -> String,
) -> String {
    let (eigenvalue, unit) = match domain {
        Domain::Sampled { period } if !sampled && has_rate(mode) => {
            (mode.eigenvalue.ln() / period, " 1/s")
        }
        Domain::Sampled { .. } => (mode.eigenvalue, " of the sampled loop"),
        Domain::Continuous => (mode.eigenvalue, " 1/s"),
    };
    let states: Vec<_> = mode.dominant.iter().map(|&state| name(state)).collect();
    let verb = if states.len() == 1 { "dominates" } else { "dominate" };
    let kind = if eigenvalue.im == 0.0 { "the eigenvalue" } else { "the eigenvalues" };
    format!("{kind} {}{unit}, which {} {verb}", shown(eigenvalue), states.join(", "))
}

/// Returns an eigenvalue as text with six digits; a complex one together with its conjugate. A number
/// that is read from the text differs by less than 1e-5 relative to the eigenvalue.
pub(crate) fn shown(value: Complex<f64>) -> String {
    match value.im {
        0.0 => digits(value.re),
        im => format!("{} ± {}i", digits(value.re), digits(im.abs())),
    }
}

fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    // -0 becomes 0.
    let rounded = rounded + 0.0;
    match rounded.abs() {
        size if size == 0.0 || (1e-4..1e6).contains(&size) => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::rank::uncontrollable_modes;
    use nalgebra::DMatrix;

    /// e^(-2 T) is the eigenvalue of a rate; for -0.5 the logarithm is half of a complex pair.
    #[test]
    fn only_an_eigenvalue_above_zero_is_a_rate() {
        let domain = Domain::Sampled { period: 0.1 };
        for (eigenvalue, expected) in [
            ((-0.2_f64).exp(), "the eigenvalue -2 1/s, which x2 dominates"),
            (-0.5, "the eigenvalue -0.5 of the sampled loop, which x2 dominates"),
        ] {
            let a = DMatrix::from_row_slice(2, 2, &[0.3, 0.0, 0.0, eigenvalue]);
            let b = DMatrix::from_row_slice(2, 1, &[1.0, 0.0]);
            let modes = uncontrollable_modes(&a, &b).unwrap();
            let name = |at: usize| format!("x{}", at + 1);
            assert_eq!(described_in(&modes[0], domain, false, name), expected);
        }
    }

    #[test]
    fn an_eigenvalue_has_six_digits() {
        let values =
            [(-2.0, 0.0), (-1.234_567_8, 2.0 / 3.0), (0.0, -1.0), (1e-17, 0.0), (-4e7, 0.0)];
        let texts = values.map(|(re, im)| shown(Complex::new(re, im)));
        assert_eq!(texts, ["-2", "-1.23457 ± 0.666667i", "0 ± 1i", "1e-17", "-4e7"]);
    }
}
