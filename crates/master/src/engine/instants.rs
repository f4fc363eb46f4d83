//! Instants: the events of all slaves at one time, iterated until nothing changes.
//!
//! Time is superdense (E. A. Lee and H. Zheng, "Operational semantics of hybrid systems", HSCC 2005): at an event
//! time stands still while outputs, inputs and discrete states change. All outputs are read before any input is set,
//! so the order of the slaves does not matter.

use std::ops::ControlFlow;

use super::Ending;
use crate::drive::Drives;
use crate::error::SystemError;
use crate::exchange::Exchange;
use crate::system::System;
use slave::{CallError, Events, absent};

/// Largest number of updates of the discrete states in an instant, and of exchanges between two updates.
const MOST: usize = 1000;

/// The slaves whose events the master handles.
#[derive(Debug, Default)]
pub(crate) struct Instants {
    /// Positions of the slaves whose events the master handles, ascending.
    members: Vec<usize>,
    /// For each slave, the time in s of its next known event; infinite without a known event, and for a slave without
    /// connections.
    next: Vec<f64>,
    /// For each slave, the time in s of the event at which its last step ended; infinite if the step ended at no event.
    pub(crate) pending: Vec<f64>,
    /// For each slave, whether it has connections.
    connected: Vec<bool>,
    /// For each slave, whether it is in event mode.
    in_event: Vec<bool>,
    /// For each slave, whether its inputs have been set since it entered event mode or updated its discrete states.
    set: Vec<bool>,
    /// Values of the connected Reals before the instant.
    before: Vec<f64>,
}

/// How an instant ended.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct InstantEnd {
    /// The slave that requested the end of the simulation.
    pub(crate) ending: Option<Ending>,
    /// Whether a connected Real has jumped.
    pub(crate) jumped: bool,
}

/// The parts of an engine that take part in an instant.
pub(crate) struct Parts<'a> {
    pub(crate) system: &'a mut System,
    pub(crate) exchange: &'a mut Exchange,
    pub(crate) drives: &'a mut Drives,
}

impl Instants {
    /// Collects the slaves of `system` whose events the master handles; they are in event mode.
    pub(crate) fn new(system: &System) -> Self {
        let count = system.slaves.len();
        let mut connected = vec![false; count];
        for connection in &system.connections {
            (connected[connection.from.slave], connected[connection.to.slave]) = (true, true);
        }
        Self {
            members: (0..count).filter(|&slave| system.events[slave]).collect(),
            next: vec![f64::INFINITY; count],
            pending: vec![f64::INFINITY; count],
            connected,
            in_event: system.events.clone(),
            set: vec![false; count],
            before: Vec::new(),
        }
    }

    /// Whether the master handles the events of no slave.
    pub(crate) fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Whether a slave whose events the master handles has a connection.
    pub(crate) fn are_connected(&self) -> bool {
        self.members.iter().any(|&slave| self.connected[slave])
    }

    /// Returns the time of the first known event after `time`, both in s.
    #[inline]
    pub(crate) fn next_after(&self, time: f64) -> Option<f64> {
        self.next.iter().copied().filter(|next| *next > time).reduce(f64::min)
    }

    /// Whether an instant is due at `time`: a slave has an event, one of its driven variables has a break
    /// ([`Self::has_break`]), or one of its discrete inputs has a new value.
    pub(crate) fn is_due(&self, parts: &mut Parts<'_>, time: f64) -> bool {
        self.pending.iter().any(|pending| *pending <= time)
            || self.has_break(parts.drives, time)
            || self.members.iter().any(|&slave| {
                !parts.exchange.reals.is_ahead(slave, time)
                    && parts.exchange.gather_at_events(slave, time)
            })
    }

    /// Whether a driven variable of a slave in `members` has a break at `time`: its drive starts, or its signal or a
    /// fault on it jumps or has a kink.
    fn has_break(&self, drives: &Drives, time: f64) -> bool {
        !drives.is_empty()
            && drives
                .iter()
                .any(|drive| self.members.contains(&drive.port().slave) && drive.breaks_at(time))
    }

