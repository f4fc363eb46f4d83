//! The master algorithm at work: initialisation and communication steps.

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
use sweep::{Groups, Swept};
use together::any_in_background;

pub use checkpoint::Checkpoint;
use checkpoint::Origin;
pub use grid::EarlyEnd;
pub use iterate::Fallbacks;
pub(crate) use parallel::Task;

/// A system in simulation.
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
    /// Steps are repeated: every slave can go back.
    repeats: bool,
    events: Option<Events>,
    groups: Groups,
    parallel: Option<Parallel>,
    /// For each slave the steps of the grid that it makes at once, and the size of the step that it
    /// makes now, 0 for none.
    multiples: Vec<u32>,
    sizes: Vec<f64>,
    /// Whether a sweep is one pass over the slaves.
    passes: bool,
    /// Whether some slaves step in the background.
    background: bool,
    /// The slave that asked for the end of the simulation, and when.
    ended: Option<(usize, f64)>,
}

impl Simulation {
    /// Initialises all slaves of `system` at the start time, to be advanced by `algorithm`.
    ///
    /// # Errors
    ///
    /// Where times make no sense, the algorithm asks for what an FMU cannot do, an FMU fails, or
    /// an output is not finite.
    pub fn new(
        system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
    ) -> Result<Self, SystemError> {
        Self::with_scenario(system, algorithm, experiment, Scenario::default())
    }

    /// As [`Simulation::new`], with variables that follow signals and faults on connections.
    ///
    /// # Errors
    ///
    /// Those of [`Simulation::new`]; where a fault is on no connection.
    pub fn with_scenario(
        system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
        scenario: Scenario,
    ) -> Result<Self, SystemError> {
        Self::begin(system, algorithm, experiment, experiment.stop_time, scenario)
    }

    /// As [`Simulation::with_scenario`], to end at the time `stop`; the slaves are told the one of
    /// `experiment`.
    fn begin(
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
        let mut exchange = capabilities::exchange(&mut system, algorithm);
        exchange.set_faults(&system, &scenario.faults)?;
        read_at_start(&mut system, &mut exchange, algorithm, experiment.start_time)?;
        scenario.drives.commit(experiment.start_time);
        let groups = Groups::new(&system, algorithm.sweep, &order);
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

    /// Time reached in s: start + k H where steps are fixed, the last one ending at the stop time.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.grid.time
    }

