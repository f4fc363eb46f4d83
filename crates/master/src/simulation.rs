//! The simulation: initialisation and communication steps.
//!
//! [`Simulation::step`] is the entry point. The submodules hold one part each: `initial`
//! (initialisation), `grid` (communication points), `sweep` (one step of all slaves), `adaptive`
//! and `control` (step control), `iterate` (coupling), `events`, `parallel` and `together` (threads
//! and background slaves), `checkpoint`.

mod adaptive;
mod capabilities;
mod checkpoint;
mod control;
mod events;
mod grid;
mod initial;
mod iterate;
mod parallel;
mod sweep;
mod together;

use fmu_description::Experiment;

use crate::algorithm::{Algorithm, Extrapolation, StepControl};
use crate::drive::{Drives, Scenario};
use crate::error::SystemError;
use crate::exchange::{Exchange, call};
use crate::order::{Order, by_direct_dependencies};
use crate::readout::Readout;
use crate::system::{Port, System};
use adaptive::Repetition;
use control::Control;
use events::Events;
use grid::{Grid, size_between};
use iterate::Coupled;
use parallel::Parallel;
use slave::{CallError, Failure};
use sweep::{Groups, SweepResult};
use together::any_in_background;

pub use checkpoint::Checkpoint;
use checkpoint::Origin;
pub use grid::EarlyEnd;
pub use iterate::Fallbacks;
pub(crate) use parallel::Task;

/// A running co-simulation of a [`System`].
pub struct Simulation {
    system: System,
    exchange: Exchange,
    drives: Drives,
    order: Order,
    grid: Grid,
    early_end: Option<EarlyEnd>,
    origin: Origin,
    control: Control,
    coupled: Option<Coupled>,
    repetition: Repetition,
    /// Whether steps may be repeated; every slave can then restore its state.
    repeats: bool,
    events: Option<Events>,
    groups: Groups,
    parallel: Option<Parallel>,
    /// For each slave: the number of communication steps in one of its steps, and the size in s of
    /// its current step, 0 if it makes none.
    multiples: Vec<u32>,
    sizes: Vec<f64>,
    /// Whether a sweep is a single pass over the slaves.
    passes: bool,
    /// Whether some slaves step in the background.
    background: bool,
    /// The slave that requested the end of the simulation, and the time in s.
    ended: Option<(usize, f64)>,
}

impl Simulation {
    /// Initialises all slaves of `system` at the start time and prepares stepping with `algorithm`.
    ///
    /// # Errors
    ///
    /// Returns an error if a time is invalid, if the algorithm needs a capability that an FMU
    /// lacks, if an FMU fails, or if an output is not finite.
    pub fn new(
        system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
    ) -> Result<Self, SystemError> {
        Self::with_scenario(system, algorithm, experiment, Scenario::default())
    }

    /// As [`Simulation::new`], with driven variables and faults on connections.
    ///
    /// # Errors
    ///
    /// Returns an error if [`Simulation::new`] does, or if a fault has no connection.
    pub fn with_scenario(
        system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
        scenario: Scenario,
    ) -> Result<Self, SystemError> {
        Self::start(system, algorithm, experiment, experiment.stop_time, scenario)
    }

    /// As [`Simulation::with_scenario`], with the stop time `stop`; the slaves receive the stop
    /// time of `experiment`.
    fn start(
        mut system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
        stop: Option<f64>,
        mut scenario: Scenario,
    ) -> Result<Self, SystemError> {
        algorithm.check(&system)?;
        let multiples = grid::multiples(&system, algorithm)?;
        let span = (experiment.start_time, stop);
        let (grid, early_end) = Grid::new(&system, algorithm.step, &multiples, span)?;
        let origin = Origin::new(&system, algorithm, experiment);
        let order = by_direct_dependencies(&system);
        initial::initialise(&mut system, experiment, &mut scenario)?;
        let algorithm = &capabilities::confirm_rollback(&mut system, algorithm);
        let mut exchange = capabilities::build_exchange(&mut system, algorithm);
        exchange.set_faults(&system, &scenario.faults)?;
        read_at_start(&mut system, &mut exchange, algorithm, experiment.start_time)?;
        scenario.drives.commit(experiment.start_time);
        let groups = Groups::new(&system, algorithm.method, &order);
        let control = Control::new(&system, &exchange.reals, algorithm)?;
        let coupled = Coupled::new(&system, &exchange.reals, algorithm, control.scale.clone());
        let background = any_in_background(&mut system);
        Ok(Self {
            passes: algorithm.jobs <= 1 && exchange.passes() && !background,
            background,
            system,
            exchange,
            drives: scenario.drives,
            order,
            grid,
            early_end,
            origin,
            control,
            coupled,
            repetition: Repetition::default(),
            repeats: algorithm.repeats(),
            events: Events::new(&algorithm.events),
            parallel: Parallel::new(algorithm.jobs, groups.len())?,
            groups,
            sizes: vec![0.0; multiples.len()],
            multiples,
            ended: None,
        })
    }

