//! The grid of communication points.

use std::fmt;

use crate::algorithm::Algorithm;
use crate::error::{SystemError, contradiction};
use crate::signal::reached;
use crate::system::System;
use fmu_description::number::seconds;
use slave::{Slave, time_rounding};

/// Remaining time of the run, as a fraction of the step, below which no further step is made; so is a remainder within
/// the rounding of the stop time.
const ROUNDING: f64 = 1e-6;

/// The grid of communication points `start + k step` of a run, and the time reached.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    start: f64,
    /// End of the run in s: the stop time or, before it, the end given by [`EarlyEnd`].
    pub(crate) stop: Option<f64>,
    step: f64,
    /// Number of grid points passed.
    pub(crate) count: u64,
    /// The last grid point passed and the next one, in s.
    points: (f64, f64),
    /// Time reached in s.
    pub(crate) time: f64,
}

/// The reason why a run ends before its stop time: an FMU takes equal steps only, and the stop time
/// is within one of its steps.
#[derive(Clone, Debug, PartialEq)]
pub struct EarlyEnd {
    /// Name of the FMU that takes equal steps only.
    pub slave: String,
    /// The step of the FMU in s.
    pub step: f64,
    /// The end of the run in s.
    pub end: f64,
    /// The stop time in s.
    pub stop: f64,
}

impl fmt::Display for EarlyEnd {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { slave, .. } = self;
        let [step, end, stop] = [self.step, self.end, self.stop].map(seconds);
        write!(
            formatter,
            "{slave} takes equal steps only (canHandleVariableCommunicationStepSize is false), and \
             the stop time {stop} s is no multiple of its step {step} s: the run ends with the last \
             whole step at t = {end} s"
        )
    }
}

/// Returns the size in s of a step from `start` to `end`. `start + size`, as an FMU computes it,
/// equals `end` if a floating-point number allows it, and is never greater: an FMU may refuse a
/// step that ends one ulp beyond its stop time.
#[inline]
pub(crate) fn size_between(start: f64, end: f64) -> f64 {
    let mut size = end - start;
    while start + size > end {
        size = size.next_down();
    }
    if start + size < end && start + size.next_up() <= end { size.next_up() } else { size }
}

/// Whether a slave takes equal steps only.
pub(crate) fn is_rigid(slave: &dyn Slave) -> bool {
    let flags = slave.description().co_simulation.as_ref();
    flags.is_some_and(|flags| !flags.can_handle_variable_communication_step_size)
}

/// Checks that start and stop time, in s, are finite, and that the stop time is the later one.
///
/// # Errors
///
/// Returns [`SystemError::Time`] otherwise.
pub fn check_stop_time(start: f64, stop: f64) -> Result<(), SystemError> {
    for (what, value) in [("the start time", start), ("the stop time", stop)] {
        if !value.is_finite() {
            return Err(SystemError::Time { what, value, rule: "a finite number".to_owned() });
        }
    }
    if stop > start {
        return Ok(());
    }
    let rule = format!("more than the start time, {start} s");
    Err(SystemError::Time { what: "the stop time", value: stop, rule })
}

impl Grid {
    /// Creates the grid from start to stop time with steps of `step` s. `multiples` are the
    /// communication steps in one step of each slave. Also returns the reason if the run ends
    /// early.
    pub(crate) fn new(
        system: &System,
        step: f64,
        multiples: &[u32],
        start: f64,
        stop: Option<f64>,
    ) -> Result<(Self, Option<EarlyEnd>), SystemError> {
        if !(step > 0.0 && step.is_finite()) {
            let (what, rule) =
                ("the communication step", "a finite number, more than 0".to_owned());
            return Err(SystemError::Time { what, value: step, rule });
        }
        // Without a stop time, the run may end at any time.
        check_stop_time(start, stop.unwrap_or(f64::MAX))?;
        let points = (start, start + step);
        let mut grid = Self { start, stop, step, count: 0, points, time: start };
        let early = stop.and_then(|stop| grid.last_whole_step(system, multiples, stop));
        if let Some(early) = &early {
            grid.stop = Some(early.end);
        }
        Ok((grid, early))
    }

