//! The first point at which a margin becomes negative.

/// The most halvings of the unit interval in `Quartic::first_negative`.
const DEPTH: u32 = 20;

/// The largest number of evaluations in `locate`; bisection alone would need 50 for a step of 1 s.
const EVALUATIONS: u32 = 100;
/// The number of evaluations after which `locate` bisects: at a jump or a multiple zero regula falsi hardly narrows the
/// interval.
const SECANTS: u32 = 45;

/// A polynomial of degree 4 on `[0, 1]` by its Bernstein coefficients.
///
/// The coefficients bound the polynomial from both sides, so a sign change cannot hide between
/// samples.
#[derive(Clone, Copy, Debug)]
pub struct Quartic([f64; 5]);

impl Quartic {
    /// The polynomial with these values and rises (derivative times length) at both ends and this value
    /// at the middle.
    #[inline]
    #[must_use]
    pub fn new(start: (f64, f64), middle: f64, end: (f64, f64)) -> Self {
        let near_start = start.0 + start.1 / 4.0;
        let near_end = end.0 - end.1 / 4.0;
        let centre = (16.0 * middle - start.0 - 4.0 * (near_start + near_end) - end.0) / 6.0;
        Self([start.0, near_start, centre, near_end, end.0])
    }

    /// The polynomial with these values at 0, 1/4, 1/2, 3/4 and 1.
    #[must_use]
    pub fn interpolate(values: [f64; 5]) -> Self {
        let [first, _, _, _, last] = values;
        // 256 times the values at 1/4, 1/2 and 3/4, without the terms of the outer coefficients.
        let early = 256.0 * values[1] - 81.0 * first - last;
        let centre = 256.0 * values[2] - 16.0 * (first + last);
        let late = 256.0 * values[3] - first - 81.0 * last;
        let sum = (96.0 * (early + late) - 108.0 * centre) / 4608.0;
        let difference = (early - late) / 96.0;
        let middle = (centre - 64.0 * sum) / 96.0;
        Self([first, 0.5 * (sum + difference), middle, 0.5 * (sum - difference), last])
    }

    /// `offset + factor * self`.
    #[inline]
    #[must_use]
    pub fn affine(&self, offset: f64, factor: f64) -> Self {
        Self(self.0.map(|coefficient| offset + factor * coefficient))
    }

    /// The value at `part` of the interval. Method: de Casteljau.
    #[must_use]
    pub fn value(&self, part: f64) -> f64 {
        let mut row = self.0;
        for level in (1..5).rev() {
            for i in 0..level {
                row[i] += part * (row[i + 1] - row[i]);
            }
        }
        row[0]
    }

    /// Whether all coefficients are finite.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|coefficient| coefficient.is_finite())
    }

    /// Whether no coefficient is negative, which is sufficient for a polynomial without negative values.
    #[inline]
    fn is_surely_not_negative(&self) -> bool {
        self.0.iter().all(|&coefficient| coefficient >= 0.0)
    }

    /// A point with a negative value, at most `2^-20` after the first crossing.
    ///
    /// `None` if the polynomial is nowhere negative, or only within less than `2^-20`.
    /// Method: subdivision after de Casteljau.
    #[inline]
    #[must_use]
    pub fn first_negative(&self) -> Option<f64> {
        if self.is_surely_not_negative() { None } else { self.search(0.0, 1.0, DEPTH) }
    }

    /// [`Quartic::first_negative`] of this part, which starts at `from` and has this `width`, by at most `depth`
    /// halvings.
    fn search(&self, from: f64, width: f64, depth: u32) -> Option<f64> {
        if self.is_surely_not_negative() {
            return None;
        }
        if depth == 0 {
            return (self.0[4] < 0.0).then_some(from + width);
        }
        let (left, right) = self.halves();
        let half = width / 2.0;
        let root = left.search(from, half, depth - 1);
        root.or_else(|| right.search(from + half, half, depth - 1))
    }

    /// The polynomial over both halves of the interval.
    fn halves(&self) -> (Self, Self) {
        let mut row = self.0;
        let mut left = [0.0; 5];
        let mut right = [0.0; 5];
        for level in 0..5 {
            left[level] = row[0];
            right[4 - level] = row[4 - level];
            for i in 0..4 - level {
                row[i] = 0.5 * (row[i] + row[i + 1]);
            }
        }
        (Self(left), Self(right))
    }
}