    /// Iterates the instant at `time`: slaves with a pending event or a break of a driven variable enter event mode;
    /// then values are exchanged and discrete states updated until nothing changes. If a slave requests the end of the
    /// simulation, returns at once, with slaves in event mode.
    pub(crate) fn iterate(
        &mut self,
        parts: &mut Parts<'_>,
        time: f64,
    ) -> Result<InstantEnd, SystemError> {
        self.before.clear();
        self.before.extend_from_slice(parts.exchange.reals.outputs());
        for slave in 0..self.pending.len() {
            if self.pending[slave] <= time {
                self.pending[slave] = f64::INFINITY;
                self.enter(parts.system, slave, time)?;
            }
        }
        self.drive(parts, time)?;
        let mut needs_update = self.in_event.contains(&true);
        for _ in 0..MOST {
            if !(self.exchange(parts, time)? || needs_update) {
                return self.leave(parts, time);
            }
            needs_update = match self.update(parts, time)? {
                ControlFlow::Break(ending) => {
                    return Ok(InstantEnd { ending: Some(ending), jumped: false });
                }
                ControlFlow::Continue(needs_update) => needs_update,
            };
        }
        Err(self.unsettled(parts, time))
    }

    fn enter(&mut self, system: &mut System, slave: usize, time: f64) -> Result<(), SystemError> {
        with_events(system, slave, time, |events| events.enter_event_mode())?;
        (self.in_event[slave], self.set[slave]) = (true, false);
        Ok(())
    }

    /// Enters event mode of slaves with a driven variable that starts, jumps or has a kink at `time`; sets the driven
    /// variables and clocks of all slaves in event mode.
    fn drive(&mut self, parts: &mut Parts<'_>, time: f64) -> Result<(), SystemError> {
        if parts.drives.is_empty() {
            return Ok(());
        }
        for position in 0..self.members.len() {
            let slave = self.members[position];
            let breaks =
                |drive: &crate::drive::Drive| drive.port().slave == slave && drive.breaks_at(time);
            if !self.in_event[slave] && parts.drives.iter().any(breaks) {
                self.enter(parts.system, slave, time)?;
            }
        }
        parts.drives.write_to(parts.system, time, |slave| self.in_event[slave])?;
        let mut in_event = (0..self.in_event.len()).filter(|&slave| self.in_event[slave]);
        in_event.try_for_each(|slave| parts.drives.tick(parts.system, slave, time))
    }

    /// Passes values and ticks until they do not change any more; returns whether a discrete value or a tick was
    /// passed.
    fn exchange(&mut self, parts: &mut Parts<'_>, time: f64) -> Result<bool, SystemError> {
        let mut any = false;
        // As many passes as there are slaves carry a continuous signal through all of them. An algebraic loop of
        // such signals is not iterated further: the coupling of the next step solves it.
        for pass in 0..MOST {
            for slave in 0..self.in_event.len() {
                if self.in_event[slave] {
                    parts.exchange.read_in_event(parts.system, slave, time)?;
                }
            }
            let (mut discrete, mut continuous) = (false, false);
            for position in 0..self.members.len() {
                let slave = self.members[position];
                if parts.exchange.reals.is_ahead(slave, time) {
                    continue;
                }
                let new = parts.exchange.gather_at_events(slave, time);
                if new {
                    discrete = true;
                    if !self.in_event[slave] {
                        self.enter(parts.system, slave, time)?;
                    }
                }
                if !self.in_event[slave] {
                    continue;
                }
                if new || !self.set[slave] {
                    parts.exchange.set_at_events(parts.system, slave, time)?;
                    self.set[slave] = true;
                }
                continuous |= parts.exchange.set_reals_in_event(parts.system, slave, time)?;
            }
            any |= discrete;
            if !(discrete || continuous && pass < self.in_event.len()) {
                return Ok(any);
            }
        }
        Err(self.unsettled(parts, time))
    }

