//! Slaves of a group that step at the same time: those in the background begin before the first
//! step is waited for. Whatever comes of the steps is taken in their order.

use std::ops::Range;

use super::Simulation;
use super::sweep::Swept;
use crate::error::SystemError;
use crate::system::System;

/// Whether any slave steps in the background.
pub(super) fn any_in_background(system: &mut System) -> bool {
    system.slaves.iter_mut().any(|(_, slave)| slave.in_background().is_some())
}

impl Simulation {
    /// One step of the slaves at `members` of the sequence.
    #[inline]
    pub(super) fn advance_members(
        &mut self,
        members: Range<usize>,
        time: f64,
        never_back: bool,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        if self.background {
            return self.advance_together(members, time, never_back, swept);
        }
        for position in members {
            self.advance(self.groups.sequence[position], time, never_back, swept)?;
        }
        Ok(())
    }

    /// As [`Simulation::advance_members`] where some may be in the background. The error is that of
    /// the first in order; steps begun behind it are not waited for here.
    fn advance_together(
        &mut self,
        members: Range<usize>,
        time: f64,
        never_back: bool,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let failed = self.begin_members(members.clone(), time, never_back);
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

    /// Begins the steps of those in the background, up to the first that fails: position and error.
    fn begin_members(
        &mut self,
        members: Range<usize>,
        time: f64,
        never_back: bool,
    ) -> Option<(usize, SystemError)> {
        for position in members {
            let slave = self.groups.sequence[position];
            let span = (time, self.sizes[slave]);
            if span.1 > 0.0 {
                let begun = self.exchange.begin(&mut self.system, slave, span, never_back);
                if let Err(error) = begun {
                    return Some((position, error));
                }
            }
        }
        None
    }
}