/// The result of [`search`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossing {
    /// The margin is negative or NaN at this length; at most `width` before it, it is not negative or the step starts.
    At(f64),
    /// The longest length that was tried. The margin is negative at no tried length; at the longest it may be NaN.
    NoneUpTo(f64),
}

/// Searches the first crossing of `margin`, a function of the length of a step. The search starts from an estimate:
/// `fraction`, above 0, of the step of `length`.
///
/// The estimate may be wrong: a margin may only touch zero, or change its sign by rounding. So the margin is evaluated
/// at the estimate and at doubled lengths, up to the whole step. If the margin is negative at one of these lengths,
/// [`locate`] narrows the crossing to `width`.
pub fn search(
    fraction: f64,
    length: f64,
    width: f64,
    mut margin: impl FnMut(f64) -> f64,
) -> Crossing {
    let mut ceiling = fraction * length;
    let mut at_ceiling = margin(ceiling);
    while at_ceiling >= 0.0 && ceiling < length {
        ceiling = (2.0 * ceiling).min(length);
        at_ceiling = margin(ceiling);
    }
    if at_ceiling < 0.0 {
        let at_start = margin(0.0).max(0.0);
        Crossing::At(locate(at_start, (ceiling, at_ceiling), width, margin))
    } else {
        Crossing::NoneUpTo(ceiling)
    }
}