    /// Returns the early end of the run if a slave that takes equal steps only cannot end at the stop
    /// time; `None`: the run ends at the stop time.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    fn last_whole_step(&self, system: &System, multiples: &[u32], stop: f64) -> Option<EarlyEnd> {
        let rigid = || {
            let all = system.slaves.iter().zip(multiples);
            all.filter(|((_, slave), _)| is_rigid(slave.as_ref()))
        };
        let steps = (stop - self.start) / self.step;
        let is_whole =
            (steps - steps.round()).abs() * self.step <= self.negligible(self.step, stop);
        let most = if is_whole { steps.round() } else { steps.floor() } as u64;
        // All slaves that take equal steps only meet at the common multiples of their steps.
        let together = rigid().fold(1, |all, (_, &multiple)| least_common(all, multiple.into()));
        let ends = |multiple: u64| is_whole && most.is_multiple_of(multiple);
        let ((name, _), &multiple) = rigid().find(|(_, multiple)| !ends((**multiple).into()))?;
        let whole = most - most % together;
        Some(EarlyEnd {
            slave: name.clone(),
            step: f64::from(multiple) * self.step,
            end: self.point(whole),
            stop,
        })
    }

    pub(crate) fn is_finished(&self) -> bool {
        self.stop.is_some_and(|stop| self.time >= stop)
    }

    /// Returns the length in s below which a rest of a step of `size` s up to `time` is no step of its own. It exceeds
    /// the rounding of grid points.
    #[inline]
    pub(crate) fn negligible(&self, size: f64, time: f64) -> f64 {
        (ROUNDING * size).max(time_rounding(self.start.abs().max(time.abs()), 0.0))
    }

    /// Returns `end`, or the stop time if this is earlier or so close that the rest of a step of `size` s would be
    /// rounding.
    fn limited(&self, end: f64, size: f64) -> f64 {
        match self.stop {
            Some(stop) if end > stop - self.negligible(size, stop) => stop,
            _ => end,
        }
    }

    /// Returns the end of a step of `size` s from the time reached, at most the stop time.
    pub(crate) fn end_of(&self, size: f64) -> f64 {
        self.limited(self.time + size, size)
    }

    /// Returns the grid point `t_start + number H`, in s; exactly 0 if the sum is 0 up to rounding, because comparisons
    /// of times treat no other number as equal to 0 s.
    #[inline]
    #[expect(clippy::cast_precision_loss, reason = "2^53 steps take longer than anyone waits")]
    fn point(&self, number: u64) -> f64 {
        let point = self.start + number as f64 * self.step;
        if point.abs() <= f64::EPSILON * self.start.abs() { 0.0 } else { point }
    }

    /// Returns the first grid point after `time`, in s; both may be beyond the stop time.
    pub(crate) fn point_after(&self, time: f64) -> f64 {
        let mut count = self.count + 1;
        loop {
            let point = self.point(count);
            if !reached(time, point) {
                return point;
            }
            count += 1;
        }
    }

    /// Returns end and size of the next step: H, or after an event the rest up to the next grid point,
    /// or the rest up to the stop time.
    #[inline]
    pub(crate) fn next(&self) -> (f64, f64) {
        let (start, end) = self.points;
        let on_grid = self.time.total_cmp(&start).is_eq();
        match self.stop {
            Some(stop) if end > stop - self.negligible(self.step, stop) => {
                let whole = on_grid && (self.time + self.step).total_cmp(&stop).is_eq();
                (stop, if whole { self.step } else { size_between(self.time, stop) })
            }
            _ if on_grid => (end, self.step),
            // After an event, step to the next grid point.
            _ => (end, size_between(self.time, end)),
        }
    }

    /// Returns the size of the step from `time` of a slave whose step covers `multiple`
    /// communication steps. The step ends at the next grid point whose number is a multiple, or at the
    /// stop time.
    pub(crate) fn size_of(&self, multiple: u32, time: f64) -> f64 {
        let multiple = u64::from(multiple);
        let number = (self.count / multiple + 1) * multiple;
        size_between(time, self.limited(self.point(number), self.step))
    }

    /// Records the completion of a step to `end`, on the grid or not.
    #[inline]
    pub(crate) fn reach(&mut self, end: f64) {
        if end >= self.limited(self.points.1, self.step) {
            self.set_count(self.count + 1);
        }
        self.time = end;
    }

    fn set_count(&mut self, count: u64) {
        (self.count, self.points) = (count, (self.point(count), self.point(count + 1)));
    }

    /// Resumes at `time` after `count` grid points. The end of the first run may have been counted as a grid point
    /// without being on the grid.
    pub(crate) fn resume(&mut self, time: f64, count: u64) {
        self.set_count(count);
        if count > 0 && self.points.0 > time + self.negligible(self.step, time) {
            self.set_count(count - 1);
        }
        self.time = time;
    }
}

/// Returns the least common multiple of two positive numbers, saturating.
fn least_common(a: u64, b: u64) -> u64 {
    let (mut divisor, mut rest) = (a, b);
    while rest != 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    (a / divisor).saturating_mul(b)
}

/// Returns the number of communication steps in one step of each slave; an error if one is 0 or if the
/// algorithm does not state one for each slave.
pub(crate) fn multiples(system: &System, algorithm: &Algorithm) -> Result<Vec<u32>, SystemError> {
    let count = system.slaves.len();
    if algorithm.multiples.is_empty() {
        return Ok(vec![1; count]);
    }
    match algorithm.multiples.iter().position(|&multiple| multiple == 0) {
        _ if algorithm.multiples.len() != count => Err(contradiction(format!(
            "the multiples of the step are {}, expected one for each of {count} FMUs",
            algorithm.multiples.len()
        ))),
        Some(slave) => Err(contradiction(format!(
            "{} steps every 0 communication steps, expected 1 or more",
            system.slaves[slave].0
        ))),
        None => Ok(algorithm.multiples.clone()),
    }
}

#[cfg(test)]
mod tests;
