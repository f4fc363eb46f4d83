//! A communication step: integration from event to event.

use fmu_description::number::seconds;
use slave::{CallError, CompletedStep, Failure, StepResult};
use solve::Bracket;

use super::events::check_indicators;
use super::{Integrated, Mode, failed};

/// The most events in one communication step.
const EVENTS: u32 = 100_000;
/// Difference of times that counts as rounding, relative to the time and the step.
const ROUNDING: f64 = 1e-12;
/// Largest difference of times in s that counts as rounding. The states are not integrated over it.
const MOST: f64 = 1e-6;
/// Width to which a state event is located, relative to the step of the integrator.
const WIDTH: f64 = 1e-12;

#[derive(Default)]
struct Sample {
    time: f64,
    indicators: Vec<f64>,
}

/// Memory for the search of a state event.
#[derive(Default)]
pub(super) struct Search {
    /// A time before the event.
    left: Sample,
    /// A time after the event.
    right: Sample,
    /// The event indicators at the time that was evaluated last.
    between: Vec<f64>,
    /// The states at the time that was evaluated last.
    states: Vec<f64>,
}

impl Search {
    pub(super) fn new(states: usize, indicators: usize) -> Self {
        let sample = || Sample { time: 0.0, indicators: vec![0.0; indicators] };
        Self {
            left: sample(),
            right: sample(),
            between: vec![0.0; indicators],
            states: vec![0.0; states],
        }
    }
}

/// Returns the difference in s that counts as rounding at `time` after a step of `size` s.
pub(super) fn rounding(time: f64, size: f64) -> f64 {
    (ROUNDING * size.max(time.abs())).min(MOST).max(4.0 * f64::EPSILON * time.abs())
}

/// Returns the index of the first event indicator whose sign differs: z > 0 or z <= 0.
fn changed(before: &[f64], after: &[f64]) -> Option<usize> {
    before.iter().zip(after).position(|(before, after)| (*before > 0.0) != (*after > 0.0))
}

impl Integrated {
    /// Integrates to `end`, to an event for the master, or to the end of the simulation that the FMU requests.
    pub(super) fn integrate(
        &mut self,
        end: f64,
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let start = self.point.time;
        let rounding = rounding(end, end - start);
        self.inputs.prepare();
        self.stepper.forget_slope();
        let mut events = 0;
        loop {
            if self.point.ends {
                let reached = self.point.time;
                return Ok(StepResult::Part { reached, terminated: true });
            }
            if self.point.mode == Mode::Event {
                events += 1;
                if events > EVENTS {
                    let (time, start) = (seconds(self.point.time), seconds(start));
                    return Err(failed(format!(
                        "stops at t = {time} s after {EVENTS} events since t = {start} s"
                    )));
                }
                self.settle()?;
            } else if self.point.event
                || self.event_is_due(rounding)?
                || self.input_caused_event()?
            {
                let reached = self.point.time;
                let at_end = reached >= end - rounding;
                if self.hands_over && (at_end || self.stops && reached > start) {
                    // An event that is earlier than the end by rounding is at the end.
                    let reached = if at_end { reached.max(end) } else { reached };
                    return Ok(StepResult::Event { reached });
                }
                self.enter_event()?;
            } else if self.point.time >= end {
                return Ok(StepResult::Whole);
            } else {
                let limit = self.point.next_event.map_or(end, |event| event.min(end));
                self.step(limit, never_back)?;
            }
        }
    }

    /// Whether a time event is due. Sets the present time to the time of the event, which may be later by rounding.
    fn event_is_due(&mut self, rounding: f64) -> Result<bool, CallError> {
        let due = self.point.next_event.filter(|event| *event <= self.point.time + rounding);
        if let Some(event) = due.filter(|event| *event > self.point.time) {
            self.instance.set_time(event)?;
            self.point.time = event;
        }
        Ok(due.is_some())
    }

    /// Whether new inputs changed the sign of an event indicator.
    fn input_caused_event(&mut self) -> Result<bool, CallError> {
        if !std::mem::take(&mut self.point.input_changed) || self.indicators.is_empty() {
            return Ok(false);
        }
        self.instance.get_event_indicators(&mut self.search.between)?;
        check_indicators(self.point.time, &self.search.between)?;
        Ok(changed(&self.indicators, &self.search.between).is_some())
    }

