//! From values to places on the page, and the round numbers along an axis.

/// Beyond this magnitude a value is only "very large": sums of two such values stay finite.
const HUGE: f64 = 1e300;

/// A linear axis from an interval of values to an interval of the page.
#[derive(Debug)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    pixels: (f64, f64),
    /// About as many ticks as look well.
    ticks: u8,
}

impl Axis {
    /// The axis ends where the interval ends; one that is empty or not finite becomes usable.
    pub(super) fn exact((low, high): (f64, f64), pixels: (f64, f64), ticks: u8) -> Self {
        let (low, high) = if low <= high && low.is_finite() && high.is_finite() {
            (low.clamp(-HUGE, HUGE), high.clamp(-HUGE, HUGE))
        } else {
            (0.0, 1.0)
        };
        let size = low.abs().max(high.abs());
        let widening = if high - low > 1e-9 * size {
            0.0
        } else if size > 0.0 {
            0.1 * size
        } else {
            1.0
        };
        Self { low: low - widening, high: high + widening, pixels, ticks }
    }

    /// An axis with some air around finite values, up to a cap of their magnitude.
    pub(super) fn around(
        values: impl Iterator<Item = f64>,
        cap: Option<f64>,
        pixels: (f64, f64),
        ticks: u8,
    ) -> Self {
        let cap = cap.unwrap_or(HUGE).abs();
        let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            let value = value.clamp(-cap, cap);
            (low.min(value), high.max(value))
        });
        let tight = Self::exact(ends, pixels, ticks);
        let air = 0.06 * (tight.high - tight.low);
        Self { low: tight.low - air, high: tight.high + air, ..tight }
    }

    pub(super) fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    pub(super) fn pixels(&self) -> (f64, f64) {
        self.pixels
    }

    pub(super) fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// The place of a value on the page; a value far outside stops one axis length outside.
    pub(super) fn place(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        let (first, last) = self.pixels;
        first + share.clamp(-1.0, 2.0) * (last - first)
    }

    /// Multiples of 1, 2 or 5 times a power of ten inside the axis, with their labels.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        let span = self.high - self.low;
        let step = round_step(span / f64::from(self.ticks));
        let first = ((self.low - 1e-9 * span) / step).ceil();
        std::iter::successors(Some(first), |count| Some(count + 1.0))
            .map(|count| count * step)
            .take_while(|value| *value <= self.high + 1e-9 * span)
            .take(2 * usize::from(self.ticks))
            .map(|value| (value, label(value, step, self.low.abs().max(self.high.abs()))))
            .collect()
    }
}

/// The nearest of 1, 2, 5 times a power of ten, above or at `wanted`.
fn round_step(wanted: f64) -> f64 {
    let power = 10_f64.powf(wanted.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= 0.999 * wanted);
    factor.unwrap_or(10.0) * power
}

/// The digits that tell neighbouring ticks apart, with a true minus sign.
fn label(value: f64, step: f64, largest: f64) -> String {
    if value.abs() < 0.5 * step {
        return "0".to_owned();
    }
    let text = if largest >= 1e6 || step < 1e-6 {
        format!("{value:.1e}")
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
            (3.0, 3.0),
            (0.0, 0.0),
            (1e5, 1e5 + 1.0),
            (f64::NAN, 1.0),
        ] {
            let axis = Axis::exact((low, high), (0.0, 100.0), 5);
            let ticks = axis.ticks();
            assert!((2..=8).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
            let step = ticks[1].0 - ticks[0].0;
            let mantissa: f64 = format!("{step:.3e}").split('e').next().unwrap().parse().unwrap();
            assert!([1.0, 2.0, 5.0].contains(&mantissa), "{low} to {high}: step {step}");
            for (value, label) in &ticks {
                assert!(axis.contains(*value) || (value - low).abs() < 1e-6 * step);
                let read: f64 = label.replace('\u{2212}', "-").parse().unwrap();
                assert!((read - value).abs() <= 1e-3 * step, "{label} stands at {value}");
            }
        }
    }

    #[test]
    fn labels_have_the_digits_of_the_step_and_no_more() {
        let labels = |low, high| -> Vec<String> {
            let axis = Axis::exact((low, high), (0.0, 1.0), 5);
            axis.ticks().into_iter().map(|(_, label)| label).collect()
        };
        assert_eq!(labels(-0.2, 0.2), ["\u{2212}0.2", "\u{2212}0.1", "0", "0.1", "0.2"]);
        assert_eq!(labels(0.0, 100.0), ["0", "20", "40", "60", "80", "100"]);
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
