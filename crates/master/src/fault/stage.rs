//! A single fault with its window and its memory.

use serde::{Deserialize, Serialize};

use super::delay::DelayLine;
use super::draw::period_of;
use super::{Fault, FaultError, LossPattern, Window};
use crate::signal::{Sample, earliest, reached};

/// One element of a [`super::FaultChain`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Stage {
    window: Window,
    fault: Fault,
    /// The value of a stuck fault, or the last value that a dropout has not lost (the first value if all were lost).
    #[serde(rename = "kept")]
    last: Option<f64>,
    /// The memory of a delay.
    line: Option<DelayLine>,
}

impl Stage {
    pub(super) fn new(window: Window, fault: Fault, step: f64) -> Result<Self, FaultError> {
        let line = match fault {
            Fault::Delay { seconds, .. } => Some(DelayLine::new(seconds, step)?),
            _ => None,
        };
        Ok(Self { window, fault, last: None, line })
    }

    /// Whether `self` and `other` are the same fault in the same window; their memories may differ.
    pub(super) fn is_same_fault(&self, other: &Self) -> bool {
        self.window == other.window && self.fault == other.fault
    }

    /// Whether the fault has started by `time` in s. A delay starts earlier by its length, to record values.
    pub(super) fn has_begun(&self, time: f64) -> bool {
        let past = if let Fault::Delay { seconds, .. } = self.fault { seconds } else { 0.0 };
        reached(time, self.window.from - past)
    }

    /// Forgets all values.
    pub(super) fn forget(&mut self) {
        self.last = None;
        if let Some(line) = &mut self.line {
            line.clear();
        }
    }

    /// Applies the fault to a value with its first two derivatives with respect to time.
    pub(super) fn apply(&self, time: f64, derivatives: [f64; 3]) -> [f64; 3] {
        if !self.window.contains(time) {
            return derivatives;
        }
        let [value, slope, curvature] = derivatives;
        let held = |value: f64| [value, 0.0, 0.0];
        match &self.fault {
            Fault::Bias(bias) => [value + bias, slope, curvature],
            Fault::Gain(factor) => derivatives.map(|derivative| factor * derivative),
            Fault::Drift(rate) => {
                let since = (time - self.window.from).max(0.0);
                [value + rate * since, slope + rate, curvature]
            }
            Fault::Stuck(stated) => held(stated.or(self.last).unwrap_or(value)),
            Fault::Dropout { lost, instead } if self.loses(lost, time) => {
                held(instead.or(self.last).unwrap_or(value))
            }
            Fault::Dropout { .. } => derivatives,
            Fault::Delay { hold, initial, .. } => self.line.as_ref().map_or(derivatives, |line| {
                let Sample { value, slope } = line.at(time, value, *hold, *initial);
                [value, slope, 0.0]
            }),
            Fault::Quantisation { step, offset } => {
                let level = offset + step * ((value - offset) / step).round();
                // If the step is too small for floating-point numbers, the value does not change.
                held(if level.is_finite() { level } else { value })
            }
            Fault::Saturation { lowest, highest } => {
                let below = lowest.filter(|&lowest| value < lowest);
                let beyond = below.or(highest.filter(|&highest| value > highest));
                beyond.map_or(derivatives, held)
            }
            Fault::Noise { spread, draw } => {
                [value + draw.noise(*spread, self.window.from, time), slope, curvature]
            }
            Fault::Inversion => [1.0 - value, -slope, -curvature],
        }
    }

    /// Records the value that reaches this fault at a communication point.
    pub(super) fn commit(&mut self, time: f64, value: f64) {
        match &self.fault {
            Fault::Stuck(None) if self.last.is_none() && self.window.contains(time) => {
                self.last = Some(value);
            }
            Fault::Dropout { lost, instead: None }
                if self.last.is_none()
                    || !(self.window.contains(time) && self.loses(lost, time)) =>
            {
                self.last = Some(value);
            }
            Fault::Delay { .. } => {
                if let Some(line) = &mut self.line {
                    line.push(time, value);
                }
            }
            _ => {}
        }
    }

    fn loses(&self, lost: &LossPattern, time: f64) -> bool {
        match lost {
            LossPattern::All => true,
            LossPattern::Periodic { period, part } => {
                let start = self.window.from + period_of(self.window.from, *period, time) * period;
                !reached(time, start + part)
            }
            LossPattern::Random { probability, draw } => {
                draw.happens(*probability, self.window.from, time)
            }
        }
    }

    /// Returns the first time after `after` at which the window starts or ends, or within the window a
    /// lost part of a periodic dropout.
    pub(super) fn next_break(&self, after: f64) -> Option<f64> {
        let Window { from, until } = self.window;
        let window = earliest(after, until.into_iter().chain([from]));
        let Fault::Dropout { lost: LossPattern::Periodic { period, part }, .. } = &self.fault
        else {
            return window;
        };
        if !self.window.contains(after) {
            return window;
        }
        let start = from + period_of(from, *period, after) * period;
        let edges = earliest(after, [start + part, start + period]);
        window.into_iter().chain(edges).reduce(f64::min)
    }
}