    /// Makes one step of the integrator, to `limit` at most or to the first state event.
    fn step(&mut self, limit: f64, never_back: bool) -> Result<(), CallError> {
        let start = self.point.time;
        let (instance, inputs) = (self.instance.as_mut(), &mut self.inputs);
        let mut derivative = |time: f64, states: &[f64], slope: &mut [f64]| {
            instance.set_time(time)?;
            inputs.apply(instance, time)?;
            instance.set_continuous_states(states)?;
            instance.get_derivatives(slope)
        };
        let reached = self.stepper.advance(&mut derivative, &self.states, start, limit);
        let reached = reached.map_err(|error| self.stopped(error))?;
        let event = self.locate(start, reached)?;
        let time = event.unwrap_or(reached);
        match event {
            Some(_) => self.states.copy_from_slice(&self.search.states),
            None if !self.states.is_empty() => self.states.copy_from_slice(self.stepper.end()),
            None => {}
        }
        self.instance.set_time(time)?;
        self.inputs.apply(self.instance.as_mut(), time)?;
        if !self.states.is_empty() {
            self.instance.set_continuous_states(&self.states)?;
        }
        self.point.time = time;
        if self.instance.needs_completed_integrator_step() {
            let done = match self.instance.completed_integrator_step(never_back) {
                // An FMU that lacks the function does not need it.
                Err(CallError { failure: Failure::Missing, .. }) => CompletedStep::default(),
                done => done?,
            };
            self.point.ends |= done.terminate_simulation;
            self.point.event |= done.enter_event_mode;
        }
        self.point.event |= event.is_some();
        Ok(())
    }

    /// Computes the states at `time` within the step from `start` to `end` into `search.states`, and reads
    /// the event indicators there into `search.between`.
    fn evaluate(&mut self, time: f64, start: f64, end: f64) -> Result<(), CallError> {
        if !self.states.is_empty() {
            if time >= end {
                self.search.states.copy_from_slice(self.stepper.end());
            } else {
                let part = (time - start) / (end - start);
                self.stepper.interpolate(part, &mut self.search.states);
            }
        }
        self.instance.set_time(time)?;
        self.inputs.apply(self.instance.as_mut(), time)?;
        if !self.states.is_empty() {
            self.instance.set_continuous_states(&self.search.states)?;
        }
        self.instance.get_event_indicators(&mut self.search.between)?;
        check_indicators(time, &self.search.between)
    }

    /// Returns the time just after the first state event in the step from `start` to `end`, with the
    /// states there in `search.states`. Without an event, `indicators` get the event indicators at the end.
    ///
    /// An indicator that changes its sign twice within half a step is not noticed.
    fn locate(&mut self, start: f64, end: f64) -> Result<Option<f64>, CallError> {
        if self.indicators.is_empty() {
            return Ok(None);
        }
        self.search.left.time = start;
        self.search.left.indicators.copy_from_slice(&self.indicators);
        for time in [start + 0.5 * (end - start), end] {
            self.evaluate(time, start, end)?;
            let Search { left, right, between, .. } = &mut self.search;
            if changed(&left.indicators, between).is_some() {
                right.time = time;
                right.indicators.copy_from_slice(between);
                return self.narrow(start, end).map(Some);
            }
            left.time = time;
            left.indicators.copy_from_slice(between);
        }
        self.indicators.copy_from_slice(&self.search.left.indicators);
        Ok(None)
    }

    /// Narrows the interval from `search.left` to `search.right`, in the step from `start` to `end`, around
    /// its first change of sign; returns the end of the interval, with the states there in `search.states`.
    fn narrow(&mut self, start: f64, end: f64) -> Result<f64, CallError> {
        let width = WIDTH * (end - start);
        while let Some(index) = changed(&self.search.left.indicators, &self.search.right.indicators)
        {
            let Search { left, right, .. } = &self.search;
            let [before, after] =
                [left, right].map(|sample| (sample.time, sample.indicators[index]));
            // None if an indicator is infinite: the interval cannot be narrowed then.
            let Some(mut bracket) = Bracket::new(before, after, width) else { break };
            if bracket.ask().is_none() {
                break;
            }
            while let Some(time) = bracket.ask() {
                self.evaluate(time, start, end)?;
                let Search { left, right, between, .. } = &mut self.search;
                bracket.tell(time, between[index]);
                let changes = (left.indicators[index] > 0.0) != (between[index] > 0.0);
                let any = changed(&left.indicators, between).is_some();
                let side = if any { right } else { left };
                side.time = time;
                side.indicators.copy_from_slice(between);
                if any && !changes {
                    // Another indicator changes earlier.
                    break;
                }
            }
        }
        let time = self.search.right.time;
        self.evaluate(time, start, end)?;
        Ok(time)
    }
}
