//! Signals: functions of time for inputs without a connection.

mod track;

pub use track::{Interpolation, Track, TrackError};

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// Relative difference below which two times are equal; as in FMPy (Python's `math.isclose`).
const SAME: f64 = 1e-9;
/// Largest difference in s of equal times: [`SAME`] alone would allow more than 1 s for times in seconds since 1970.
const MOST: f64 = 1e-6;

/// Returns the largest difference in s of a time that is equal to `time` up to rounding.
pub(crate) fn rounding(time: f64) -> f64 {
    let size = time.abs();
    (SAME * size).min(MOST).max(4.0 * f64::EPSILON * size)
}

/// Whether two times are equal up to rounding.
pub(crate) fn near(one: f64, other: f64) -> bool {
    let difference = (one - other).abs();
    let rounding = rounding(one.abs().max(other.abs()));
    difference == 0.0 || difference.is_finite() && difference <= rounding
}

/// Whether `time` is at or after `moment`, both in s. Two times are equal if they differ by at most a relative 1e-9 and
/// at most 1 us, or by a few units in the last place.
#[must_use]
pub fn reached(time: f64, moment: f64) -> bool {
    time >= moment || near(time, moment)
}

/// Returns the earliest of `moments` that is after `after`.
pub(crate) fn earliest(after: f64, moments: impl IntoIterator<Item = f64>) -> Option<f64> {
    moments.into_iter().filter(|&moment| !reached(after, moment)).reduce(f64::min)
}

/// Value and right-hand derivative of a signal at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The value.
    pub value: f64,
    /// Right-hand derivative with respect to time, in 1/s.
    pub slope: f64,
}

impl Sample {
    /// Returns a constant sample: slope 0.
    #[must_use]
    pub fn held(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }
}

/// The position of the last look-up in a [`Track`]. The position makes a nearby look-up fast and changes no result;
/// time may go back.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor(usize);

/// A function of time. The value at a jump is the value after the jump.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Signal {
    /// A constant.
    Constant(f64),
    /// A ramp: `begin` up to the time `from`, `end` from the time `until` on, linear in between.
    Ramp {
        /// Start time in s.
        from: f64,
        /// End time in s, after `from`.
        until: f64,
        /// Value up to `from`.
        begin: f64,
        /// Value from `until` on.
        end: f64,
    },
    /// A sine: `offset` before the time `from`, then `offset + amplitude sin(2 pi frequency (t -
    /// from) + phase)`.
    Sine {
        /// Amplitude.
        amplitude: f64,
        /// Frequency in Hz.
        frequency: f64,
        /// Phase in rad.
        phase: f64,
        /// Mean.
        offset: f64,
        /// Start time of the sine in s.
        from: f64,
    },
    /// A sampled signal.
    Track(Track),
}

impl Signal {
    /// Returns the value at `time`, in s.
    #[must_use]
    pub fn value(&self, time: f64) -> f64 {
        self.at(time, &mut Cursor::default()).value
    }

    /// Returns the right-hand derivative at `time`, in s.
    #[must_use]
    pub fn slope(&self, time: f64) -> f64 {
        self.at(time, &mut Cursor::default()).slope
    }

    /// Returns value and derivative at `time`, in s. With the `cursor` of the last call, a time
    /// near the last one needs no search.
    pub fn at(&self, time: f64, cursor: &mut Cursor) -> Sample {
        match self {
            Signal::Constant(value) => Sample::held(*value),
            Signal::Ramp { from, until, begin, end } => {
                let part = ((time - from) / (until - from)).clamp(0.0, 1.0);
                let moves = reached(time, *from) && !reached(time, *until);
                let slope = if moves { (end - begin) / (until - from) } else { 0.0 };
                // Return `end` exactly at the end.
                let value = if part < 1.0 { begin + part * (end - begin) } else { *end };
                Sample { value, slope }
            }
            Signal::Sine { amplitude, frequency, phase, offset, from } => {
                if !reached(time, *from) {
                    return Sample::held(*offset);
                }
                let rate = TAU * frequency;
                let (sine, cosine) = libm::sincos(rate * (time - from) + phase);
                Sample { value: offset + amplitude * sine, slope: amplitude * rate * cosine }
            }
            Signal::Track(track) => track.at(time, &mut cursor.0),
        }
    }

    /// Returns the first time after `after`, both in s, at which the signal jumps, or has a kink at which a step should
    /// end. The points of a sampled signal count only where the signal jumps.
    #[must_use]
    pub fn next_break(&self, after: f64) -> Option<f64> {
        match self {
            Signal::Constant(_) => None,
            Signal::Ramp { from, until, .. } => earliest(after, [*from, *until]),
            Signal::Sine { from, .. } => earliest(after, [*from]),
            Signal::Track(track) => track.next_break(after),
        }
    }

    /// Returns the signal `scale s(t) + shift`; between the points of [`Interpolation::Points`] its value stays 0.
    #[must_use]
    pub fn scaled(self, scale: f64, shift: f64) -> Self {
        let absolute = |value: f64| scale * value + shift;
        match self {
            Signal::Constant(value) => Signal::Constant(absolute(value)),
            Signal::Ramp { from, until, begin, end } => {
                Signal::Ramp { from, until, begin: absolute(begin), end: absolute(end) }
            }
            Signal::Sine { amplitude, frequency, phase, offset, from } => {
                let (amplitude, offset) = (scale * amplitude, absolute(offset));
                Signal::Sine { amplitude, frequency, phase, offset, from }
            }
            Signal::Track(track) => Signal::Track(track.map(absolute)),
        }
    }
}

#[cfg(test)]
mod tests;