    /// Returns the time reached in s: `start + k H` for fixed steps; the last step ends at the stop
    /// time.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.grid.time
    }

    /// Whether the stop time is reached or an FMU requested the end.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.ended.is_some() || self.grid.is_finished()
    }

    /// Returns the FMU that requested the end of the simulation (`fmi2Terminated`).
    #[must_use]
    pub fn ended_by(&self) -> Option<&str> {
        self.ended.map(|(slave, _)| self.system.slaves[slave].0.as_str())
    }

    /// Returns the time in s at which an FMU requested the end.
    ///
    /// It is later than [`Simulation::time`] if other FMUs have passed it and cannot restore their
    /// state. The run then ends at the last communication point, and the FMUs have values at
    /// different times.
    #[must_use]
    pub fn ended_at(&self) -> Option<f64> {
        self.ended.map(|(_, time)| time)
    }

    /// Returns the reason if the run ends before its stop time.
    #[must_use]
    pub fn early_end(&self) -> Option<&EarlyEnd> {
        self.early_end.as_ref()
    }

    /// Returns the slaves that step every several communication steps.
    pub(crate) fn slow_slaves(&self) -> impl Iterator<Item = usize> {
        (0..self.multiples.len()).filter(|&slave| self.multiples[slave] != 1)
    }

    /// Returns start and end in s of the current step of a slave that is ahead of
    /// [`Simulation::time`].
    pub(crate) fn current_step(&self, slave: usize) -> Option<(f64, f64)> {
        self.exchange.reals.step_ahead(slave, self.grid.time)
    }

    /// Returns the order in which the slaves step.
    #[must_use]
    pub fn order(&self) -> &Order {
        &self.order
    }

    /// Returns the system, to read values between steps.
    pub fn system(&mut self) -> &mut System {
        &mut self.system
    }

    /// Creates a readout of `ports` for [`Simulation::read`].
    #[must_use]
    pub fn readout(&self, ports: &[Port]) -> Readout {
        let mut readout = Readout::new(&self.system, ports);
        readout.follow(&self.drives, &self.system, ports);
        readout
    }

    /// Reads the values at the time reached. A driven variable has the value of its signal at this
    /// time, which its FMU receives at the start of the next step.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a read.
    pub fn read(&mut self, readout: &mut Readout) -> Result<(), SystemError> {
        readout.read(&mut self.system, self.grid.time)?;
        readout.apply(&mut self.drives, self.grid.time);
        Ok(())
    }

    /// Makes one communication step.
    ///
    /// With fixed steps and without repetition this is one sweep over the slaves. Otherwise the
    /// step ends where the step control or an event requires it. At the end, faults and driven
    /// variables record the new communication point.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU does not complete the step or an output is not finite. Some
    /// slaves are then at the start of the step and others at its end.
    pub fn step(&mut self) -> Result<(), SystemError> {
        let start = self.grid.time;
        let swept = match (self.events.take(), self.control.kind) {
            (None, StepControl::Fixed) if !self.repeats => {
                let (end, size) = self.grid.next();
                let swept = self.sweep(self.grid.time, size, true)?;
                self.grid.advance(end);
                swept
            }
            (None, _) => {
                let (end, swept) = self.step_to(self.grid.time, self.planned_end())?;
                self.grid.reach(end);
                swept
            }
            (Some(mut events), _) => {
                let done = self.step_to_event(&mut events);
                self.events = Some(events);
                done?
            }
        };
        if let Some((slave, reached)) = swept.terminated {
            self.end_early(slave, (start, reached));
        }
        if self.grid.time > start {
            self.exchange.commit(self.grid.time);
            self.drives.commit(self.grid.time);
        }
        let varies = self.control.kind != StepControl::Fixed || self.events.is_some();
        if varies && !self.is_finished() {
            let (time, stop) = (self.grid.time, self.grid.stop());
            self.control.check_pace(time, time - start, stop)?;
        }
        Ok(())
    }

    /// Ends the run because a slave requested it at the time `reached` in the step from `start`.
    /// The time of the run becomes `reached` if all slaves could end there, otherwise `start`.
    #[cold]
    fn end_early(&mut self, slave: usize, (start, reached): (f64, f64)) {
        self.ended = Some((slave, reached));
        let alone = self.system.slaves.len() == 1;
        self.grid.time = if alone || self.repeats { reached } else { start };
    }

    /// Returns the planned end of the next step. A step of variable size ends where a signal or a
    /// fault starts, ends or has a kink.
    fn planned_end(&self) -> f64 {
        if self.control.kind == StepControl::Fixed {
            return self.grid.next().0;
        }
        let end = self.grid.end_of(self.control.size);
        let least = self.grid.time + 1e-9 * self.control.size;
        let breaks = [self.drives.next_break(least), self.exchange.next_break(least)];
        breaks.into_iter().flatten().fold(end, f64::min)
    }

    /// Attempts a step from `time` to `end`; returns the time actually reached.
    fn step_to(&mut self, time: f64, end: f64) -> Result<(f64, SweepResult), SystemError> {
        if self.repeats {
            let mut repetition = std::mem::take(&mut self.repetition);
            let done = self.controlled_step(&mut repetition, time, end);
            self.repetition = repetition;
            return done;
        }
        let size = size_between(time, end);
        let swept = self.sweep(time, size, true)?;
        self.control.update_size(&self.exchange.reals, size);
        Ok((end, swept))
    }

    fn step_to_event(&mut self, events: &mut Events) -> Result<SweepResult, SystemError> {
        let time = self.grid.time;
        let planned_end = self.planned_end();
        let next = self.next_event(events, time, planned_end)?;
        let limit = next.unwrap_or(planned_end);
        self.read_crossings(events, time)?;
        let (mut end, mut swept) = self.step_to(time, limit)?;
        if swept.terminated.is_some() {
            self.grid.reach(end);
            return Ok(swept);
        }
        let crossing = self.locate(events, time, end)?;
        let happened = crossing.is_some() || (next.is_some() && end >= limit);
        if let Some(crossing) = crossing {
            (end, swept) = crossing;
        }
        if happened {
            self.exchange.reals.clear_history();
            self.control.clear_history();
        }
        self.grid.reach(end);
        Ok(swept)
    }

    /// Calls [`crate::Slave::free`] of every slave, even if one fails; call it after
    /// [`Simulation::terminate`].
    ///
    /// # Errors
    ///
    /// Returns the first failure.
    pub fn free(&mut self) -> Result<(), SystemError> {
        let time = self.grid.time;
        let mut first = Ok(());
        for (name, slave) in &mut self.system.slaves {
            let done = slave.free().map_err(|source| call(name, time, source));
            first = first.and(done);
        }
        first
    }

    /// Ends the simulation: calls `fmi2Terminate` of every slave, even if one fails.
    ///
    /// # Errors
    ///
    /// Returns the first failure.
    pub fn terminate(&mut self) -> Result<(), SystemError> {
        let time = self.grid.time;
        let mut first = Ok(());
        for (name, slave) in &mut self.system.slaves {
            match slave.terminate() {
                // A slave without `fmi2Terminate` needs no end.
                Ok(()) | Err(CallError { failure: Failure::Missing, .. }) => {}
                Err(source) => first = first.and(Err(call(name, time, source))),
            }
        }
        first
    }
}

/// Reads all connected outputs at the start time `start` in s and clears their history.
fn read_at_start(
    system: &mut System,
    exchange: &mut Exchange,
    algorithm: &Algorithm,
    start: f64,
) -> Result<(), SystemError> {
    for slave in 0..system.slaves.len() {
        exchange.read(system, slave, start)?;
    }
    if algorithm.extrapolation == Extrapolation::Quadratic {
        exchange.derive_at_start(system, (start, algorithm.step))?;
    }
    exchange.reals.clear_history();
    exchange.commit(start);
    Ok(())
}

// A simulation can move to another thread.
const _: () = {
    const fn is_send<T: Send>() {}
    is_send::<Simulation>();
};
