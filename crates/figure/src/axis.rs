//! Axes: the map from values to page coordinates, and the ticks at round values.

/// Ends of axes of a larger magnitude are clipped to this value, so that ticks just beyond them stay finite.
const HUGE: f64 = 1.797e308;
/// Ends of symmetric axes are clipped to this value, so that quotients by their knee stay finite.
const HUGE_SYMMETRIC: f64 = 1e300;

/// The scale of an axis.
#[derive(Debug, Clone, Copy)]
enum Scale {
    Linear,
    /// Linear between minus and plus this magnitude, logarithmic beyond.
    Symmetric(f64),
}

impl Scale {
    /// Maps a value to a linear scale. On a symmetric scale, the knee becomes 1, and each further decade adds 1.
    fn to_linear(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Symmetric(knee) => {
                let size = (value / knee).abs();
                value.signum() * if size <= 1.0 { size } else { 1.0 + size.log10() }
            }
        }
    }
}

/// An axis that maps a range of values to a range of the page.
#[derive(Debug)]
pub struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    pixels: (f64, f64),
    /// Approximate number of ticks.
    ticks: u8,
}

impl Axis {
    /// Creates a linear axis with exactly this range. A range that is reversed or not finite is replaced by 0 to 1, and
    /// a range of almost no length is widened.
    #[must_use]
    pub fn exact(low: f64, high: f64, pixels: (f64, f64), ticks: u8) -> Self {
        Self::longer_than(1e-12, (low, high), pixels, ticks)
    }

    /// Same as [`Self::exact`], but widens a range whose length is at most `relative` times the magnitude of its ends.
    fn longer_than(relative: f64, (low, high): (f64, f64), pixels: (f64, f64), ticks: u8) -> Self {
        let (low, high) = if low <= high && low.is_finite() && high.is_finite() {
            (low.clamp(-HUGE, HUGE), high.clamp(-HUGE, HUGE))
        } else {
            (0.0, 1.0)
        };
        let size = low.abs().max(high.abs());
        let widening = if high - low > relative * size {
            0.0
        } else if size > 0.0 {
            0.1 * size
        } else {
            1.0
        };
        let (low, high) = ((low - widening).max(-HUGE), (high + widening).min(HUGE));
        Self { scale: Scale::Linear, low, high, pixels, ticks }
    }

    /// Creates an axis over `ends`: linear between minus and plus `knee`, which is above 0, logarithmic beyond.
    #[must_use]
    pub fn symmetric(ends: (f64, f64), knee: f64, pixels: (f64, f64), ticks: u8) -> Self {
        let [low, high] = [ends.0, ends.1].map(|end| end.clamp(-HUGE_SYMMETRIC, HUGE_SYMMETRIC));
        Self { scale: Scale::Symmetric(knee), ..Self::exact(low, high, pixels, ticks) }
    }

    /// Creates a linear axis with a margin around `values`, clipped to magnitudes up to `cap`. Ignores NaN; without
    /// values, the axis is around 0 to 1. Values that differ by up to 1e-9 of their magnitude count as equal, because
    /// they may be a constant with rounding errors.
    pub fn around(
        values: impl Iterator<Item = f64>,
        cap: Option<f64>,
        pixels: (f64, f64),
        ticks: u8,
    ) -> Self {
        let cap = cap.unwrap_or(HUGE).abs();
        let infinities = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = values.fold(infinities, |(low, high), value| {
            let value = value.clamp(-cap, cap);
            (low.min(value), high.max(value))
        });
        let tight = Self::longer_than(1e-9, (low, high), pixels, ticks);
        let margin = 0.06 * tight.shrunk_length() / tight.shrinkage();
        let (low, high) = (tight.low - margin, tight.high + margin);
        Self { low: low.max(-HUGE), high: high.min(HUGE), ..tight }
    }

    /// Returns the factor by which lengths are shrunk so that they stay finite; 1 unless the ends are huge.
    fn shrinkage(&self) -> f64 {
        if self.low.abs().max(self.high.abs()) > HUGE_SYMMETRIC { 0.25 } else { 1.0 }
    }

    /// Returns the length of a linear axis times [`Self::shrinkage`].
    fn shrunk_length(&self) -> f64 {
        let factor = self.shrinkage();
        factor * self.high - factor * self.low
    }

    /// Returns the range of the values.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Returns the page coordinates of both ends of the range.
    #[must_use]
    pub fn pixels(&self) -> (f64, f64) {
        self.pixels
    }

