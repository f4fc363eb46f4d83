//! Faults between an output (or signal) and an input: models of failed sensors, wires and
//! actuators.

mod delay;
mod draw;
mod stage;

pub use draw::{NoiseDistribution, RandomSeries};

use serde::{Deserialize, Serialize};

use slave::Value;

use crate::signal::{Sample, reached};
use stage::Stage;

/// The time interval in which a fault acts: `from <= t < until`, in s. Times are equal as in
/// [`crate::signal::reached`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Start time in s.
    pub from: f64,
    /// End time in s; `None` for a fault without end.
    pub until: Option<f64>,
}

impl Window {
    /// Whether the fault acts at `time`.
    #[must_use]
    pub fn contains(&self, time: f64) -> bool {
        reached(time, self.from) && !self.until.is_some_and(|until| reached(time, until))
    }
}

/// A kind of fault: the value that replaces `v` at the time `t` while the fault acts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Fault {
    /// `v + b`: the constant b is added.
    Bias(f64),
    /// `k v`: the value is multiplied by k.
    Gain(f64),
    /// `v + r (t - from)`, from the start `from` of the window, with `r` per second.
    Drift(f64),
    /// The given value, or the value at the first communication point of the window.
    Stuck(Option<f64>),
    /// Values are lost.
    Dropout {
        /// Which values are lost.
        lost: LossPattern,
        /// Replacement for a lost value. `None`: the last value that was not lost, or the first
        /// value if all values so far were lost.
        instead: Option<f64>,
    },
    /// The value from `seconds` ago: interpolated between two communication points, or held from
    /// the earlier one. Before the first communication point: `initial`, or the first value.
    Delay {
        /// The delay in s, above 0.
        seconds: f64,
        /// Whether the value of a communication point is held until the next one.
        hold: bool,
        /// Value before the first delayed value arrives.
        initial: Option<f64>,
    },
    /// `offset + step round((v - offset) / step)`, half-way cases away from zero.
    Quantisation {
        /// Distance of two levels, above 0.
        step: f64,
        /// A level; the other levels are whole multiples of `step` away.
        offset: f64,
    },
    /// `v`, limited to `lowest` and `highest`.
    Saturation {
        /// Lower bound; `None`: minus infinity.
        lowest: Option<f64>,
        /// Upper bound; `None`: infinity.
        highest: Option<f64>,
    },
    /// `v + e` with random `e` of mean zero; samples are independent.
    Noise {
        /// Distribution of `e`.
        spread: NoiseDistribution,
        /// The random series, which determines the sample times.
        draw: RandomSeries,
    },
    /// `1 - v`: true becomes false.
    Inversion,
}

/// Which values a dropout loses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum LossPattern {
    /// All values.
    All,
    /// The values in the first `part` s of each period.
    Periodic {
        /// The period in s; the first one starts with the window.
        period: f64,
        /// Length in s of the lost part, less than the period.
        part: f64,
    },
    /// Each sample with this probability, independently.
    Random {
        /// Probability from 0 to 1.
        probability: f64,
        /// The random series, which determines the sample times.
        draw: RandomSeries,
    },
}

/// Error of creating a [`FaultChain`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum FaultError {
    /// A delay spans too many communication steps.
    #[error(
        "a delay of {seconds} s is {steps:.0} communication steps of {step} s, expected at most {most}"
    )]
    Delay { seconds: f64, step: f64, steps: f64, most: f64 },
}

/// All faults on one connection, applied in order.
///
/// [`FaultChain::apply`] has no side effects, so that a step may be repeated. The memory of a fault
/// (the value at which it sticks, the last value not lost, the delayed values) changes only in
/// [`FaultChain::commit`], which receives the values at final communication points. Neither
/// function allocates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultChain {
    stages: Vec<Stage>,
    /// The smallest and the largest value of the input, for an Integer input of a system.
    range: Option<(i64, i64)>,
}

impl FaultChain {
    /// Creates a chain of `faults` for communication steps of about `step` s. Steps may have
    /// another size; a delay merges points that are closer than half of `step`.
    ///
    /// # Errors
    ///
    /// Returns [`FaultError`] if a delay is negative, or if it spans more than 250 000 steps of `step` s.
    pub fn new(faults: Vec<(Window, Fault)>, step: f64) -> Result<Self, FaultError> {
        let mut chain = Self::default();
        for (window, fault) in faults {
            chain.push(window, fault, step)?;
        }
        Ok(chain)
    }

    /// Adds a fault, which acts on the result of the others; `step` as for [`FaultChain::new`].
    ///
    /// # Errors
    ///
    /// Returns [`FaultError`] if the fault is a delay that is negative or spans more than 250 000 steps of `step` s.
    pub fn push(&mut self, window: Window, fault: Fault, step: f64) -> Result<(), FaultError> {
        self.stages.push(Stage::new(window, fault, step)?);
        Ok(())
    }