    /// Updates the discrete states of the slaves in event mode. Returns whether a slave needs another update, or the
    /// slave that requests the end of the simulation.
    fn update(
        &mut self,
        parts: &mut Parts<'_>,
        time: f64,
    ) -> Result<ControlFlow<Ending, bool>, SystemError> {
        let mut again = false;
        for slave in 0..self.in_event.len() {
            if !self.in_event[slave] {
                continue;
            }
            parts.system.show_event(slave, time)?;
            let info =
                with_events(parts.system, slave, time, |events| events.update_discrete_states())?;
            if info.terminate_simulation {
                return Ok(ControlFlow::Break(Ending { slave, time }));
            }
            again |= info.discrete_states_need_update;
        }
        parts.exchange.end_ticks();
        self.set.fill(false);
        Ok(ControlFlow::Continue(again))
    }

    /// Leaves event mode, asks for the next events and reads the outputs.
    fn leave(&mut self, parts: &mut Parts<'_>, time: f64) -> Result<InstantEnd, SystemError> {
        for slave in 0..self.in_event.len() {
            if std::mem::take(&mut self.in_event[slave]) {
                with_events(parts.system, slave, time, |events| events.leave_event_mode())?;
                self.ask_next(parts.system, slave, time)?;
                parts.exchange.read(parts.system, slave, time)?;
            }
        }
        let jumped = parts.exchange.reals.forget_jumps(&self.before);
        Ok(InstantEnd { ending: None, jumped })
    }

    /// Asks a slave for the time of its next event.
    fn ask_next(
        &mut self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        let next = with_events(system, slave, time, |events| events.next_event())?;
        self.next[slave] = next.filter(|_| self.connected[slave]).unwrap_or(f64::INFINITY);
        Ok(())
    }

    /// Asks all slaves for the times of their next events, after their states between two steps have been restored.
    /// `pending` is, for each slave, the time in s of the event at which its last step ended.
    pub(crate) fn restore(
        &mut self,
        system: &mut System,
        pending: &[f64],
        time: f64,
    ) -> Result<(), SystemError> {
        self.pending.copy_from_slice(pending);
        // An instant that ended the run or failed has left slaves in event mode.
        self.in_event.fill(false);
        for position in 0..self.members.len() {
            self.ask_next(system, self.members[position], time)?;
        }
        Ok(())
    }

    /// Records that the step of `slave` has ended at an event. `time`, in s, is a little before this end, because the
    /// communication point may be earlier than the end by rounding.
    pub(crate) fn record_event(&mut self, slave: usize, time: f64) {
        self.pending[slave] = time;
    }

    /// Forgets the events of a step that is repeated.
    pub(crate) fn forget(&mut self) {
        self.pending.fill(f64::INFINITY);
    }

    /// Returns the error that names the variables that still change.
    #[cold]
    fn unsettled(&self, parts: &mut Parts<'_>, time: f64) -> SystemError {
        let in_event = self.members.iter().copied().filter(|&slave| self.in_event[slave]);
        for slave in in_event.clone() {
            if let Err(error) = parts.exchange.read_in_event(parts.system, slave, time) {
                return error;
            }
        }
        let mut names: Vec<String> = Vec::new();
        for &slave in &self.members {
            parts.exchange.gather_at_events(slave, time);
            names.extend(parts.exchange.unsettled(parts.system, slave));
        }
        if names.is_empty() {
            let states =
                |slave: usize| format!("the discrete states of {}", parts.system.slaves[slave].0);
            names.extend(in_event.map(states));
        }
        SystemError::Unsettled { time, iterations: MOST, names: names.join(", ") }
    }
}

/// Performs `action` with the events of a slave; an error names the slave and `time`, in s.
fn with_events<T>(
    system: &mut System,
    slave: usize,
    time: f64,
    action: impl FnOnce(&mut dyn Events) -> Result<T, CallError>,
) -> Result<T, SystemError> {
    system.perform(slave, time, |instance| {
        instance.events().ok_or_else(|| absent("fmi3EnterEventMode")).and_then(action)
    })
}

#[cfg(test)]
mod tests;
