//! The engine: the slaves with their connections and driven variables. The engine makes sweeps, in which every slave
//! makes one step, and saves and restores the state of all slaves and connections.

mod groups;
mod instants;
mod threads;

use std::ops::Range;

use fmu_description::number::seconds;
use serde::{Deserialize, Serialize};

use crate::algorithm::Algorithm;
use crate::drive::Drives;
use crate::error::{SystemError, call};
use crate::exchange::{Exchange, Values};
use crate::grid::{Grid, is_rigid, multiples, size_between};
use crate::order::Order;
use crate::system::System;
use groups::Groups;
pub(crate) use instants::{InstantEnd, Instants, Parts};
use slave::{CallError, CommunicationStep, Failure, StepResult, time_rounding};
use threads::{Threads, run};

/// Largest number of partial steps in which a slave may complete a step.
const PARTS: u32 = 1000;
/// Smallest step before or after an event within a communication step, as a fraction of this communication step.
const DIVISION: f64 = 1e-6;

/// Advice for an FMU that fails after `fmi2Discard`.
const ADVICE: &str = "the step before it was discarded; with rollback all FMUs repeat it";

/// The slaves with their connections and driven variables.
pub(crate) struct Engine {
    pub(crate) system: System,
    pub(crate) exchange: Exchange,
    pub(crate) drives: Drives,
    pub(crate) grid: Grid,
    pub(crate) instants: Instants,
    /// Why steps end only at the grid points `start + k H`; `None` if steps may end at any time.
    rigid: Option<Rigid>,
    division: Division,
    /// Whether steps may be repeated, for which every slave must be able to restore its state. Otherwise a slave that
    /// completes only a part of its step (`fmi2Discard`) continues until the end.
    pub(crate) repeats: bool,
    groups: Groups,
    /// For each slave, the number of communication steps in one of its steps.
    multiples: Vec<u32>,
    /// For each slave, the size in s of its step in the current sweep; 0 for a slave that makes no step.
    sizes: Vec<f64>,
    /// Whether some slaves step in the background.
    background: bool,
    threads: Option<Threads>,
    /// Whether a sweep is a single loop over the slaves; see [`Engine::pass`].
    passes: bool,
}

/// What happens to a step with a change within it: an event, or a jump or kink of a signal or fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Division {
    /// The step is made as planned.
    Never,
    /// The step ends at the change.
    AtChanges,
    /// The step is made as planned; a warning reports the first change, which takes effect late.
    Report,
}

/// Why steps end only at grid points.
struct Rigid {
    why: String,
    /// Whether a change that took effect late has been reported.
    reported: bool,
}

impl Rigid {
    /// Returns `None` if all slaves take steps of any size.
    fn of(system: &System, multiples: &[u32]) -> Option<Self> {
        let why = if multiples.iter().any(|multiple| *multiple != 1) {
            "some FMUs step at multiples of the communication step (every)".to_owned()
        } else {
            let mut slaves = system.slaves.iter();
            let (name, _) = slaves.find(|(_, slave)| is_rigid(slave.as_ref()))?;
            format!(
                "{name} takes equal steps only (canHandleVariableCommunicationStepSize is false)"
            )
        };
        Some(Self { why, reported: false })
    }
}

/// The result of a sweep, in which every slave steps once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Swept {
    /// All slaves completed the step.
    #[default]
    Whole,
    /// Some slaves completed only a part of the step: the time in s that every slave can reach.
    Part(f64),
    /// A slave requested the end of the simulation.
    Ended(Ending),
}

/// The slave that requested the end of the simulation, and the time in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ending {
    pub(crate) slave: usize,
    pub(crate) time: f64,
}

/// The state of all slaves and connections at the start of a step.
pub(crate) struct SavedState {
    /// The slot in which every slave keeps its FMU state.
    slot: usize,
    time: f64,
    values: Values,
}

impl SavedState {
    pub(crate) fn new(slot: usize) -> Self {
        Self { slot, time: 0.0, values: Values::default() }
    }
}

impl Engine {
    pub(crate) fn new(
        mut system: System,
        exchange: Exchange,
        drives: Drives,
        instants: Instants,
        grid: Grid,
        order: &Order,
        algorithm: &Algorithm,
    ) -> Result<Self, SystemError> {
        let groups = Groups::new(&system, algorithm.method, order);
        let multiples = multiples(&system, algorithm)?;
        let rigid = Rigid::of(&system, &multiples);
        let background = system.slaves.iter_mut().any(|(_, slave)| slave.in_background().is_some());
        let threads = Threads::new(algorithm.jobs, groups.len())?;
        let mut engine = Self {
            passes: false,
            rigid,
            division: Division::Never,
            instants,
            repeats: algorithm.repeats(),
            sizes: vec![0.0; multiples.len()],
            system,
            exchange,
            drives,
            grid,
            groups,
            multiples,
            background,
            threads,
        };
        engine.choose_sweep();
        Ok(engine)
    }

