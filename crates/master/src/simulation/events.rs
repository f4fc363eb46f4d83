//! Steps that end where an FMU's output says so.

use super::Simulation;
use super::grid::size_between;
use super::sweep::Swept;
use crate::algorithm::EventSource;
use crate::error::SystemError;
use crate::exchange::{Values, call};
use crate::system::Port;
use slave::Value;
use solve::Bracket;

/// The slot of FMU states from which crossings are located.
const SLOT: usize = 2;
/// Part of a step within which a crossing is located.
const WIDTH: f64 = 1e-9;
/// Part of a step that is no step.
const ROUNDING: f64 = 1e-9;

/// What the location of events needs.
pub(super) struct Events {
    times: Vec<Port>,
    crossings: Vec<Port>,
    /// Values of the crossings at the begin of the step.
    before: Vec<f64>,
    begin: Values,
}

impl Events {
    /// None where the algorithm looks for no events.
    pub(super) fn new(sources: &[EventSource]) -> Option<Self> {
        let mut events = Self {
            times: Vec::new(),
            crossings: Vec::new(),
            before: Vec::new(),
            begin: Values::default(),
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

    /// The first time of an event that lies on the way to `end`; `end` itself where it is as near as
    /// rounding.
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

    /// Before a step in which crossings are looked for.
    pub(super) fn watch(&mut self, events: &mut Events, time: f64) -> Result<(), SystemError> {
        if events.crossings.is_empty() {
            return Ok(());
        }
        events.before.clear();
        for k in 0..events.crossings.len() {
            let value = self.read_real(events.crossings[k], time)?;
            events.before.push(value);
        }
        self.save_states(SLOT, time)?;
        self.exchange.save(&mut events.begin);
        Ok(())
    }

    /// After the step from `time` to `end`: makes it end at the first crossing on the way.
    pub(super) fn locate(
        &mut self,
        events: &mut Events,
        time: f64,
        end: f64,
    ) -> Result<Option<(f64, Swept)>, SystemError> {
        let mut found: Option<(f64, Swept)> = None;
        let (mut end, width) = (end, WIDTH * (end - time));
        for k in 0..events.crossings.len() {
            let (port, before) = (events.crossings[k], events.before[k]);
            let after = self.read_real(port, end)?;
            let Some(mut bracket) = Bracket::new((time, before), (end, after), width) else {
                continue;
            };
            while let Some(asked) = bracket.ask() {
                self.again(events, time, asked)?;
                let value = self.read_real(port, asked)?;
                bracket.tell(asked, value);
            }
            end = bracket.after();
            found = Some((end, self.again(events, time, end)?));
        }
        Ok(found)
    }

    /// The step from `time` once more, to another end.
    fn again(&mut self, events: &Events, time: f64, end: f64) -> Result<Swept, SystemError> {
        self.restore_states(SLOT, time)?;
        self.exchange.restore(&events.begin);
        self.attempt(time, size_between(time, end), false)
    }
}