/// Narrows a crossing of `margin`, which is `at_start >= 0` at 0 and negative at `ceiling`, a pair of length and
/// margin. Returns the upper end of the last interval, where the margin is negative or NaN.
///
/// Method: regula falsi with the Illinois rule, after 45 evaluations bisection, until the interval is at most `width`
/// wide, or for 100 evaluations.
pub fn locate(
    at_start: f64,
    ceiling: (f64, f64),
    width: f64,
    mut margin: impl FnMut(f64) -> f64,
) -> f64 {
    let (mut low, mut at_low) = (0.0, at_start);
    let (mut high, mut at_high) = ceiling;
    let mut moved_low = None;
    for count in 0..EVALUATIONS {
        let distance = high - low;
        if distance <= width {
            break;
        }
        let secant = low + distance * at_low / (at_low - at_high);
        let guess = if count < SECANTS {
            secant.max(low + width / 2.0).min(high - width / 2.0)
        } else {
            low + distance / 2.0
        };
        let value = margin(guess);
        let moves_low = value >= 0.0;
        let again = moved_low == Some(moves_low);
        moved_low = Some(moves_low);
        if moves_low {
            (low, at_low) = (guess, value);
            at_high *= if again { 0.5 } else { 1.0 };
        } else {
            (high, at_high) = (guess, value);
            at_low *= if again { 0.5 } else { 1.0 };
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    const WIDTH: f64 = 1e-15;

    /// The quartic `scale * product(s - root)`, built from its values and derivatives.
    fn with_roots(scale: f64, roots: [f64; 4]) -> Quartic {
        let value = |s: f64| scale * roots.iter().map(|root| s - root).product::<f64>();
        let without = |skip: usize, s: f64| -> f64 {
            let others = roots.iter().enumerate().filter(|(i, _)| *i != skip);
            others.map(|(_, root)| s - root).product()
        };
        let rise = |s: f64| scale * (0..4).map(|skip| without(skip, s)).sum::<f64>();
        Quartic::new((value(0.0), rise(0.0)), value(0.5), (value(1.0), rise(1.0)))
    }

    #[test]
    fn the_first_of_several_crossings_is_found() {
        let actual = with_roots(1.0, [0.2, 0.3, 0.6, 0.7]).first_negative().unwrap();
        assert!((actual - 0.2).abs() < 2e-6 && actual >= 0.2, "{actual}");
        let actual = with_roots(-1.0, [-0.5, 0.35, 1.5, 2.0]).first_negative().unwrap();
        assert!((actual - 0.35).abs() < 2e-6 && actual >= 0.35, "{actual}");
    }

    #[test]
    fn a_narrow_dip_between_positive_ends_is_found() {
        let actual = with_roots(1.0, [0.4, 0.400_1, -1.0, -2.0]).first_negative().unwrap();
        assert!((0.4..0.400_1).contains(&actual), "{actual}");
    }

    #[test]
    fn a_touching_or_positive_polynomial_has_no_crossing() {
        assert!(with_roots(1.0, [-0.1, -0.2, 1.1, 1.2]).first_negative().is_none());
        assert!(with_roots(1.0, [0.0, 0.0, -1.0, -1.0]).first_negative().is_none());
        assert!(Quartic([0.0; 5]).first_negative().is_none());
    }

    #[test]
    fn a_fall_from_zero_is_found_at_the_start() {
        let actual = Quartic([0.0, -0.1, -0.2, -0.3, -0.4]).first_negative().unwrap();
        assert!(actual < 2e-6);
    }

    #[test]
    fn five_values_determine_the_polynomial() {
        let value = |s: f64| 3.0 - s * (2.0 + s * (1.5 - s * (4.0 - 0.7 * s)));
        let actual = Quartic::interpolate([0.0, 0.25, 0.5, 0.75, 1.0].map(value));
        for part in [0.0, 0.1, 0.33, 0.5, 0.8, 1.0] {
            assert!((actual.value(part) - value(part)).abs() < 1e-13);
        }
    }

    #[test]
    fn a_crossing_is_located_to_the_last_digits_from_above() {
        let count = Cell::new(0);
        let margin = |s: f64| {
            count.set(count.get() + 1);
            (1.0 - s * s).exp_m1() - 0.9
        };
        let root = (1.0 - 1.9_f64.ln()).sqrt();
        let actual = locate(margin(0.0), (1.0, margin(1.0)), WIDTH, margin);
        assert!((actual - root).abs() < 2e-15 && margin(actual) < 0.0);
        assert!(count.get() < 20, "{} evaluations", count.get());
    }

    #[test]
    fn jumps_and_multiple_zeros_are_located_to_the_width() {
        let margins: [fn(f64) -> f64; 3] = [
            |s| (0.3 - s).powi(5),
            |s| if s < 0.3 { 1.0 } else { -1e-9 },
            |s| if s < 0.3 { 0.3 - s } else { -f64::MIN_POSITIVE },
        ];
        for (number, margin) in margins.into_iter().enumerate() {
            let actual = locate(margin(0.0), (1.0, margin(1.0)), WIDTH, margin);
            assert!((0.3..0.3 + 2e-15).contains(&actual), "{number}: {actual}");
        }
    }

    #[test]
    fn a_crossing_at_the_very_start_is_located_there() {
        let actual = locate(0.0, (1e-6, -1e-6), WIDTH, |s| -s);
        assert!((0.0..=1e-14).contains(&actual), "{actual}");
    }

    #[test]
    fn an_estimate_before_the_crossing_is_extended_up_to_the_end() {
        assert_eq!(search(0.1, 1.0, WIDTH, |_| 1.0), Crossing::NoneUpTo(1.0));
        let Crossing::At(actual) = search(0.1, 1.0, WIDTH, |s| 0.75 - s) else { panic!("none") };
        assert!((actual - 0.75).abs() < 1e-14);
    }
}
