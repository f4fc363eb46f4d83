//! Sampled signals, with the conventions of FMPy 0.3 (`fmpy.simulation.Input`).

use std::sync::Arc;

use super::{Sample, near, reached};

/// Largest absolute value of a time in s.
const LARGEST_TIME: f64 = 1e300;

/// Interpolation between two points of a [`Track`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Interpolation {
    /// Linear interpolation.
    Line,
    /// The value of the earlier point is held.
    Hold,
    /// The value is 0 between the points; at each point with another value the signal jumps. For the ticks of a clock.
    Points,
}

/// A sampled signal: values at points in time, ascending.
///
/// * Up to the first time, the value is the first one, also if this time occurs more than once; after the last time,
///   the last one.
/// * Linear interpolation between `v_i` at `t_i` and the next point is `w v_i + (1 - w) v_(i+1)`
///   with `w = (t_(i+1) - t) / (t_(i+1) - t_i)`.
/// * If a later time occurs more than once, the signal jumps; its value there is the last one.
/// * A held value starts at its time.
/// * The ticks of a clock are points: the value between them is 0. Of several points at one time, one that is not 0
///   counts.
/// * Times with a relative difference of at most 1e-9 are equal, unless they differ by more than 1 us; FMPy has no such
///   limit.
///
/// The values equal FMPy's to the last bit. The derivatives at a point differ: FMPy returns the
/// slope of the line before the point, this crate the slope of the line after it.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    times: Arc<[f64]>,
    values: Arc<[f64]>,
    between: Interpolation,
    /// The times of the jumps, ascending.
    breaks: Arc<[f64]>,
}

/// Error of creating a [`Track`]. Points count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum TrackError {
    /// There are no points.
    #[error("there are no points, expected at least one")]
    Empty,
    /// A time or a value is not finite, or a time is too large.
    #[error("point {point}: the {what} is {actual}, expected a finite number")]
    Number {
        point: usize,
        /// "time" or "value".
        what: &'static str,
        actual: f64,
    },
    /// A time is less than the time before it.
    #[error("point {point}: the time {actual} s comes after {before} s, expected ascending times")]
    Order { point: usize, before: f64, actual: f64 },
    /// Times and values have different lengths.
    #[error("there are {values} values, expected {times}, one for each time")]
    Lengths { times: usize, values: usize },
}

impl Track {
    /// Creates the signal through `values` at `times`, in s.
    ///
    /// # Errors
    ///
    /// Returns [`TrackError`] if there are no points, if the numbers of times and values differ, if a
    /// number is not finite, if a time is above 1e300 in magnitude, or if a time is less than the one
    /// before it.
    pub fn new(
        times: Arc<[f64]>,
        values: Arc<[f64]>,
        between: Interpolation,
    ) -> Result<Self, TrackError> {
        check(&times, &values)?;
        let jumps = |point: &usize| match between {
            Interpolation::Line => *point > 0 && near(times[point - 1], times[*point]),
            Interpolation::Hold => *point > 0 && values[*point] - values[point - 1] != 0.0,
            Interpolation::Points => values[*point] != 0.0,
        };
        let breaks = (0..times.len()).filter(jumps).map(|point| times[point]).collect();
        Ok(Self { times, values, between, breaks })
    }

    /// Returns the first time after `after`, in s, at which the signal jumps.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        let first = self.breaks.partition_point(|&moment| moment <= after);
        self.breaks[first..].iter().copied().find(|&moment| !reached(after, moment))
    }

    /// Returns the signal with `change` applied to each value.
    pub(crate) fn map(self, change: impl Fn(f64) -> f64) -> Self {
        Self { values: self.values.iter().map(|&value| change(value)).collect(), ..self }
    }

    /// Returns value and right-hand slope at `time`; `cursor` holds the position of the last
    /// look-up.
    pub(crate) fn at(&self, time: f64, cursor: &mut usize) -> Sample {
        let (times, values) = (&*self.times, &*self.values);
        let last = times.len() - 1;
        let right = self.not_below(time, *cursor);
        *cursor = right;
        if self.between == Interpolation::Points {
            let is_here = |point: &usize| near(times[*point], time);
            let before = (0..right).rev().take_while(is_here);
            let mut here = before.chain((right..=last).take_while(is_here));
            let point = here.find(|&point| values[point] != 0.0);
            return Sample::held(point.map_or(0.0, |point| values[point]));
        }
        if last == 0 {
            return Sample::held(values[0]);
        }
        if right > last {
            return Sample::held(values[last]);
        }
        match self.between {
            Interpolation::Hold if right == 0 => Sample::held(values[0]),
            Interpolation::Hold => {
                let mut point = right - 1;
                while point < last && reached(time, times[point + 1]) {
                    point += 1;
                }
                Sample::held(values[point])
            }
            _ => self.on_line(time, right),
        }
    }

    /// As [`Track::at`], for linear interpolation; `right` is the first point not before `time`.
    fn on_line(&self, time: f64, right: usize) -> Sample {
        let (times, values) = (&*self.times, &*self.values);
        let last = times.len() - 1;
        let at_point = near(time, times[right]);
        let repeated = |point: usize| point < last && near(times[point], times[point + 1]);
        if right == 0 {
            let slope = if at_point && !repeated(0) { self.slope(0) } else { 0.0 };
            return Sample { value: values[0], slope };
        }
        if at_point && repeated(right) {
            let mut point = right;
            while repeated(point) {
                point += 1;
            }
            return Sample { value: values[point], slope: self.slope(point) };
        }
        let left = right - 1;
        let weight = (times[right] - time) / (times[right] - times[left]);
        let value = weight * values[left] + (1.0 - weight) * values[right];
        Sample { value, slope: self.slope(if at_point { right } else { left }) }
    }

    /// Returns the slope of the line that starts at a point; 0 after the last point, or if the
    /// slope overflows.
    fn slope(&self, point: usize) -> f64 {
        if point + 1 >= self.times.len() {
            return 0.0;
        }
        let rise = self.values[point + 1] - self.values[point];
        let slope = rise / (self.times[point + 1] - self.times[point]);
        if slope.is_finite() { slope } else { 0.0 }
    }

    /// Returns the first point whose time is not before `time`, or the number of points if there is
    /// none.
    fn not_below(&self, time: f64, hint: usize) -> usize {
        let times = &*self.times;
        let fits = |&point: &usize| {
            point <= times.len()
                && (point == 0 || times[point - 1] < time)
                && (point == times.len() || times[point] >= time)
        };
        [hint, hint + 1]
            .into_iter()
            .find(fits)
            .unwrap_or_else(|| times.partition_point(|&moment| moment < time))
    }
}

fn check(times: &[f64], values: &[f64]) -> Result<(), TrackError> {
    if times.len() != values.len() {
        return Err(TrackError::Lengths { times: times.len(), values: values.len() });
    }
    if times.is_empty() {
        return Err(TrackError::Empty);
    }
    let mut before = times[0];
    for (index, (&time, &value)) in times.iter().zip(values).enumerate() {
        let point = index + 1;
        if !time.is_finite() || time.abs() > LARGEST_TIME {
            return Err(TrackError::Number { point, what: "time", actual: time });
        }
        if !value.is_finite() {
            return Err(TrackError::Number { point, what: "value", actual: value });
        }
        if time < before {
            return Err(TrackError::Order { point, before, actual: time });
        }
        before = time;
    }
    Ok(())
}
