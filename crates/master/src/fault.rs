//! Faults on the way of a value to an input: what a failed sensor, wire or actuator makes of it.

mod delay;
mod draw;
mod stage;

pub use draw::{Draw, Spread};

use serde::{Deserialize, Serialize};

use slave::Value;

use crate::signal::{Sample, reached};
use stage::Stage;

/// The time during which a fault acts: `from <= t < until`, in s. A time is reached where it differs
/// by rounding only (1e-9, relative).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Its begin.
    pub from: f64,
    /// Its end; none: it lasts.
    pub until: Option<f64>,
}

impl Window {
    /// Whether the fault acts at `time`.
    #[must_use]
    pub fn contains(&self, time: f64) -> bool {
        reached(time, self.from) && !self.until.is_some_and(|until| reached(time, until))
    }
}

/// What becomes of the value `v` at the time `t` while the fault acts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fault {
    /// `v + b`.
    Bias(f64),
    /// `k v`.
    Gain(f64),
    /// `v + r (t - from)`, with `r` per second.
    Drift(f64),
    /// The value given, or else the one at the first communication point of its time.
    Stuck(Option<f64>),
    /// Values are lost.
    Dropout {
        /// Which ones.
        lost: Lost,
        /// What stands in for them; none: the last value that was not lost. Where all were lost so
        /// far, the first one.
        instead: Option<f64>,
    },
    /// The value of so many seconds ago: on the line between two communication points, or
    /// that of the last one. Before the first communication point, `initial`, or else the first
    /// value.
    Delay {
        /// The delay in s, above 0.
        seconds: f64,
        /// Whether the value of a communication point is held until the next one.
        hold: bool,
        /// Value before there is one.
        initial: Option<f64>,
    },
    /// `offset + step round((v - offset) / step)`, halves away from zero.
    Quantisation {
        /// Distance of two levels, above 0.
        step: f64,
        /// One of the levels.
        offset: f64,
    },
    /// `v` within these bounds.
    Saturation {
        /// Lowest value, or minus infinity.
        lowest: Option<f64>,
        /// Highest value, or infinity.
        highest: Option<f64>,
    },
    /// `v + e`, with random `e` of mean zero, each sample independent of the others.
    Noise {
        /// Distribution of `e`.
        spread: Spread,
        /// When there is a new one.
        draw: Draw,
    },
    /// `1 - v`: true becomes false.
    Inversion,
}

/// Which values a dropout takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Lost {
    /// All.
    All,
    /// Those in the first `part` s of each period.
    Periodic {
        /// The period in s, which begins with the window.
        period: f64,
        /// Below the period.
        part: f64,
    },
    /// Each with this probability, independently.
    Random {
        /// From 0 to 1.
        probability: f64,
        /// When it is decided anew.
        draw: Draw,
    },
}

/// Why there can be no [`FaultChain`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FaultError {
    /// A delay over too many communication steps.
    #[error(
        "a delay of {seconds} s is {steps:.0} communication steps of {step} s, expected at most {most}"
    )]
    Delay {
        /// The delay in s.
        seconds: f64,
        /// The communication step in s.
        step: f64,
        /// Their ratio.
        steps: f64,
        /// The largest ratio.
        most: f64,
    },
}

/// All faults on one way, each on what the one before it leaves.
///
/// [`FaultChain::apply`] is pure: a step may be repeated. What a fault remembers (the value at which
/// it sticks, the last value not lost, the values on their way) is what [`FaultChain::commit`] was
/// told at communication points. Neither allocates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultChain {
    stages: Vec<Stage>,
}

impl FaultChain {
    /// The faults in their order, for communication steps of `step` s. Steps may differ from that;
    /// a delay keeps no two points that are nearer than half of it.
    ///
    /// # Errors
    ///
    /// [`FaultError`] where a delay would need too much memory.
    pub fn new(faults: Vec<(Window, Fault)>, step: f64) -> Result<Self, FaultError> {
        let stages = faults
            .into_iter()
            .map(|(window, fault)| Stage::new(window, fault, step))
            .collect::<Result<_, _>>()?;
        Ok(Self { stages })
    }

    /// What arrives at `time`, in s, of `value`. `time` is not before that of the last commit.
    #[must_use]
    pub fn apply(&self, time: f64, value: f64) -> f64 {
        self.apply_sample(time, Sample::held(value)).value
    }

    /// As [`FaultChain::apply`], with the derivative by time of what arrives; for a value that
    /// changes in jumps it is zero.
    #[must_use]
    pub fn apply_sample(&self, time: f64, sample: Sample) -> Sample {
        let [value, slope, _] = self.apply_derivatives(time, [sample.value, sample.slope, 0.0]);
        Sample { value, slope }
    }

    /// As [`FaultChain::apply_sample`], with the second derivative too: value, slope, curvature.
    #[must_use]
    pub fn apply_derivatives(&self, time: f64, course: [f64; 3]) -> [f64; 3] {
        self.stages.iter().fold(course, |course, stage| stage.apply(time, course))
    }

    /// As [`FaultChain::apply`], for Integers, rounded and within their range.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub fn apply_integer(&self, time: f64, value: i32) -> i32 {
        self.apply(time, f64::from(value)).round() as i32
    }

    /// As [`FaultChain::apply`], for Booleans: 0 is false, as in the C interface.
    #[must_use]
    pub fn apply_boolean(&self, time: f64, value: i32) -> i32 {
        i32::from(self.apply(time, f64::from(i32::from(value != 0))) != 0.0)
    }

    /// Changes a value of any type as it is at `time` in s; a String stays.
    pub(crate) fn disturb(&self, time: f64, value: &mut Value) {
        match value {
            Value::Real(value) => *value = self.apply(time, *value),
            Value::Integer(value) => *value = self.apply_integer(time, *value),
            Value::Boolean(value) => {
                *value = self.apply_boolean(time, i32::from(*value)) != 0;
            }
            Value::String(_) => {}
        }
    }

    /// Takes note of the undisturbed `value` at the communication point `time`, in s, that the
    /// simulation has reached for good, the start included.
    pub fn commit(&mut self, time: f64, value: f64) {
        let mut course = [value, 0.0, 0.0];
        let count = self.stages.len();
        for (position, stage) in self.stages.iter_mut().enumerate() {
            stage.commit(time, course[0]);
            if position + 1 < count {
                course = stage.apply(time, course);
            }
        }
    }

    /// The first time past `after`, both in s, at which a fault begins or ends, or a periodic
    /// dropout does.
    #[must_use]
    pub fn next_break(&self, after: f64) -> Option<f64> {
        self.stages.iter().filter_map(|stage| stage.next_break(after)).reduce(f64::min)
    }

    /// How many faults there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stages.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stages.is_empty()
    }
}

#[cfg(test)]
mod tests;