    /// Chooses between [`Engine::pass`] and [`Engine::step_groups`], and whether steps end at changes within them.
    /// Call it after a change of the scenario.
    pub(crate) fn choose_sweep(&mut self) {
        self.passes = self.threads.is_none() && !self.background && self.exchange.passes();
        let changes = !self.drives.is_empty() || self.exchange.is_faulty;
        self.division = match &self.rigid {
            None if changes || self.instants.are_connected() => Division::AtChanges,
            Some(rigid) if changes && !rigid.reported => Division::Report,
            _ => Division::Never,
        };
    }

    /// Returns the first known event, jump or kink within the planned step from `time` to `end`, all in s, at which the
    /// step must end. `None` if it ends at `end`; then warns of the first change, which takes effect late.
    #[inline]
    pub(crate) fn earlier_end(&mut self, time: f64, end: f64) -> Option<f64> {
        match self.division {
            Division::Never => None,
            Division::AtChanges => self.first_within(time, end),
            Division::Report => {
                self.report_late(time, end);
                None
            }
        }
    }

    /// Returns the times in s between which a step from `time` to `end` may be divided.
    fn divisible(&self, time: f64, end: f64) -> (f64, f64) {
        let size = end - time;
        (time + DIVISION * size, end - self.grid.negligible(size, end))
    }

    /// Returns the first jump or kink of a signal or fault within a step.
    fn change_within(&self, time: f64, end: f64) -> Option<f64> {
        let (after, before) = self.divisible(time, end);
        self.next_breaks(after).filter(|next| *next < before).reduce(f64::min)
    }

    /// Returns the first known event, jump or kink within a step.
    #[inline(never)]
    fn first_within(&self, time: f64, end: f64) -> Option<f64> {
        let (after, before) = self.divisible(time, end);
        let event = self.instants.next_after(after).filter(|next| *next < before);
        self.change_within(time, end).into_iter().chain(event).reduce(f64::min)
    }

    /// Warns about the first change that takes effect late.
    #[inline(never)]
    fn report_late(&mut self, time: f64, end: f64) {
        let change = self.change_within(time, end);
        let (Some(change), Some(rigid)) = (change, &mut self.rigid) else { return };
        rigid.reported = true;
        self.division = Division::Never;
        let driven = self.drives.iter().filter(|drive| drive.breaks_at(change));
        let names: Vec<String> = driven.map(|drive| self.system.name(drive.port())).collect();
        let what = if names.is_empty() { "a fault".to_owned() } else { names.join(", ") };
        tracing::warn!(
            "{what} changes at t = {} s and takes effect at {} s, {} s late: {}; a step that \
             divides the times of all changes helps",
            seconds(change),
            seconds(end),
            seconds(end - change),
            rigid.why
        );
    }

    /// Iterates the events of all slaves at the time reached, if there are any.
    #[inline]
    pub(crate) fn settle(&mut self) -> Result<InstantEnd, SystemError> {
        if self.instants.is_empty() { Ok(InstantEnd::default()) } else { self.settle_instant() }
    }

    #[inline(never)]
    fn settle_instant(&mut self) -> Result<InstantEnd, SystemError> {
        let (system, exchange, drives) = (&mut self.system, &mut self.exchange, &mut self.drives);
        let mut parts = Parts { system, exchange, drives };
        if self.instants.is_due(&mut parts, self.grid.time) {
            self.instants.iterate(&mut parts, self.grid.time)
        } else {
            Ok(InstantEnd::default())
        }
    }

    /// Makes a sweep: sets the driven variables and steps all slaves from `time` over `size`.
    #[inline]
    pub(crate) fn sweep(&mut self, time: f64, size: f64) -> Result<Swept, SystemError> {
        if !self.drives.is_empty() {
            self.drives.write(&mut self.system, time)?;
        }
        if self.passes { self.pass(time, size) } else { self.step_groups(time, size) }
    }

    /// Saves the state of all slaves (`fmi2GetFMUstate`) and connections at `time`.
    pub(crate) fn save(&mut self, time: f64, state: &mut SavedState) -> Result<(), SystemError> {
        for (name, slave) in &mut self.system.slaves {
            slave.save_state(state.slot).map_err(|source| call(name, time, source))?;
        }
        state.time = time;
        self.exchange.save(&mut state.values);
        Ok(())
    }

