//! Steps of variable size: error estimate, rejection, repetition.

use super::Simulation;
use super::grid::size_between;
use super::sweep::SweepResult;
use crate::algorithm::StepControl;
use crate::error::SystemError;
use crate::exchange::Values;
use crate::signal::near;
use solve::Verdict;

/// Slot of the FMU states to which a rejected step returns.
const SLOT: usize = 1;
/// Relative distance below which a time may be a break; see [`near`].
const BREAK: f64 = 1e-8;

/// Values saved for the repetition of a step.
#[derive(Default)]
pub(super) struct Repetition {
    start: Values,
    whole: Vec<f64>,
}

impl Simulation {
    /// Makes a step from `time` towards `end` that all slaves complete and whose error is within
    /// the tolerance; returns the time reached.
    pub(super) fn controlled_step(
        &mut self,
        repetition: &mut Repetition,
        time: f64,
        mut end: f64,
    ) -> Result<(f64, SweepResult), SystemError> {
        self.save_states(SLOT, time)?;
        self.exchange.save(&mut repetition.start);
        loop {
            let size = size_between(time, end);
            let (error, swept) = match self.control.kind {
                StepControl::Doubling => self.step_by_halves(repetition, time, size)?,
                _ => self.step_and_estimate(time, size)?,
            };
            if let Some((slave, reached)) = swept.terminated {
                self.restore_states(SLOT, time)?;
                self.exchange.restore(&repetition.start);
                if reached > time {
                    self.attempt(time, size_between(time, reached), false)?;
                }
                return Ok((
                    reached,
                    SweepResult { terminated: Some((slave, reached)), reached: None },
                ));
            }
            // A partial step has no error estimate.
            end = if let Some(reached) = swept.reached {
                reached
            } else {
                match self.control.judge(size, error) {
                    // With rounded times, the retry may be as long as the last attempt.
                    Verdict::Rejected { retry } if time + retry < end => time + retry,
                    // After a break, values jump in a step of any size; accept the step.
                    Verdict::Rejected { .. } | Verdict::Stuck if self.is_break(time) => {
                        self.exchange.reals.clear_history();
                        self.control.clear_history();
                        return Ok((end, swept));
                    }
                    Verdict::Rejected { .. } | Verdict::Stuck => {
                        return Err(SystemError::Stuck { time, size, error });
                    }
                    Verdict::Accepted { .. } => {
                        self.control.update_size(&self.exchange.reals, size);
                        return Ok((end, swept));
                    }
                }
            };
            self.restore_states(SLOT, time)?;
            self.exchange.restore(&repetition.start);
        }
    }

    /// Whether a signal or a fault on a connection changes at `time`, in s.
    fn is_break(&self, time: f64) -> bool {
        let before = time - BREAK * time.abs();
        let breaks = [self.drives.next_break(before), self.exchange.next_break(before)];
        breaks.into_iter().flatten().any(|next| near(next, time))
    }

    /// Makes one whole step and then two halves, keeps the halves, and returns the error estimated
    /// from both.
    fn step_by_halves(
        &mut self,
        repetition: &mut Repetition,
        time: f64,
        size: f64,
    ) -> Result<(f64, SweepResult), SystemError> {
        let whole = self.attempt(time, size, false)?;
        if whole.reached.is_some() || whole.terminated.is_some() {
            return Ok((0.0, whole));
        }
        repetition.whole.clear();
        repetition.whole.extend_from_slice(self.exchange.reals.outputs());
        self.restore_states(SLOT, time)?;
        self.exchange.restore(&repetition.start);
        let middle = time + 0.5 * size;
        for (start, size) in [(time, middle - time), (middle, size_between(middle, time + size))] {
            let half = self.attempt(start, size, false)?;
            if half.reached.is_some() || half.terminated.is_some() {
                return Ok((0.0, half));
            }
        }
        let halves = self.exchange.reals.outputs();
        Ok((self.control.doubling_error(halves, &repetition.whole), SweepResult::default()))
    }

    /// Makes one step and returns the error estimated from the input extrapolation.
    fn step_and_estimate(
        &mut self,
        time: f64,
        size: f64,
    ) -> Result<(f64, SweepResult), SystemError> {
        let swept = self.attempt(time, size, false)?;
        if self.control.kind != StepControl::Embedded {
            return Ok((0.0, swept));
        }
        let error = self.control.extrapolation_error(&self.exchange.reals, size);
        Ok((error, swept))
    }

    /// Saves the states of all slaves (`fmi2GetFMUstate`).
    pub(super) fn save_states(&mut self, slot: usize, time: f64) -> Result<(), SystemError> {
        for (name, slave) in &mut self.system.slaves {
            slave.save_state(slot).map_err(|source| crate::exchange::call(name, time, source))?;
        }
        Ok(())
    }

    /// Restores the states of all slaves (`fmi2SetFMUstate`).
    pub(super) fn restore_states(&mut self, slot: usize, time: f64) -> Result<(), SystemError> {
        for (name, slave) in &mut self.system.slaves {
            slave
                .restore_state(slot)
                .map_err(|source| crate::exchange::call(name, time, source))?;
        }
        Ok(())
    }
}
