//! The modes of an instance: events and steps (FMI 3.0.2, sections 2.3 and 4.2).

use super::Instance;
use super::access::refused;
use crate::library::Interface;
use fmu_description::number::seconds;
use slave::{CallError, Failure, StepResult};

use fmu_description::abi::Status;

/// Largest number of updates of the discrete states in one event.
const UPDATES: u32 = 1000;
/// Largest number of parts of a step that make no progress.
const STANDSTILLS: u32 = 1000;
/// Part of a step below which a difference of times is rounding.
const ROUNDING: f64 = 1e-9;
/// Smallest part of a step that is tried after `fmi3Discard`.
const SMALLEST: f64 = 1e-6;

/// The mode of the FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Mode {
    #[default]
    Instantiated,
    Initialization,
    Event,
    Step,
}

impl Mode {
    /// Whether the initialization has ended.
    pub(super) fn is_initialized(self) -> bool {
        matches!(self, Mode::Event | Mode::Step)
    }
}

/// What an instance knows beside the state of its FMU.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    pub(super) mode: Mode,
    /// `nextEventTime` in s.
    pub(super) next_event: Option<f64>,
    /// Whether the FMU has requested the end of the simulation.
    pub(super) terminate: bool,
    /// Time of the last step or event in s.
    pub(super) time: f64,
    /// Values set last of the elements that may change in Event Mode only.
    pub(super) held: Vec<Option<u64>>,
    pub(super) clocks: super::clocks::Clocks,
}

impl Instance {
    /// Ends the initialization and handles the event at the start time.
    pub(super) fn end_initialization(&mut self) -> Result<(), CallError> {
        let start = self.state.time;
        self.state.clocks.start(&mut self.component, start)?;
        self.component.exit_initialization_mode()?;
        if self.interface == Interface::ModelExchange {
            self.state.mode = Mode::Event;
            Ok(())
        } else if self.event_mode {
            self.state.mode = Mode::Event;
            self.handle_event(self.state.time)
        } else {
            self.state.mode = Mode::Step;
            Ok(())
        }
    }

    /// Enters Event Mode.
    pub(super) fn enter_event(&mut self) -> Result<(), CallError> {
        self.component.enter_event_mode()?;
        self.state.mode = Mode::Event;
        Ok(())
    }

    /// Handles the event at `time`: clocks tick, discrete states are updated until they do not change
    /// any more; then enters Step Mode.
    pub(super) fn handle_event(&mut self, time: f64) -> Result<(), CallError> {
        if self.state.mode == Mode::Step {
            self.enter_event()?;
        }
        let active = self.tick(time)?;
        let mut updates = 0;
        loop {
            self.state.clocks.read_outputs(&mut self.component)?;
            let info = self.component.update_discrete_states()?;
            self.state.terminate |= info.terminate_simulation;
            self.state.next_event = info.next_event_time;
            updates += 1;
            if !info.discrete_states_need_update || info.terminate_simulation {
                break;
            }
            if updates == UPDATES {
                let what = format!(
                    "needs more than {UPDATES} updates of the discrete states at t = {} s",
                    seconds(time)
                );
                return Err(refused("fmi3UpdateDiscreteStates", what));
            }
        }
        self.state.clocks.ask_intervals(&mut self.component, time, &active)?;
        self.component.enter_step_mode()?;
        self.state.mode = Mode::Step;
        Ok(())
    }

    /// Makes the clocks tick that are due at `time`, and returns them.
    pub(super) fn tick(&mut self, time: f64) -> Result<Vec<u32>, CallError> {
        if !self.state.clocks.is_due(time) {
            return Ok(Vec::new());
        }
        let active = self.state.clocks.tick(time);
        self.component.activate_clocks(&active)?;
        self.set_deferred(&active)?;
        Ok(active)
    }

    /// Sets the values that waited for a tick of one of the `active` clocks.
    fn set_deferred(&mut self, active: &[u32]) -> Result<(), CallError> {
        for run in self.plans.all_runs() {
            if run.deferred && run.clocks.iter().any(|clock| active.contains(clock)) {
                run.deferred = false;
                run.buffer.set(&mut self.component, &run.references)?;
            }
        }
        Ok(())
    }

    /// Steps from `time` over `size` s; handles the events within the step and at its end.
    pub(super) fn step(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let done = self.parts(time, size, never_back);
        self.component.forget_input_derivatives();
        done
    }

    fn parts(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        if self.event_mode {
            self.state.clocks.begin_step();
            if self.state.mode == Mode::Event || self.is_event_due(time, size) {
                self.handle_event(time)?;
            }
        }
        if self.state.terminate {
            return Ok(StepResult::Part { reached: time, terminated: true });
        }
        let (end, rounding) = (time + size, ROUNDING * size);
        let (mut now, mut left, mut largest, mut standstills) = (time, size, f64::INFINITY, 0);
        loop {
            let limited = self.limited(now, left, rounding).min(largest);
            let done = match self.component.do_step(now, limited, never_back) {
                Ok(done) => done,
                Err(error)
                    if error.failure == Failure::Status(Status::Discard)
                        && limited > SMALLEST * size =>
                {
                    largest = 0.5 * limited;
                    continue;
                }
                Err(error) => return Err(error),
            };
            largest = f64::INFINITY;
            let target = if limited < left { now + limited } else { end };
            let reached = if done.early || done.terminate { done.reached } else { target };
            if !(reached >= now - rounding && reached <= target + rounding) {
                let what = format!(
                    "returned early with the last successful time {reached} s, expected one from \
                     {now} to {target} s"
                );
                return Err(refused("fmi3DoStep", what));
            }
            self.state.time = reached;
            self.component.settle_inputs(reached)?;
            if done.terminate {
                return Ok(StepResult::Part { reached, terminated: true });
            }
            if self.event_mode && (done.event || self.is_event_due(reached, size)) {
                self.handle_event(reached)?;
                if self.state.terminate {
                    return Ok(StepResult::Part { reached, terminated: true });
                }
            }
            if reached >= end - rounding {
                return Ok(StepResult::Whole);
            }
            standstills = if reached > now { 0 } else { standstills + 1 };
            if standstills == STANDSTILLS {
                let reached = seconds(reached);
                let what = format!("returned early {STANDSTILLS} times at t = {reached} s");
                return Err(refused("fmi3DoStep", what));
            }
            (now, left) = (reached, end - reached);
        }
    }

    /// Returns the largest step from `now` of at most `left` s that crosses no event.
    fn limited(&self, now: f64, left: f64, rounding: f64) -> f64 {
        if !self.event_mode {
            return left;
        }
        let events = [self.state.next_event, self.state.clocks.next()].into_iter().flatten();
        let sizes = events.map(|event| event - now).filter(|size| *size > rounding);
        let least = sizes.reduce(f64::min).unwrap_or(f64::INFINITY);
        // A step that ends shortly before its end would leave a rest that is rounding.
        if least < left - rounding { least } else { left }
    }

    /// Whether an event is due at `time`, in a step of `size` s.
    fn is_event_due(&self, time: f64, size: f64) -> bool {
        self.state.next_event.is_some_and(|next| next <= time + ROUNDING * size)
            || self.state.clocks.is_due(time)
    }
}
