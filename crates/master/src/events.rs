//! Events: finds the time of an event and ends a step there.

use crate::algorithm::EventSource;
use crate::coupling::Coupler;
use crate::engine::{Engine, SavedState, Swept};
use crate::error::SystemError;
use crate::grid::size_between;
use crate::step_control::{PlannedStep, SizeControl, StepOutcome, step_to_ending};
use crate::system::Port;
use slave::time_rounding;
use solve::Bracket;

/// Slot of the FMU states from which a step is repeated to locate a crossing.
const SLOT: usize = 2;
/// Accuracy with which the time of a crossing is located, as a fraction of the step.
const WIDTH: f64 = 1e-9;
/// Distance from the start of the step, as a fraction of the step, below which an event counts as at the start.
const LEAST: f64 = 1e-9;

/// The event sources, and the state from which a crossing is located.
pub(crate) struct Events {
    times: Vec<Port>,
    crossings: Vec<Port>,
    /// Values of the crossing outputs at the start of the step.
    before: Vec<f64>,
    start: SavedState,
}

impl Events {
    /// Returns `None` if the algorithm has no event sources.
    pub(crate) fn new(sources: &[EventSource]) -> Option<Self> {
        let mut events = Self {
            times: Vec::new(),
            crossings: Vec::new(),
            before: Vec::new(),
            start: SavedState::new(SLOT),
        };
        for source in sources {
            match source {
                EventSource::NextTime(port) => events.times.push(*port),
                EventSource::Crossing(port) => events.crossings.push(*port),
            }
        }
        (!sources.is_empty()).then_some(events)
    }

    /// Makes the planned step, or a shorter step that ends at the first event within the planned one or where the step
    /// control ends it.
    pub(crate) fn step(
        &mut self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        control: &mut SizeControl,
        planned: PlannedStep,
    ) -> Result<StepOutcome, SystemError> {
        let time = engine.grid.time;
        let next = self.next_event(engine, time, planned.end)?;
        let limit = next.unwrap_or(planned.end);
        self.read_crossings(engine, time)?;
        let step = control.step(engine, coupler, PlannedStep::between(time, limit))?;
        if step.ending.is_some() {
            return Ok(step);
        }
        let crossing = self.locate(engine, coupler, time, step.end)?;
        let happened = crossing.is_some() || (next.is_some() && step.end >= limit);
        if happened {
            engine.exchange.reals.clear_history();
            control.clear_history();
        }
        Ok(crossing.unwrap_or(step))
    }

    /// Returns the time of the first announced event from `time` to `end`, or `end` itself if the event
    /// differs from it by rounding; `None` without such an event.
    fn next_event(
        &self,
        engine: &mut Engine,
        time: f64,
        end: f64,
    ) -> Result<Option<f64>, SystemError> {
        let (least, rounding) = (LEAST * (end - time), time_rounding(end, end - time));
        let mut first: Option<f64> = None;
        for &port in &self.times {
            let next = engine.system.read_real(port, time)?;
            if next > time + least && next <= end + rounding {
                let next = if next < end - rounding { next } else { end };
                first = Some(first.map_or(next, |first| first.min(next)));
            }
        }
        Ok(first)
    }

    /// Saves the state and reads the crossing outputs before a step, if there are any.
    fn read_crossings(&mut self, engine: &mut Engine, time: f64) -> Result<(), SystemError> {
        if self.crossings.is_empty() {
            return Ok(());
        }
        self.before.clear();
        for &port in &self.crossings {
            self.before.push(engine.system.read_real(port, time)?);
        }
        engine.save(time, &mut self.start)
    }

    /// Repeats the step from `time` to `end` up to the first zero crossing within it, or up to an earlier time at which
    /// slaves end a repeated step; returns this step. `None` without a crossing: the step remains as it is.
    fn locate(
        &self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        time: f64,
        mut end: f64,
    ) -> Result<Option<StepOutcome>, SystemError> {
        let (mut repeated, width) = (None, WIDTH * (end - time));
        for (&port, &before) in self.crossings.iter().zip(&self.before) {
            let bracket_to = |engine: &mut Engine, end: f64| {
                let after = engine.system.read_real(port, end);
                after.map(|after| Bracket::new((time, before), (end, after), width))
            };
            let mut bracket = bracket_to(engine, end)?;
            while let Some(search) = &mut bracket {
                let asked = search.ask();
                let target = asked.unwrap_or(search.after());
                let step = self.repeat(engine, coupler, time, target)?;
                end = step.end;
                if repeated.insert(step).ending.is_some() {
                    return Ok(repeated);
                }
                match asked {
                    // The crossing is before the early end, or in a later step.
                    _ if end < target => bracket = bracket_to(engine, end)?,
                    Some(asked) => search.tell(asked, engine.system.read_real(port, asked)?),
                    None => break,
                }
            }
        }
        Ok(repeated)
    }

    /// Repeats the step from `time` to `end`, or to an earlier time at which slaves end it.
    fn repeat(
        &self,
        engine: &mut Engine,
        coupler: &mut Coupler,
        time: f64,
        mut end: f64,
    ) -> Result<StepOutcome, SystemError> {
        loop {
            engine.restore(&self.start)?;
            match coupler.step(engine, time, size_between(time, end))? {
                Swept::Whole => return Ok(StepOutcome { end, ending: None }),
                Swept::Part(reached) => end = reached,
                Swept::Ended(ending) => {
                    return step_to_ending(engine, coupler, &self.start, time, ending);
                }
            }
        }
    }
}