    /// Whether the stop time is reached, or an FMU asked for the end.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.ended.is_some() || self.grid.is_finished()
    }

    /// The FMU that asked for the end of the simulation (`fmi2Terminated`).
    #[must_use]
    pub fn ended_by(&self) -> Option<&str> {
        self.ended.map(|(slave, _)| self.system.slaves[slave].0.as_str())
    }

    /// The time in s for which it asked. It is later than [`Simulation::time`] where other FMUs have
    /// gone beyond it and cannot go back: the run then ends at the last communication point, and
    /// what the FMUs give is of different times.
    #[must_use]
    pub fn ended_at(&self) -> Option<f64> {
        self.ended.map(|(_, time)| time)
    }

    /// Why the run ends before its stop time, if it does.
    #[must_use]
    pub fn early_end(&self) -> Option<&EarlyEnd> {
        self.early_end.as_ref()
    }

    /// The slaves that make several steps at once.
    pub(crate) fn slow_slaves(&self) -> impl Iterator<Item = usize> {
        (0..self.multiples.len()).filter(|&slave| self.multiples[slave] != 1)
    }

    /// Begin and end in s of the last step of a slave that has gone beyond [`Simulation::time`], as it
    /// makes several steps at once.
    pub(crate) fn step_beyond(&self, slave: usize) -> Option<(f64, f64)> {
        self.exchange.reals.beyond(slave, self.grid.time)
    }

    /// The order of stepping.
    #[must_use]
    pub fn order(&self) -> &Order {
        &self.order
    }

    /// The system, for reading values between steps.
    pub fn system(&mut self) -> &mut System {
        &mut self.system
    }

    /// A readout of `ports` for [`Simulation::read`].
    #[must_use]
    pub fn readout(&self, ports: &[Port]) -> Readout {
        let mut readout = Readout::new(&self.system, ports);
        readout.follow(&self.drives, &self.system, ports);
        readout
    }

    /// Reads the values of the time reached. A variable that follows a signal has the signal's value
    /// at that time, which its FMU is given for the next step.
    ///
    /// # Errors
    ///
    /// Where an FMU refuses.
    pub fn read(&mut self, readout: &mut Readout) -> Result<(), SystemError> {
        readout.read(&mut self.system, self.grid.time)?;
        readout.apply(&mut self.drives, self.grid.time);
        Ok(())
    }

    /// One communication step.
    ///
    /// # Errors
    ///
    /// Where an FMU does not finish the step or an output is not finite; the simulation then
    /// stands at the begin of the step in some slaves and at its end in others.
    pub fn step(&mut self) -> Result<(), SystemError> {
        let begin = self.grid.time;
        let swept = match (self.events.take(), self.control.kind) {
            (None, StepControl::Fixed) if !self.repeats => {
                let (end, size) = self.grid.next();
                let swept = self.sweep(self.grid.time, size, true)?;
                self.grid.advance(end);
                swept
            }
            (None, _) => {
                let (end, swept) = self.stretch(self.grid.time, self.planned())?;
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
            self.end_early(slave, (begin, reached));
        }
        if self.grid.time > begin {
            self.exchange.commit(self.grid.time);
            self.drives.commit(self.grid.time);
        }
        let varies = self.control.kind != StepControl::Fixed || self.events.is_some();
        if varies && !self.is_finished() {
            let (time, stop) = (self.grid.time, self.grid.stop());
            self.control.check_pace(time, time - begin, stop)?;
        }
        Ok(())
    }

    /// A slave asked for the end at the time that it reached in the step from `begin`. The time of the
    /// run is then that of all slaves: the one reached where all could end there, else `begin`.
    #[cold]
    fn end_early(&mut self, slave: usize, (begin, reached): (f64, f64)) {
        self.ended = Some((slave, reached));
        let alone = self.system.slaves.len() == 1;
        self.grid.time = if alone || self.repeats { reached } else { begin };
    }

    /// Where the next step would end; steps that are not fixed end where a signal bends and where a
    /// fault begins or ends.
    fn planned(&self) -> f64 {
        if self.control.kind == StepControl::Fixed {
            return self.grid.next().0;
        }
        let end = self.grid.end_of(self.control.size);
        let least = self.grid.time + 1e-9 * self.control.size;
        let breaks = [self.drives.next_break(least), self.exchange.next_break(least)];
        breaks.into_iter().flatten().fold(end, f64::min)
    }

    /// A step from `time` to `end` or, where it cannot or must not be as long, not as far.
    fn stretch(&mut self, time: f64, end: f64) -> Result<(f64, Swept), SystemError> {
        if self.repeats {
            let mut repetition = std::mem::take(&mut self.repetition);
            let done = self.controlled(&mut repetition, time, end);
            self.repetition = repetition;
            return done;
        }
        let size = size_between(time, end);
        let swept = self.sweep(time, size, true)?;
        self.control.look_back(&self.exchange.reals, size);
        Ok((end, swept))
    }

    fn step_to_event(&mut self, events: &mut Events) -> Result<Swept, SystemError> {
        let time = self.grid.time;
        let planned = self.planned();
        let next = self.next_event(events, time, planned)?;
        let limit = next.unwrap_or(planned);
        self.watch(events, time)?;
        let (mut end, mut swept) = self.stretch(time, limit)?;
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
            self.exchange.reals.forget();
            self.control.forget();
        }
        self.grid.reach(end);
        Ok(swept)
    }

    /// After [`Simulation::terminate`]: [`crate::Slave::free`] of every slave, all of them even where
    /// one fails.
    ///
    /// # Errors
    ///
    /// The first failure.
    pub fn free(&mut self) -> Result<(), SystemError> {
        let time = self.grid.time;
        let mut first = Ok(());
        for (name, slave) in &mut self.system.slaves {
            let done = slave.free().map_err(|source| call(name, time, source));
            first = first.and(done);
        }
        first
    }

    /// Ends the simulation: `fmi2Terminate` of every slave, all of them even where one fails.
    ///
    /// # Errors
    ///
    /// The first failure.
    pub fn terminate(&mut self) -> Result<(), SystemError> {
        let time = self.grid.time;
        let mut first = Ok(());
        for (name, slave) in &mut self.system.slaves {
            match slave.terminate() {
                // There is nothing to end.
                Ok(()) | Err(CallError { failure: Failure::Missing, .. }) => {}
                Err(source) => first = first.and(Err(call(name, time, source))),
            }
        }
        first
    }
}

/// Reads all connected outputs at the time `start` in s, which have no past.
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
    exchange.reals.forget();
    exchange.commit(start);
    Ok(())
}

// Threads and other languages may hold one.
const _: () = {
    const fn is_send<T: Send>() {}
    is_send::<Simulation>();
};