    /// Limits the results of [`FaultChain::apply_integer`] to the range of the input.
    pub(crate) fn limit_integers(&mut self, least: i64, largest: i64) {
        self.range = Some((least, largest));
    }

    /// Returns the disturbed value at `time`, in s. `time` is not before the last commit.
    #[must_use]
    pub fn apply(&self, time: f64, value: f64) -> f64 {
        self.apply_sample(time, Sample::held(value)).value
    }

    /// As [`FaultChain::apply`], with the derivative with respect to time; the derivative of a value
    /// that a fault holds is zero.
    #[must_use]
    pub fn apply_sample(&self, time: f64, sample: Sample) -> Sample {
        let [value, slope, _] = self.apply_derivatives(time, [sample.value, sample.slope, 0.0]);
        Sample { value, slope }
    }

    /// As [`FaultChain::apply_sample`], with the second derivative: value, slope, curvature.
    #[must_use]
    pub fn apply_derivatives(&self, time: f64, derivatives: [f64; 3]) -> [f64; 3] {
        self.stages.iter().fold(derivatives, |derivatives, stage| stage.apply(time, derivatives))
    }

    /// As [`FaultChain::apply`], for Integers; the result is rounded, and in a simulation limited to the range of the
    /// input. Without a simulation, the limits are the range of 32 bits for a `value` of 32 bits, otherwise the range
    /// of 64 bits.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub fn apply_integer(&self, time: f64, value: i64) -> i64 {
        let real = slave::to_real(value);
        let faulty = self.apply(time, real);
        if faulty.total_cmp(&real).is_eq() {
            return value;
        }
        let narrow = i32::try_from(value).is_ok();
        let range = if narrow { (i32::MIN.into(), i32::MAX.into()) } else { (i64::MIN, i64::MAX) };
        let (least, largest) = self.range.unwrap_or(range);
        (faulty.round() as i64).clamp(least, largest)
    }

    /// As [`FaultChain::apply`], for Booleans: 0 is false, as in the C interface.
    #[must_use]
    pub fn apply_boolean(&self, time: f64, value: i32) -> i32 {
        i32::from(self.apply(time, f64::from(i32::from(value != 0))) != 0.0)
    }

    /// Applies the faults to a value of any type at `time` in s; Strings and binaries do not change.
    pub(crate) fn disturb(&self, time: f64, value: &mut Value) {
        match value {
            Value::Real(value) => *value = self.apply(time, *value),
            Value::Integer(value) => *value = self.apply_integer(time, *value),
            Value::Boolean(value) => {
                *value = self.apply_boolean(time, i32::from(*value)) != 0;
            }
            Value::String(_) | Value::Binary(_) => {}
        }
    }

    /// Records the undisturbed `value` at the final communication point `time`, in s. Call it at
    /// the start time, too.
    pub fn commit(&mut self, time: f64, value: f64) {
        let mut derivatives = [value, 0.0, 0.0];
        let count = self.stages.len();
        for (position, stage) in self.stages.iter_mut().enumerate() {
            stage.commit(time, derivatives[0]);
            if position + 1 < count {
                derivatives = stage.apply(time, derivatives);
            }
        }
    }

    /// Returns the first time after `after`, both in s, at which a fault or a lost part of a
    /// periodic dropout starts or ends.
    #[must_use]
    pub fn next_break(&self, after: f64) -> Option<f64> {
        self.stages.iter().filter_map(|stage| stage.next_break(after)).reduce(f64::min)
    }

    /// Takes over the memory of the faults that are also in `saved`, the chain of the same input at `time` in s; others
    /// have no memory. Returns false, and changes nothing, if a fault of only one chain has begun by then.
    pub(crate) fn resume(&mut self, saved: &Self, time: f64) -> bool {
        let begun = |stages: &[Stage]| stages.iter().any(|stage| stage.has_begun(time));
        let (mut resumed, mut rest) = (self.stages.clone(), saved.stages.as_slice());
        for stage in &mut resumed {
            match rest.iter().position(|saved| saved.is_same_fault(stage)) {
                Some(position) if begun(&rest[..position]) => return false,
                Some(position) => {
                    stage.clone_from(&rest[position]);
                    rest = &rest[position + 1..];
                }
                None if stage.has_begun(time) => return false,
                None => stage.forget(),
            }
        }
        if begun(rest) {
            return false;
        }
        self.stages = resumed;
        true
    }

    /// Takes over the memory of the faults of `earlier`; returns false, and changes nothing, if the faults of `earlier`
    /// are not the first faults of this chain.
    pub(crate) fn inherit(&mut self, earlier: &Self) -> bool {
        let Some(first) = self.stages.get_mut(..earlier.stages.len()) else { return false };
        let same =
            first.iter().zip(&earlier.stages).all(|(stage, before)| stage.is_same_fault(before));
        if same {
            first.clone_from_slice(&earlier.stages);
        }
        same
    }

    /// Returns the number of faults.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stages.len()
    }

    /// Whether the chain is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stages.is_empty()
    }
}

#[cfg(test)]
mod tests;
