//! One fault with its time and what it remembers.

use serde::{Deserialize, Serialize};

use super::delay::Line;
use super::draw::period_of;
use super::{Fault, FaultError, Lost, Window};
use crate::signal::{Sample, earliest, reached};

/// A fault of a [`super::FaultChain`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Stage {
    window: Window,
    fault: Fault,
    /// The value at which it sticks, or the last one not lost.
    kept: Option<f64>,
    /// The values on their way, for a delay.
    line: Option<Line>,
}

impl Stage {
    pub(super) fn new(window: Window, fault: Fault, step: f64) -> Result<Self, FaultError> {
        let line = match fault {
            Fault::Delay { seconds, .. } => Some(Line::new(seconds, step)?),
            _ => None,
        };
        Ok(Self { window, fault, kept: None, line })
    }

    /// What it makes of a value with its two derivatives by time.
    pub(super) fn apply(&self, time: f64, course: [f64; 3]) -> [f64; 3] {
        if !self.window.contains(time) {
            return course;
        }
        let [value, slope, curvature] = course;
        let held = |value: f64| [value, 0.0, 0.0];
        match &self.fault {
            Fault::Bias(bias) => [value + bias, slope, curvature],
            Fault::Gain(factor) => course.map(|derivative| factor * derivative),
            Fault::Drift(rate) => {
                let since = (time - self.window.from).max(0.0);
                [value + rate * since, slope + rate, curvature]
            }
            Fault::Stuck(given) => held(given.or(self.kept).unwrap_or(value)),
            Fault::Dropout { lost, instead } if self.loses(lost, time) => {
                held(instead.or(self.kept).unwrap_or(value))
            }
            Fault::Dropout { .. } => course,
            Fault::Delay { hold, initial, .. } => self.line.as_ref().map_or(course, |line| {
                let Sample { value, slope } = line.at(time, value, *hold, *initial);
                [value, slope, 0.0]
            }),
            Fault::Quantisation { step, offset } => {
                let level = offset + step * ((value - offset) / step).round();
                // A step too small for a double leaves the value as it is.
                held(if level.is_finite() { level } else { value })
            }
            Fault::Saturation { lowest, highest } => {
                let below = lowest.filter(|&lowest| value < lowest);
                let beyond = below.or(highest.filter(|&highest| value > highest));
                beyond.map_or(course, held)
            }
            Fault::Noise { spread, draw } => {
                [value + draw.noise(*spread, self.window.from, time), slope, curvature]
            }
            Fault::Inversion => [1.0 - value, -slope, -curvature],
        }
    }

    /// Takes note of the value before it at a communication point.
    pub(super) fn commit(&mut self, time: f64, value: f64) {
        match &self.fault {
            Fault::Stuck(None) if self.kept.is_none() && self.window.contains(time) => {
                self.kept = Some(value);
            }
            Fault::Dropout { lost, instead: None }
                if self.kept.is_none()
                    || !(self.window.contains(time) && self.loses(lost, time)) =>
            {
                self.kept = Some(value);
            }
            Fault::Delay { .. } => {
                if let Some(line) = &mut self.line {
                    line.push(time, value);
                }
            }
            _ => {}
        }
    }

    fn loses(&self, lost: &Lost, time: f64) -> bool {
        match lost {
            Lost::All => true,
            Lost::Periodic { period, part } => {
                let begin = self.window.from + period_of(self.window.from, *period, time) * period;
                !reached(time, begin + part)
            }
            Lost::Random { probability, draw } => {
                draw.happens(*probability, self.window.from, time)
            }
        }
    }

    /// The first time past `after` at which it begins or ends to act.
    pub(super) fn next_break(&self, after: f64) -> Option<f64> {
        let Window { from, until } = self.window;
        let window = earliest(after, until.into_iter().chain([from]));
        let Fault::Dropout { lost: Lost::Periodic { period, part }, .. } = &self.fault else {
            return window;
        };
        if !self.window.contains(after) {
            return window;
        }
        let begin = from + period_of(from, *period, after) * period;
        let edges = earliest(after, [begin + part, begin + period]);
        window.into_iter().chain(edges).reduce(f64::min)
    }
}
