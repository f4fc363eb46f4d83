//! Steps the slaves of a group at the same time: starts the background slaves before waiting for
//! the first result. Results are evaluated in the order of the slaves.

use std::ops::Range;

use super::Simulation;
use super::sweep::SweepResult;
use crate::error::SystemError;
use crate::system::System;

/// Whether any slave steps in the background.
pub(super) fn any_in_background(system: &mut System) -> bool {
    system.slaves.iter_mut().any(|(_, slave)| slave.in_background().is_some())
}

impl Simulation {
    /// Makes one step of the slaves at `members` of the sequence.
    #[inline]
    pub(super) fn advance_members(
        &mut self,
        members: Range<usize>,
        time: f64,
        never_back: bool,
        swept: &mut SweepResult,
    ) -> Result<(), SystemError> {
        if self.background {
            return self.advance_together(members, time, never_back, swept);
        }
        for position in members {
            self.advance(self.groups.sequence[position], time, never_back, swept)?;
        }
        Ok(())
    }

    /// As [`Simulation::advance_members`], with background slaves. Returns the first error in the
    /// order of the slaves; does not wait for steps started after it.
    fn advance_together(
        &mut self,
        members: Range<usize>,
        time: f64,
        never_back: bool,
        swept: &mut SweepResult,
    ) -> Result<(), SystemError> {
        let failed = self.start_members(members.clone(), time, never_back);
        for position in members {
            let slave = self.groups.sequence[position];
            if failed.as_ref().is_some_and(|(failed, _)| *failed == position) {
                break;
            }
            let size = self.sizes[slave];
            if size == 0.0 {
                continue;
            }
            let span = (time, size);
            let done = self.exchange.finish(&mut self.system, slave, span, never_back)?;
            self.finish(slave, time, done, never_back, swept)?;
        }
        failed.map_or(Ok(()), |(_, error)| Err(error))
    }

    /// Starts the steps of background slaves up to the first failure; returns its position and
    /// error.
    fn start_members(
        &mut self,
        members: Range<usize>,
        time: f64,
        never_back: bool,
    ) -> Option<(usize, SystemError)> {
        for position in members {
            let slave = self.groups.sequence[position];
            let span = (time, self.sizes[slave]);
            if span.1 > 0.0 {
                let started = self.exchange.start(&mut self.system, slave, span, never_back);
                if let Err(error) = started {
                    return Some((position, error));
                }
            }
        }
        None
    }
}