    /// Restores the state of all slaves (`fmi2SetFMUstate`) and connections.
    pub(crate) fn restore(&mut self, state: &SavedState) -> Result<(), SystemError> {
        for (name, slave) in &mut self.system.slaves {
            slave.restore_state(state.slot).map_err(|source| call(name, state.time, source))?;
        }
        self.exchange.restore(&state.values);
        self.instants.forget();
        Ok(())
    }

    /// Records the time reached as a final communication point in faults and driven variables.
    #[inline]
    pub(crate) fn commit(&mut self) {
        self.exchange.commit(self.grid.time);
        self.drives.commit(self.grid.time);
    }

    /// Returns the times after `after`, all in s, of the next start, jump or kink of a driven variable and of the
    /// next start or end of a fault on a connection.
    pub(crate) fn next_breaks(&self, after: f64) -> impl Iterator<Item = f64> {
        [self.drives.next_break(after), self.exchange.next_break(after)].into_iter().flatten()
    }

    /// Returns the slaves whose steps cover several communication steps.
    pub(crate) fn slow_slaves(&self) -> impl Iterator<Item = usize> {
        (0..self.multiples.len()).filter(|&slave| self.multiples[slave] != 1)
    }

    /// Makes a sweep of Jacobi's method whose inputs are copies of Real outputs, as a single loop
    /// over contiguous arrays. A pair of tiny FMUs takes 50 ns instead of 137 ns a step by
    /// [`Engine::step_groups`] (`docs/explanation/speed.md`).
    #[inline]
    fn pass(&mut self, time: f64, size: f64) -> Result<Swept, SystemError> {
        let mut swept = Swept::default();
        let step = CommunicationStep { time, size, never_back: !self.repeats };
        let parts = self.exchange.reals.pass(&mut self.system, step)?;
        if !parts.is_empty() {
            for (slave, done) in std::mem::take(parts) {
                self.finish_in_parts(slave, time, size, done, &mut swept)?;
            }
        }
        if !self.exchange.reals.is_finite() {
            for slave in 0..self.system.slaves.len() {
                self.exchange.check_finite(&self.system, slave, time + size)?;
            }
        }
        Ok(swept)
    }

    /// Makes a sweep group by group: gathers the inputs of a group, then steps its slaves. A
    /// separate function keeps the loop of [`Engine::pass`] small.
    #[inline(never)]
    fn step_groups(&mut self, time: f64, size: f64) -> Result<Swept, SystemError> {
        let mut swept = Swept::default();
        self.shift(time, size);
        for group in 0..self.groups.len() {
            let members = self.groups.members(group);
            for position in members.clone() {
                let slave = self.groups.sequence[position];
                self.exchange.gather(slave, time, self.sizes[slave]);
                self.exchange.check_inputs(&self.system, slave, time)?;
            }
            if members.len() > 1 && self.threads.is_some() {
                self.step_measured(group, time, &mut swept)?;
            } else {
                self.step_members(members, time, &mut swept)?;
            }
        }
        Ok(swept)
    }

    /// Determines which slaves step in the sweep from `time` over `size`, and how far; the end
    /// values of their last steps become the start values.
    fn shift(&mut self, time: f64, size: f64) {
        for slave in 0..self.multiples.len() {
            self.sizes[slave] = match self.multiples[slave] {
                1 => size,
                _ if self.exchange.reals.is_ahead(slave, time) => 0.0,
                multiple => self.grid.size_of(multiple, time),
            };
            if self.sizes[slave] > 0.0 {
                self.exchange.shift(slave, time, self.sizes[slave]);
            }
        }
    }

    /// Returns the step of `slave` from `time`; the size of the step is 0 if the slave makes none.
    fn step_of(&self, slave: usize, time: f64) -> CommunicationStep {
        CommunicationStep { time, size: self.sizes[slave], never_back: !self.repeats }
    }

    /// Steps the slaves at `members` of the sequence. Background slaves start before the first
    /// result is waited for; results are evaluated in the order of the slaves. Returns the first
    /// error in this order; does not wait for steps started after it.
    fn step_members(
        &mut self,
        members: Range<usize>,
        time: f64,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let failure =
            if self.background { self.start_members(members.clone(), time) } else { None };
        for position in members {
            if failure.as_ref().is_some_and(|(failed, _)| *failed == position) {
                break;
            }
            let slave = self.groups.sequence[position];
            let step = self.step_of(slave, time);
            if step.size == 0.0 {
                continue;
            }
            let done = if self.background {
                self.exchange.finish(&mut self.system, slave, step)?
            } else {
                self.exchange.advance(&mut self.system, slave, step)?
            };
            self.finish(slave, time, done, swept)?;
        }
        failure.map_or(Ok(()), |(_, error)| Err(error))
    }

