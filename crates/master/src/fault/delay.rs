//! The values that a delay has on their way.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::FaultError;
use crate::signal::{Sample, reached};

/// Largest ratio of a delay to the communication step.
const MOST_STEPS: f64 = 250_000.0;

/// The undisturbed values at communication points, as far back as the delay reaches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub(super) struct Line {
    seconds: f64,
    /// Any three points in a row are at least so many s long.
    spacing: f64,
    /// Most points.
    room: usize,
    /// Time and value, the oldest first.
    points: VecDeque<(f64, f64)>,
}

/// A [`Line`] in a checkpoint.
#[derive(Clone, Serialize, Deserialize)]
struct Stored {
    seconds: f64,
    step: f64,
    points: Vec<(f64, f64)>,
}

impl From<Line> for Stored {
    fn from(line: Line) -> Self {
        let Line { seconds, spacing, points, .. } = line;
        Self { seconds, step: 2.0 * spacing, points: points.into() }
    }
}

impl TryFrom<Stored> for Line {
    type Error = String;

    fn try_from(stored: Stored) -> Result<Self, String> {
        let mut line = Self::new(stored.seconds, stored.step).map_err(|error| error.to_string())?;
        if stored.points.len() > line.room {
            let (found, room) = (stored.points.len(), line.room);
            return Err(format!("a delay has {found} points, expected at most {room}"));
        }
        line.points.extend(stored.points);
        Ok(line)
    }
}

impl Line {
    /// A line of `seconds`, for points about `step` s apart.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    pub(super) fn new(seconds: f64, step: f64) -> Result<Self, FaultError> {
        let steps = seconds / step;
        if !(0.0..=MOST_STEPS).contains(&steps) {
            return Err(FaultError::Delay { seconds, step, steps, most: MOST_STEPS });
        }
        // Two points to each half step, the one before the oldest wanted and those at the ends.
        let room = (4.0 * steps).ceil() as usize + 8;
        let points = VecDeque::with_capacity(room);
        Ok(Self { seconds, spacing: 0.5 * step, room, points })
    }

    /// Takes a point in and forgets those that are not wanted any more.
    pub(super) fn push(&mut self, time: f64, value: f64) {
        let count = self.points.len();
        let repeated = self.points.back().is_some_and(|&(last, _)| last >= time);
        let near = count >= 2 && time - self.points[count - 2].0 < self.spacing;
        if repeated || near {
            self.points.pop_back();
        }
        let wanted = time - self.seconds;
        while self.points.len() >= 2 && reached(wanted, self.points[1].0)
            || self.points.len() >= self.room
        {
            self.points.pop_front();
        }
        self.points.push_back((time, value));
    }

    /// The value of `seconds` before `time`, at which the value is `value`.
    pub(super) fn at(&self, time: f64, value: f64, hold: bool, initial: Option<f64>) -> Sample {
        let wanted = time - self.seconds;
        let Some(&(first, first_value)) = self.points.front() else {
            return Sample::held(initial.unwrap_or(value));
        };
        if !reached(wanted, first) {
            return Sample::held(initial.unwrap_or(first_value));
        }
        let next = self.points.partition_point(|&(moment, _)| reached(wanted, moment));
        let (from, begin) = self.points[next.max(1) - 1];
        if hold {
            return Sample::held(begin);
        }
        // Past the last communication point it is the line to now.
        let (until, end) = self.points.get(next).copied().unwrap_or((time, value));
        if until <= from {
            return Sample::held(begin);
        }
        let slope = (end - begin) / (until - from);
        Sample { value: begin + slope * (wanted - from), slope }
    }
}
