//! The signals of a design file: names, units, limits and ranges.

use serde::{Deserialize, Serialize};

/// Unit and meaning of a signal.
#[derive(Clone, Copy)]
pub struct Label<'a> {
    /// The unit of the signal.
    pub unit: Option<&'a String>,
    /// The description of the signal, or the name if it has no description.
    pub meaning: &'a str,
}

/// A fault that is a loss of effectiveness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loss {
    /// The position of the fault.
    pub fault: usize,
    /// The position of the actuator.
    pub actuator: usize,
    /// u_e, the command at which the estimate is half of the loss; for larger commands the estimate tends to the loss.
    pub least_command: f64,
}

/// Declares signals: each has a name, a unit and a description, and then its own entries.
macro_rules! signals {
    ($($(#[$about:meta])* $signal:ident { $($(#[$text:meta])* $entry:ident: $kind:ty,)* })*) => {$(
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $signal {
            /// The name of the signal and of its variables.
            pub name: String,
            /// The unit of the signal, as FMI writes it.
            #[serde(default)]
            pub unit: Option<String>,
            /// The description of the signal for a reader.
            #[serde(default)]
            pub description: String,
            $($(#[$text])* #[serde(default)] pub $entry: $kind,)*
        }

        impl $signal {
            /// The unit and the meaning of the signal.
            pub fn label(&self) -> Label<'_> {
                let text = if self.description.is_empty() { &self.name } else { &self.description };
                Label { unit: self.unit.as_ref(), meaning: text }
            }
        }
    )*};
}

/// Returns the unit of an integral over time: `m` gives `m.s`, `m/s` gives `m`, `km/h` gives `s.km/h`.
///
/// `km/h.s` is no unit of FMI: after `/`, only a single unit or parentheses may follow. A unit with an offset, such as
/// degC, has no integral that FMI can write; the result is then no unit of FMI.
#[must_use]
pub fn integral_unit(unit: &str) -> String {
    match unit.strip_suffix("/s") {
        Some(unit) => unit.to_owned(),
        None if unit.contains('/') => format!("s.{unit}"),
        None => format!("{unit}.s"),
    }
}

signals! {
    /// A state or a reference.
    Signal {
        /// Value at the operating point.
        operating: Option<f64>,
    }

    /// A measurement, optionally with a range and a longest hold; see [`crate::sample::measurements`].
    Measurement {
        /// Value at the operating point.
        operating: Option<f64>,
        /// The smallest and the largest valid value; the last valid value replaces a value outside.
        range: Option<[f64; 2]>,
        /// The longest time in s for which the last valid value is used; afterwards the controller rests at its
        /// operating point.
        longest_hold: Option<f64>,
    }

    /// An actuator, optionally with limits.
    Actuator {
        /// Command at the operating point.
        operating: Option<f64>,
        /// The smallest and the largest command.
        limits: Option<[f64; 2]>,
    }

    /// A state of the fault model: a fault, or the rate of a fault.
    Fault {
        /// The actuator whose loss of effectiveness this fault is.
        loss_of: Option<String>,
        /// The command at which the estimate is half of the loss; see [`Loss::least_command`].
        least_command: Option<f64>,
    }
}

impl Measurement {
    /// The smallest and the largest valid value; without a range, the largest finite numbers of both signs.
    #[must_use]
    pub fn bounds(&self) -> [f64; 2] {
        self.range.unwrap_or([-f64::MAX, f64::MAX])
    }

    /// The most samples for which the last value may be used: the samples within the longest hold, up to rounding.
    /// `None` without a longest hold, or for `u32::MAX` samples or more.
    #[must_use]
    pub fn most_held(&self, sample_time: f64) -> Option<u32> {
        let samples = (self.longest_hold? * (1.0 + HOLD_ROUNDING) / sample_time).floor();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        (samples < f64::from(u32::MAX)).then_some(samples as u32)
    }
}

/// The relative tolerance of the longest hold, for the rounding errors of an importer that adds up its steps.
pub const HOLD_ROUNDING: f64 = 1e-9;

impl Actuator {
    /// The limits as deviations from the operating point; `None` without limits.
    #[must_use]
    pub fn range(&self) -> Option<[f64; 2]> {
        let [low, high] = self.limits?;
        let operating = self.operating.unwrap_or(0.0);
        Some([low - operating, high - operating])
    }
}

#[cfg(test)]
mod tests {
    use super::Measurement;

    #[test]
    fn the_most_samples_of_a_hold_are_those_within_its_time() {
        let of = |longest_hold, sample_time| {
            let (name, unit, description) = (String::new(), None, String::new());
            let (operating, range) = (None, None);
            let measurement =
                Measurement { name, unit, description, operating, range, longest_hold };
            measurement.most_held(sample_time)
        };
        // 0.3 / 0.1 is below 3.
        for (longest, period, expected) in
            [(0.3, 0.1, 3), (0.29, 0.1, 2), (0.05, 0.1, 0), (1.0, 1e-3, 1000)]
        {
            assert_eq!(of(Some(longest), period), Some(expected), "{longest} {period}");
        }
        assert_eq!([of(None, 0.1), of(Some(1e9), 0.1), of(Some(f64::INFINITY), 0.1)], [None; 3]);
    }
}