    /// Returns whether a value is in the range.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Returns the page coordinate of a value, clipped to at most one axis length beyond the axis; NaN for NaN.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        let factor = self.shrinkage();
        let linear = |end| factor * self.scale.to_linear(end);
        let [low, high, value] = [self.low, self.high, value].map(linear);
        let share = (value - low) / (high - low);
        let (first, last) = self.pixels;
        first + share.clamp(-1.0, 2.0) * (last - first)
    }

    /// Returns round values inside the axis, with their labels.
    #[must_use]
    pub fn ticks(&self) -> Vec<(f64, String)> {
        match self.scale {
            Scale::Linear => self.multiples(),
            Scale::Symmetric(knee) => {
                let decades = |end: f64| (end / knee).max(1.0).log10();
                let stride = self.stride(decades(-self.low) + decades(self.high));
                let negative = powers(knee.max(-self.high), -self.low, stride);
                negative
                    .into_iter()
                    .rev()
                    .map(|(value, label)| (-value, format!("\u{2212}{label}")))
                    .chain(self.contains(0.0).then(|| (0.0, "0".to_owned())))
                    .chain(powers(knee.max(self.low), self.high, stride))
                    .collect()
            }
        }
    }

    /// Returns the number of decades between two ticks of an axis that spans `decades`.
    fn stride(&self, decades: f64) -> i32 {
        let most = f64::from(self.ticks);
        (1..=300).find(|stride| decades <= most * f64::from(*stride)).unwrap_or(300)
    }

    /// Returns the ticks at multiples of 1, 2 or 5 times a power of ten.
    fn multiples(&self) -> Vec<(f64, String)> {
        let (span, factor) = (self.shrunk_length(), self.shrinkage());
        let step = round_step(span / f64::from(self.ticks) / factor);
        let tolerance = 1e-9 * span / factor;
        let first = ((self.low - tolerance) / step).ceil();
        std::iter::successors(Some(first), |count| Some(count + 1.0))
            .map(|count| count * step)
            .take_while(|value| *value <= self.high + tolerance)
            .take(2 * usize::from(self.ticks))
            .map(|value| (value, label(value, step, self.low.abs().max(self.high.abs()))))
            .collect()
    }
}

/// Returns each power of ten from `low` to `high`, with a tolerance of 0.1 %, whose exponent is a multiple of `stride`,
/// and its label.
fn powers(low: f64, high: f64, stride: i32) -> Vec<(f64, String)> {
    (-300..=300)
        .filter(|power| power % stride == 0)
        .map(|power| (10_f64.powi(power), power_label(power)))
        .filter(|(value, _)| (0.999 * low..=1.001 * high).contains(value))
        .collect()
}

/// Formats a power of ten: 0.01, 1000 or 10⁻⁵.
fn power_label(power: i32) -> String {
    if (-3..=3).contains(&power) {
        let decimals = usize::try_from(-power).unwrap_or(0);
        return format!("{:.decimals$}", 10_f64.powi(power));
    }
    let raise = |sign| match sign {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32(digit as u32 - '0' as u32 + '⁰' as u32).unwrap_or(digit),
    };
    format!("10{}", power.to_string().chars().map(raise).collect::<String>())
}

/// Returns the smallest of 1, 2, 5 times a power of ten that is not below `minimum`, with a tolerance of 0.1 %.
fn round_step(minimum: f64) -> f64 {
    let power = 10_f64.powf(minimum.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= 0.999 * minimum);
    factor.unwrap_or(10.0) * power
}

