//! The modes of an instance: events and steps (FMI 3.0.2, sections 2.3 and 4.2).

use super::Instance;
use crate::error::refused;
use crate::library::v3::{DoStepResult, Interface};
use fmu_description::abi::Status;
use fmu_description::number::seconds;
use slave::{CallError, EventInfo, Events, Failure, StepResult, time_rounding};

/// Largest number of updates of the discrete states in one event.
const UPDATES: u32 = 1000;
/// Largest number of successive parts of a step that make no progress.
const STANDSTILLS: u32 = 1000;
/// Largest difference between the time that an FMU adds up itself and the time of its importer, as a fraction of the
/// step.
const DEVIATION: f64 = 1e-3;
/// Smallest part of a step, as a fraction of the step, that is tried again with half its size after `fmi3Discard`.
const SMALLEST: f64 = 1e-6;

/// The mode of the FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Mode {
    #[default]
    Instantiated,
    Initialization,
    Event,
    /// Step Mode, in model exchange Continuous-Time Mode.
    Step,
}

impl Mode {
    /// Whether the initialization has ended.
    pub(super) fn is_initialized(self) -> bool {
        matches!(self, Mode::Event | Mode::Step)
    }
}

impl Instance {
    /// Ends the initialization; handles the event at the start time, unless the master does.
    pub(crate) fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        let start = self.state.time;
        self.state.clocks.start(&mut self.component, start)?;
        self.component.exit_initialization_mode()?;
        self.state.mode = if self.interface == Interface::ModelExchange || self.event_mode {
            Mode::Event
        } else {
            Mode::Step
        };
        if self.event_mode && !self.hands_over_events { self.handle_event() } else { Ok(()) }
    }

    /// Enters Event Mode, unless the FMU is already in Event Mode.
    pub(super) fn enter_event(&mut self) -> Result<(), CallError> {
        if self.state.mode != Mode::Event {
            if !self.is_scheduled() {
                self.component.enter_event_mode()?;
            }
            self.state.mode = Mode::Event;
        }
        self.state.event = false;
        Ok(())
    }

    /// Returns the time of the next time event or tick in s, if one is known.
    pub(super) fn next_event_time(&self) -> Option<f64> {
        let events = [self.state.next_event, self.state.clocks.next()];
        events.into_iter().flatten().reduce(f64::min)
    }

    /// Handles the event at the time reached: updates the discrete states until they do not change any more. More than
    /// [`UPDATES`] updates are an error.
    pub(super) fn handle_event(&mut self) -> Result<(), CallError> {
        self.enter_event_mode()?;
        let mut updates = 0;
        loop {
            let info = self.update_discrete_states()?;
            updates += 1;
            if !info.discrete_states_need_update || info.terminate_simulation {
                break;
            }
            if updates == UPDATES {
                let what = format!(
                    "needs more than {UPDATES} updates of the discrete states at t = {} s",
                    seconds(self.state.time)
                );
                return Err(refused("fmi3UpdateDiscreteStates", what));
            }
        }
        self.leave_event_mode()
    }

    /// Hands the events over to the master: a step stops at events at its end only or, with `stop`, at the first event
    /// within it. Returns whether the FMU was instantiated with `eventModeUsed`; always false in model exchange.
    pub(crate) fn hand_over_events(&mut self, stop: bool) -> bool {
        (self.hands_over_events, self.stops_at_events) = (true, stop);
        self.event_mode
    }

    /// Steps from `time` over `size` s. Handles the events within the step and at its end if the master does not.
    pub(crate) fn do_step(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let done = self.step_in_parts(time, size, never_back);
        self.component.forget_input_derivatives();
        done
    }

    /// Steps in parts, each up to an event or an early return of the FMU; tries half of a discarded part.
    fn step_in_parts(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        self.state.time = time;
        if self.event_mode {
            self.state.clocks.begin_step();
            if self.state.mode == Mode::Event || self.state.event || self.is_event_due(time, size) {
                self.handle_event()?;
            }
        }
        if self.state.terminate {
            return Ok(StepResult::Part { reached: time, terminated: true });
        }
        let (end, rounding) = (time + size, time_rounding(time, size));
        let deviation = rounding.max(DEVIATION * size);
        let (mut now, mut left, mut largest, mut standstills) = (time, size, f64::INFINITY, 0);
        loop {
            let limited = self.limited(now, left, rounding).min(largest);
            let done = match self.advance(now, limited, never_back) {
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
            if !(reached >= now - deviation && reached <= target + deviation) {
                let what = format!(
                    "returned early with the last successful time {reached} s, expected one from \
                     {now} to {target} s"
                );
                return Err(refused("fmi3DoStep", what));
            }
            let reached = if target - reached <= rounding { target } else { reached.max(now) };
            self.state.time = reached;
            self.component.settle_inputs(reached)?;
            if done.terminate {
                return Ok(StepResult::Part { reached, terminated: true });
            }
            if self.event_mode && (done.event || self.is_event_due(reached, size)) {
                if self.hands_over_events && (self.stops_at_events || reached >= end - rounding) {
                    self.state.event = true;
                    return Ok(StepResult::Event { reached });
                }
                self.handle_event()?;
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

    /// Starts a communication step of model exchange.
    pub(crate) fn begin_communication_step(&mut self) {
        self.state.clocks.begin_step();
    }

    pub(crate) fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        self.state.time = time;
        self.component.set_time(time)
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        self.leave_event_mode()
    }

    /// Returns the largest step from `now` of at most `left`, both in s, that crosses no event.
    fn limited(&self, now: f64, left: f64, rounding: f64) -> f64 {
        if !self.event_mode {
            return left;
        }
        let events = [self.state.next_event, self.state.clocks.next()].into_iter().flatten();
        let sizes = events.map(|event| event - now).filter(|size| *size > rounding);
        let least = sizes.fold(f64::INFINITY, f64::min);
        // An event within rounding of the end counts as an event at the end.
        if least < left - rounding { least } else { left }
    }

    /// Returns whether a time event or a tick is due at `time`, in a step of `size` s.
    fn is_event_due(&self, time: f64, size: f64) -> bool {
        self.state.next_event.is_some_and(|next| next <= time + time_rounding(time, size))
            || self.state.clocks.is_due(time)
    }
}

/// Scheduled execution (FMI 3.0.2, section 5): a tick of an input clock activates its model partition. The master treats
/// such an FMU as an FMU for co-simulation whose steps do nothing and whose events run the partitions.
impl Instance {
    pub(super) fn is_scheduled(&self) -> bool {
        self.interface == Interface::ScheduledExecution
    }

    /// Steps from `time` over `size` s. In scheduled execution the step is complete at once.
    pub(super) fn advance(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<DoStepResult, CallError> {
        if self.is_scheduled() {
            let reached = time + size;
            return Ok(DoStepResult { event: false, terminate: false, early: false, reached });
        }
        self.component.do_step(time, size, never_back)
    }

    /// Runs the model partitions of the input clocks that tick, in the order of their priorities. The clocks that tick
    /// as a result remain active until the next call.
    pub(super) fn run_partitions(&mut self) -> Result<EventInfo, CallError> {
        let time = self.state.time;
        for clock in self.state.clocks.take_partitions() {
            self.component.activate_model_partition(clock, time)?;
        }
        self.state.clocks.end_ticks();
        self.state.clocks.read_outputs(&mut self.component)?;
        self.state.clocks.ask_intervals(&mut self.component, time)?;
        self.tick()?;
        Ok(EventInfo {
            discrete_states_need_update: self.state.clocks.any_active(),
            next_event_time: self.next_event_time(),
            ..EventInfo::default()
        })
    }
}

impl Events for Instance {
    fn next_event(&mut self) -> Result<Option<f64>, CallError> {
        Ok(self.next_event_time())
    }

    /// Enters Event Mode; input clocks that are due tick.
    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        self.enter_event()?;
        self.tick()
    }

    /// Updates the discrete states once. Input clocks that are due tick before the update; all ticks end after it. A
    /// clock to which the event gives an interval of 0 s ticks for the next update, at most 100 times in an event.
    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        self.tick()?;
        if self.is_scheduled() {
            return self.run_partitions();
        }
        self.state.clocks.read_outputs(&mut self.component)?;
        self.read_clocked()?;
        let mut info = self.component.update_discrete_states()?;
        self.state.clocks.end_ticks();
        if !info.discrete_states_need_update && !info.terminate_simulation {
            self.state.clocks.ask_intervals(&mut self.component, self.state.time)?;
            self.tick()?;
            info.discrete_states_need_update = self.state.clocks.any_active();
        }
        self.state.terminate |= info.terminate_simulation;
        self.state.next_event = info.next_event_time;
        info.next_event_time = self.next_event_time();
        Ok(info)
    }

    /// Enters Step Mode, in model exchange Continuous-Time Mode.
    fn leave_event_mode(&mut self) -> Result<(), CallError> {
        self.state.clocks.end_event();
        match self.interface {
            Interface::CoSimulation => self.component.enter_step_mode()?,
            Interface::ModelExchange => self.component.enter_continuous_time_mode()?,
            Interface::ScheduledExecution => {}
        }
        self.state.mode = Mode::Step;
        Ok(())
    }
}
