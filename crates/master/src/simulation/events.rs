//! Events: finds the time of an event and ends a step there.

use super::Simulation;
use super::grid::size_between;
use super::sweep::SweepResult;
use crate::algorithm::EventSource;
use crate::error::SystemError;
use crate::exchange::{Values, call};
use crate::system::Port;
use slave::Value;
use solve::Bracket;

/// Slot of the FMU states to which the location of a crossing returns.
const SLOT: usize = 2;
/// Relative width, as a part of a step, within which a crossing is located.
const WIDTH: f64 = 1e-9;
/// Part of a step below which a difference of times is rounding.
const ROUNDING: f64 = 1e-9;

/// The event sources and the values saved to locate a crossing.
pub(super) struct Events {
    times: Vec<Port>,
    crossings: Vec<Port>,
    /// Values of the crossing outputs at the start of the step.
    before: Vec<f64>,
    start: Values,
}

impl Events {
    /// Returns `None` if the algorithm has no event sources.
    pub(super) fn new(sources: &[EventSource]) -> Option<Self> {
        let mut events = Self {
            times: Vec::new(),
            crossings: Vec::new(),
            before: Vec::new(),
            start: Values::default(),
        };
        for source in sources {
            match source {
                EventSource::NextTime(port) => events.times.push(*port),
                EventSource::Crossing(port) => events.crossings.push(*port),
            }
        }
        (!sources.is_empty()).then_some(events)
    }
}

impl Simulation {
    fn read_real(&mut self, port: Port, time: f64) -> Result<f64, SystemError> {
        let value = self.system.get_value(port);
        let value =
            value.map_err(|source| call(&self.system.slaves[port.slave].0, time, source))?;
        Ok(if let Value::Real(value) = value { value } else { f64::NAN })
    }

    /// Returns the time of the first announced event before `end`, or `end` itself if the event
    /// differs from it by rounding.
    pub(super) fn next_event(
        &mut self,
        events: &Events,
        time: f64,
        end: f64,
    ) -> Result<Option<f64>, SystemError> {
        let rounding = ROUNDING * (end - time);
        let mut first: Option<f64> = None;
        for &port in &events.times {
            let next = self.read_real(port, time)?;
            if next > time + rounding && next <= end + rounding {
                let next = if next < end - rounding { next } else { end };
                first = Some(first.map_or(next, |first| first.min(next)));
            }
        }
        Ok(first)
    }

    /// Saves the state and reads the crossing outputs before a step.
    pub(super) fn read_crossings(
        &mut self,
        events: &mut Events,
        time: f64,
    ) -> Result<(), SystemError> {
        if events.crossings.is_empty() {
            return Ok(());
        }
        events.before.clear();
        for k in 0..events.crossings.len() {
            let value = self.read_real(events.crossings[k], time)?;
            events.before.push(value);
        }
        self.save_states(SLOT, time)?;
        self.exchange.save(&mut events.start);
        Ok(())
    }

    /// Ends the step from `time` to `end` at the first zero crossing within it, if there is one.
    pub(super) fn locate(
        &mut self,
        events: &mut Events,
        time: f64,
        end: f64,
    ) -> Result<Option<(f64, SweepResult)>, SystemError> {
        let mut found: Option<(f64, SweepResult)> = None;
        let (mut end, width) = (end, WIDTH * (end - time));
        for k in 0..events.crossings.len() {
            let (port, before) = (events.crossings[k], events.before[k]);
            let after = self.read_real(port, end)?;
            let Some(mut bracket) = Bracket::new((time, before), (end, after), width) else {
                continue;
            };
            while let Some(asked) = bracket.ask() {
                self.repeat_step(events, time, asked)?;
                let value = self.read_real(port, asked)?;
                bracket.tell(asked, value);
            }
            end = bracket.after();
            found = Some((end, self.repeat_step(events, time, end)?));
        }
        Ok(found)
    }

    /// Repeats the step from `time` with another end.
    fn repeat_step(
        &mut self,
        events: &Events,
        time: f64,
        end: f64,
    ) -> Result<SweepResult, SystemError> {
        self.restore_states(SLOT, time)?;
        self.exchange.restore(&events.start);
        self.attempt(time, size_between(time, end), false)
    }
}