/// Formats a tick with the digits that distinguish it from its neighbours, and with a true minus
/// sign.
fn label(value: f64, step: f64, largest: f64) -> String {
    if value.abs() < 0.5 * step {
        return "0".to_owned();
    }
    let text = if largest >= 1e6 || step < 1e-4 {
        let digits = value.abs().log10().floor() - step.log10().floor();
        let digits = (1_u8..15).find(|count| f64::from(*count) >= digits).unwrap_or(15);
        format!("{value:.*e}", usize::from(digits))
    } else {
        let decimals = (0_u8..6).find(|decimals| {
            let scaled = step * 10_f64.powi(i32::from(*decimals));
            scaled > 0.5 && (scaled - scaled.round()).abs() < 1e-6
        });
        format!("{value:.*}", usize::from(decimals.unwrap_or(6)))
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_few_round_numbers_inside_the_axis() {
        for (low, high) in [
            (0.0, 100.0),
            (-0.1654, 0.1699),
            (59.99, 66.01),
            (-1.06e-3, 1.1e-3),
            (-1e300, 1e300),
            (-1.7e308, 1.7e308),
            (1.5e308, f64::MAX),
            (3.0, 3.0),
            (0.0, 0.0),
            (1e5, 1e5 + 1.0),
            (-1e7, -1e7 + 3.0),
            (1.7e9, 1.7e9 + 0.01),
            (f64::NAN, 1.0),
        ] {
            let axis = Axis::exact(low, high, (0.0, 100.0), 5);
            let ticks = axis.ticks();
            assert!((2..=8).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
            let step = ticks[1].0 - ticks[0].0;
            let mantissa: f64 = format!("{step:.3e}").split('e').next().unwrap().parse().unwrap();
            assert!([1.0, 2.0, 5.0].contains(&mantissa), "{low} to {high}: step {step}");
            for (value, label) in &ticks {
                assert!(axis.contains(*value) || (value - low).abs() < 1e-6 * step);
                let read: f64 = label.replace('\u{2212}', "-").parse().unwrap();
                assert!((read - value).abs() <= 1e-3 * step, "{label} is at {value}");
            }
        }
    }

    #[test]
    fn labels_have_as_many_digits_as_the_step() {
        let labels = |low, high| -> Vec<String> {
            let axis = Axis::exact(low, high, (0.0, 1.0), 5);
            axis.ticks().into_iter().map(|(_, label)| label).collect()
        };
        assert_eq!(labels(-0.2, 0.2), ["\u{2212}0.2", "\u{2212}0.1", "0", "0.1", "0.2"]);
        assert_eq!(labels(0.0, 100.0), ["0", "20", "40", "60", "80", "100"]);
    }

    #[test]
    fn a_second_since_1970_fills_an_axis_of_times_but_not_one_around_values() {
        let (start, end) = (1.7e9, 1.7e9 + 1.0);
        assert_eq!(Axis::exact(start, end, (0.0, 1.0), 5).range(), (start, end));
        let (low, high) = Axis::around([start, end].into_iter(), None, (0.0, 1.0), 5).range();
        assert!(low < 1.6e9 && high > 1.8e9, "{low} {high}");
    }

    #[test]
    fn an_axis_around_the_largest_numbers_has_them_inside() {
        for (low, high) in [(-1.7e308, 1.7e308), (-1e-3, 1.79e308), (1.79e308, 1.79e308)] {
            let axis = Axis::around([low, high].into_iter(), None, (0.0, 100.0), 5);
            let places = [low, high].map(|value| axis.place(value));
            assert!(axis.contains(low) && axis.contains(high), "{low} to {high}");
            assert!(places[0] <= places[1] && (0.0..=100.0).contains(&places[0]), "{places:?}");
            assert!(low >= high || places[1] - places[0] > 80.0, "{places:?}");
        }
    }

    fn texts(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().map(|(_, label)| label.replace('\u{2212}', "-")).collect()
    }

    #[test]
    fn a_symmetric_axis_is_linear_near_zero_with_decades_on_both_sides() {
        let axis = Axis::symmetric((-1e4, 10.0), 1.0, (0.0, 700.0), 9);
        for (value, place) in
            [(-1e4, 0.0), (-10.0, 300.0), (-0.5, 450.0), (0.0, 500.0), (10.0, 700.0)]
        {
            assert!((axis.place(value) - place).abs() < 1e-9, "{value}");
        }
        assert_eq!(texts(&axis), ["-10⁴", "-1000", "-100", "-10", "-1", "0", "1", "10"]);
        assert!(axis.place(f64::NAN).is_nan());
        let many = Axis::symmetric((-1e12, 0.0), 1e-4, (0.0, 1.0), 7);
        assert_eq!(texts(&many), ["-10¹²", "-10⁹", "-10⁶", "-1000", "-1", "-0.001", "0"]);
    }

    #[test]
    fn an_axis_stops_at_its_cap() {
        let values = [0.5, -1e300, 0.2];
        let axis = Axis::around(values.into_iter(), Some(2.0), (0.0, 1.0), 5);
        let (low, high) = axis.range();
        assert!((-2.5..-2.0).contains(&low) && (0.5..1.0).contains(&high), "{low} {high}");
        assert!(!axis.contains(-1e300));
    }
}
