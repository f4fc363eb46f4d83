//! The memory of a delay.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::FaultError;
use crate::signal::{Sample, reached};

/// Largest number of communication steps in a delay.
const MOST_STEPS: f64 = 250_000.0;

/// The undisturbed values at communication points, as far back as the delay reaches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredDelayLine", into = "StoredDelayLine")]
pub(super) struct DelayLine {
    seconds: f64,
    /// Any three consecutive points span at least this time in s.
    spacing: f64,
    /// Largest number of points.
    room: usize,
    /// Time and value of each point, oldest first.
    points: VecDeque<(f64, f64)>,
}

/// The serialised form of a [`DelayLine`] in a checkpoint.
#[derive(Clone, Serialize, Deserialize)]
struct StoredDelayLine {
    seconds: f64,
    step: f64,
    points: Vec<(f64, f64)>,
}

impl From<DelayLine> for StoredDelayLine {
    fn from(line: DelayLine) -> Self {
        let DelayLine { seconds, spacing, points, .. } = line;
        Self { seconds, step: 2.0 * spacing, points: points.into() }
    }
}

impl TryFrom<StoredDelayLine> for DelayLine {
    type Error = String;

    fn try_from(stored: StoredDelayLine) -> Result<Self, String> {
        let mut line = Self::new(stored.seconds, stored.step).map_err(|error| error.to_string())?;
        if stored.points.len() > line.room {
            let (count, room) = (stored.points.len(), line.room);
            return Err(format!("a delay has {count} points, expected at most {room}"));
        }
        line.points.extend(stored.points);
        Ok(line)
    }
}

impl DelayLine {
    /// Creates a delay line of `seconds` for points about `step` s apart; an error if `seconds` is less
    /// than 0 or more than [`MOST_STEPS`] steps.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    pub(super) fn new(seconds: f64, step: f64) -> Result<Self, FaultError> {
        let steps = seconds / step;
        if !(0.0..=MOST_STEPS).contains(&steps) {
            return Err(FaultError::Delay { seconds, step, steps, most: MOST_STEPS });
        }
        // Two points per half step, one before the oldest point in use, and the ends.
        let room = (4.0 * steps).ceil() as usize + 8;
        let points = VecDeque::with_capacity(room);
        Ok(Self { seconds, spacing: 0.5 * step, room, points })
    }

    /// Removes all points.
    pub(super) fn clear(&mut self) {
        self.points.clear();
    }

    /// Adds a point and removes the points that are no longer needed. Replaces the last point if this point is not
    /// earlier than `time`, or if the points would be too close.
    pub(super) fn push(&mut self, time: f64, value: f64) {
        let count = self.points.len();
        let repeated = self.points.back().is_some_and(|&(last, _)| last >= time);
        let near = count >= 2 && time - self.points[count - 2].0 < self.spacing;
        if repeated || near {
            self.points.pop_back();
        }
        let target = time - self.seconds;
        while self.points.len() >= 2 && reached(target, self.points[1].0)
            || self.points.len() >= self.room
        {
            self.points.pop_front();
        }
        self.points.push_back((time, value));
    }

    /// Returns the delayed sample at `time`, where the undisturbed value is `value`.
    pub(super) fn at(&self, time: f64, value: f64, hold: bool, initial: Option<f64>) -> Sample {
        let target = time - self.seconds;
        let Some(&(first, first_value)) = self.points.front() else {
            return Sample::held(initial.unwrap_or(value));
        };
        if !reached(target, first) {
            return Sample::held(initial.unwrap_or(first_value));
        }
        let next = self.points.partition_point(|&(moment, _)| reached(target, moment));
        let (from, start) = self.points[next.max(1) - 1];
        if hold {
            return Sample::held(start);
        }
        // After the last communication point, interpolate to the current value.
        let (until, end) = self.points.get(next).copied().unwrap_or((time, value));
        if until <= from {
            return Sample::held(start);
        }
        let slope = (end - start) / (until - from);
        Sample { value: start + slope * (target - from), slope }
    }
}
