//! Points in time with what is between them, by the conventions of FMPy 0.3 (`fmpy.simulation.Input`).

use std::sync::Arc;

use super::{Sample, near, reached};

/// Largest size of a time in s.
const LARGEST_TIME: f64 = 1e300;

/// What a [`Track`] does between two points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// A line.
    Line,
    /// The value of the point before.
    Hold,
}

/// Values at points in time.
///
/// * Up to the first time, and at it, the value is the first one; after the last time the last one.
/// * Between lines, with `v_i` at `t_i`, the value is `w v_i + (1 - w) v_(i+1)` with
///   `w = (t_(i+1) - t) / (t_(i+1) - t_i)`.
/// * Where a time stands more than once, the signal jumps: the value there is the last of them.
/// * Held values begin at their time.
/// * Times whose relative difference is at most 1e-9 are the same.
///
/// The values are those of FMPy to the last bit. The derivatives at a point differ: FMPy gives those
/// of the line before it, here they are those of the line that begins there.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    times: Arc<[f64]>,
    values: Arc<[f64]>,
    between: Between,
    /// Where it jumps, ascending.
    breaks: Arc<[f64]>,
}

/// Why points make no [`Track`]. Points count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// None.
    #[error("there are no points, expected at least one")]
    Empty,
    /// A time or a value that is not finite, or a time beyond all measure.
    #[error("point {point}: the {what} is {found}, expected a finite number")]
    Number {
        /// The point.
        point: usize,
        /// Time or value.
        what: &'static str,
        /// What it is.
        found: f64,
    },
    /// A time before the one before it.
    #[error("point {point}: the time {found} s comes after {before} s, expected ascending times")]
    Order {
        /// The point.
        point: usize,
        /// The time before.
        before: f64,
        /// The time.
        found: f64,
    },
    /// Times and values that are not of the same number.
    #[error("there are {values} values, expected {times}, one for each time")]
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of values.
        values: usize,
    },
}

impl Track {
    /// The track through `values` at `times`, in s.
    ///
    /// # Errors
    ///
    /// [`TrackError`] where there are no points, or they are not finite, or times go back.
    pub fn new(
        times: Arc<[f64]>,
        values: Arc<[f64]>,
        between: Between,
    ) -> Result<Self, TrackError> {
        check(&times, &values)?;
        let jumps = |point: &usize| match between {
            Between::Line => near(times[point - 1], times[*point]),
            Between::Hold => values[*point] - values[point - 1] != 0.0,
        };
        let breaks = (1..times.len()).filter(jumps).map(|point| times[point]).collect();
        Ok(Self { times, values, between, breaks })
    }

    /// The first time past `after`, in s, at which it jumps.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        let first = self.breaks.partition_point(|&moment| moment <= after);
        self.breaks[first..].iter().copied().find(|&moment| !reached(after, moment))
    }

    /// The track with `change` applied to each value.
    pub(crate) fn map(self, change: impl Fn(f64) -> f64) -> Self {
        Self { values: self.values.iter().map(|&value| change(value)).collect(), ..self }
    }

    /// Value and right-hand slope at `time`; `cursor` is where the last look-up ended.
    pub(crate) fn at(&self, time: f64, cursor: &mut usize) -> Sample {
        let (times, values) = (&*self.times, &*self.values);
        let last = times.len() - 1;
        let right = self.not_below(time, *cursor);
        *cursor = right;
        if last == 0 {
            return Sample::held(values[0]);
        }
        if right > last {
            return Sample::held(values[last]);
        }
        match self.between {
            Between::Hold if right == 0 => Sample::held(values[0]),
            Between::Hold => {
                let mut point = right - 1;
                while point < last && reached(time, times[point + 1]) {
                    point += 1;
                }
                Sample::held(values[point])
            }
            Between::Line => self.on_line(time, right),
        }
    }

    /// As [`Track::at`], for lines; `right` is the first point not before `time`.
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

    /// Slope of the line that begins at a point; 0 after the last one, or beyond the doubles.
    fn slope(&self, point: usize) -> f64 {
        if point + 1 >= self.times.len() {
            return 0.0;
        }
        let rise = self.values[point + 1] - self.values[point];
        let slope = rise / (self.times[point + 1] - self.times[point]);
        if slope.is_finite() { slope } else { 0.0 }
    }

    /// The first point whose time is not before `time`; their number where there is none.
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
            return Err(TrackError::Number { point, what: "time", found: time });
        }
        if !value.is_finite() {
            return Err(TrackError::Number { point, what: "value", found: value });
        }
        if time < before {
            return Err(TrackError::Order { point, before, found: time });
        }
        before = time;
    }
    Ok(())
}
