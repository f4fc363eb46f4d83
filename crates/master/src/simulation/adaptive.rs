//! Steps whose size is chosen on the way.

use super::Simulation;
use super::grid::size_between;
use super::sweep::Swept;
use crate::algorithm::StepControl;
use crate::error::SystemError;
use crate::exchange::Values;
use crate::signal::near;
use solve::Verdict;

/// The slot of FMU states from which a rejected step is repeated.
const SLOT: usize = 1;
/// Part of a time by which an earlier one is another time; see [`near`].
const BREAK: f64 = 1e-8;

/// What the repetition of a step needs.
#[derive(Default)]
pub(super) struct Repetition {
    begin: Values,
    whole: Vec<f64>,
}

impl Simulation {
    /// A step from `time` to `end`, or not as far: no slave stops on the way, and where the step control
    /// looks at the error, it is within the tolerance.
    pub(super) fn controlled(
        &mut self,
        repetition: &mut Repetition,
        time: f64,
        mut end: f64,
    ) -> Result<(f64, Swept), SystemError> {
        self.save_states(SLOT, time)?;
        self.exchange.save(&mut repetition.begin);
        loop {
            let size = size_between(time, end);
            let (error, swept) = match self.control.kind {
                StepControl::Doubling => self.halved(repetition, time, size)?,
                _ => self.extrapolated(time, size)?,
            };
            if let Some((slave, reached)) = swept.terminated {
                self.restore_states(SLOT, time)?;
                self.exchange.restore(&repetition.begin);
                if reached > time {
                    self.attempt(time, size_between(time, reached), false)?;
                }
                return Ok((reached, Swept { terminated: Some((slave, reached)), reached: None }));
            }
            // A step in part has no error to judge.
            end = if let Some(reached) = swept.reached {
                reached
            } else {
                match self.control.judge(size, error) {
                    // Where times are rounded the smallest step may be no smaller than the last try.
                    Verdict::Rejected { retry } if time + retry < end => time + retry,
                    // Values that jump at a break do so in a step of any size.
                    Verdict::Rejected { .. } | Verdict::Stuck if self.is_break(time) => {
                        self.exchange.reals.forget();
                        self.control.forget();
                        return Ok((end, swept));
                    }
                    Verdict::Rejected { .. } | Verdict::Stuck => {
                        return Err(SystemError::Stuck { time, size, error });
                    }
                    Verdict::Accepted { .. } => {
                        self.control.look_back(&self.exchange.reals, size);
                        return Ok((end, swept));
                    }
                }
            };
            self.restore_states(SLOT, time)?;
            self.exchange.restore(&repetition.begin);
        }
    }

    /// Whether a signal or a fault on a connection changes at `time`, in s.
    fn is_break(&self, time: f64) -> bool {
        let before = time - BREAK * time.abs();
        let breaks = [self.drives.next_break(before), self.exchange.next_break(before)];
        breaks.into_iter().flatten().any(|next| near(next, time))
    }

    /// One whole step, then two halves, which stand: the error estimated from both.
    fn halved(
        &mut self,
        repetition: &mut Repetition,
        time: f64,
        size: f64,
    ) -> Result<(f64, Swept), SystemError> {
        let whole = self.attempt(time, size, false)?;
        if whole.reached.is_some() || whole.terminated.is_some() {
            return Ok((0.0, whole));
        }
        repetition.whole.clear();
        repetition.whole.extend_from_slice(self.exchange.reals.outputs());
        self.restore_states(SLOT, time)?;
        self.exchange.restore(&repetition.begin);
        let middle = time + 0.5 * size;
        for (begin, size) in [(time, middle - time), (middle, size_between(middle, time + size))] {
            let half = self.attempt(begin, size, false)?;
            if half.reached.is_some() || half.terminated.is_some() {
                return Ok((0.0, half));
            }
        }
        let halves = self.exchange.reals.outputs();
        Ok((self.control.doubling_error(halves, &repetition.whole), Swept::default()))
    }

    /// One step, its error estimated from that of the extrapolation.
    fn extrapolated(&mut self, time: f64, size: f64) -> Result<(f64, Swept), SystemError> {
        let swept = self.attempt(time, size, false)?;
        if self.control.kind != StepControl::Embedded {
            return Ok((0.0, swept));
        }
        let error = self.control.extrapolation_error(&self.exchange.reals, size);
        Ok((error, swept))
    }

    /// `fmi2GetFMUstate` of all slaves.
    pub(super) fn save_states(&mut self, slot: usize, time: f64) -> Result<(), SystemError> {
        for (name, slave) in &mut self.system.slaves {
            slave.save_state(slot).map_err(|source| crate::exchange::call(name, time, source))?;
        }
        Ok(())
    }

    /// `fmi2SetFMUstate` of all slaves.
    pub(super) fn restore_states(&mut self, slot: usize, time: f64) -> Result<(), SystemError> {
        for (name, slave) in &mut self.system.slaves {
            slave
                .restore_state(slot)
                .map_err(|source| crate::exchange::call(name, time, source))?;
        }
        Ok(())
    }
}