    /// Starts the steps of background slaves up to the first failure; returns the position and error of this failure.
    fn start_members(&mut self, members: Range<usize>, time: f64) -> Option<(usize, SystemError)> {
        for position in members {
            let slave = self.groups.sequence[position];
            let step = self.step_of(slave, time);
            if step.size > 0.0 {
                let started = self.exchange.start(&mut self.system, slave, step);
                if let Err(error) = started {
                    return Some((position, error));
                }
            }
        }
        None
    }

    /// As [`Engine::step_members`], in threads if measurements show that this is faster.
    #[cold]
    fn step_measured(
        &mut self,
        group: usize,
        time: f64,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let Some(threads) = &self.threads else { return Ok(()) };
        let members = self.groups.members(group);
        let trial = threads.begin(group);
        if trial.in_threads {
            self.step_in_threads(members, time, swept)?;
        } else {
            self.step_members(members, time, swept)?;
        }
        if let Some(threads) = &mut self.threads {
            threads.end(group, &trial);
        }
        Ok(())
    }

    /// As [`Engine::step_members`], in threads.
    fn step_in_threads(
        &mut self,
        members: Range<usize>,
        time: f64,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let (sizes, threads, never_back) = (&self.sizes, &self.threads, !self.repeats);
        let due = self.groups.sequence[members].iter().copied();
        let due: Vec<usize> = due.filter(|&slave| sizes[slave] > 0.0).collect();
        let done = self.exchange.advance_all(
            &mut self.system,
            &due,
            &|slave| CommunicationStep { time, size: sizes[slave], never_back },
            |tasks| run(threads.as_ref(), tasks),
        )?;
        for (slave, done) in due.into_iter().zip(done) {
            self.finish(slave, time, done, swept)?;
        }
        Ok(())
    }

    #[inline]
    fn finish(
        &mut self,
        slave: usize,
        time: f64,
        done: StepResult,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let size = self.sizes[slave];
        if done != StepResult::Whole {
            self.finish_in_parts(slave, time, size, done, swept)?;
        }
        self.exchange.check_finite(&self.system, slave, time + size)
    }

    /// Handles a slave that completed only the part `done` of its step. If steps may be repeated, shortens the sweep to
    /// this part, otherwise repeats `fmi2DoStep` until the slave reaches the end of the step.
    #[cold]
    fn finish_in_parts(
        &mut self,
        slave: usize,
        time: f64,
        size: f64,
        mut done: StepResult,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let end = time + size;
        let complete = end - time_rounding(end, size);
        let mut start = time;
        for _ in 0..PARTS {
            let (reached, terminated) = match done {
                StepResult::Whole => return self.exchange.read(&mut self.system, slave, end),
                StepResult::Part { reached, terminated } => (reached, terminated),
                StepResult::Event { reached } if reached >= complete => {
                    self.instants.record_event(slave, end - self.grid.negligible(size, end));
                    return Ok(());
                }
                StepResult::Event { reached } => (reached, false),
            };
            if terminated {
                let is_first = !matches!(swept, Swept::Ended(first) if first.time <= reached);
                if is_first {
                    *swept = Swept::Ended(Ending { slave, time: reached });
                }
                return Ok(());
            }
            if reached <= start {
                break;
            }
            if reached >= complete {
                return self.exchange.read(&mut self.system, slave, end);
            }
            if self.repeats {
                *swept = match *swept {
                    Swept::Whole => Swept::Part(reached),
                    Swept::Part(least) => Swept::Part(least.min(reached)),
                    Swept::Ended(ending) => Swept::Ended(ending),
                };
                return Ok(());
            }
            start = reached;
            let (name, instance) = &mut self.system.slaves[slave];
            done =
                instance.do_step(start, size_between(start, end), true).map_err(|mut source| {
                    source.messages.push(ADVICE.to_owned());
                    call(name, start, source)
                })?;
        }
        let what = format!(
            "returned fmi2Discard and came to {} s only, on the way from {} to {} s",
            seconds(start),
            seconds(time),
            seconds(end)
        );
        let source = CallError {
            function: "fmi2DoStep",
            failure: Failure::InvalidAnswer(what),
            messages: Vec::new(),
        };
        Err(call(&self.system.slaves[slave].0, start, source))
    }
}
