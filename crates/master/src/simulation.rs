//! The simulation: initialisation and communication steps.
//!
//! [`Simulation::step`] is the entry point. It reads from the top: [`SizeControl`] plans a step,
//! [`Events`] shorten it, [`Coupler`] repeats it until inputs and outputs agree, and [`Engine`]
//! makes each sweep over the slaves, and iterates the events at the end of the step.

mod change;
mod checkpoint;

use fmu_description::Experiment;

use crate::algorithm::{Algorithm, Extrapolation, StepControl};
use crate::capabilities;
use crate::coupling::{Coupler, Fallbacks, Iterated};
use crate::drive::Scenario;
use crate::engine::{Ending, Engine, Instants, Parts};
use crate::error::{SystemError, call};
use crate::events::Events;
use crate::exchange::Exchange;
use crate::grid::{self, EarlyEnd, Grid};
use crate::initial::initialise;
use crate::order::{Order, by_direct_dependencies};
use crate::readout::Readout;
use crate::step_control::{Pace, SizeControl};
use crate::system::{Port, System};
use slave::{CallError, Failure, Slave};

use checkpoint::Origin;
pub use checkpoint::{Checkpoint, KeptState};

/// A running co-simulation of a [`System`].
pub struct Simulation {
    engine: Engine,
    coupler: Coupler,
    control: SizeControl,
    events: Option<Events>,
    /// The check that variable steps do not become too small to reach the stop time.
    pace: Option<Pace>,
    order: Order,
    early_end: Option<EarlyEnd>,
    origin: Origin,
    /// The latest end in s of a step that was attempted.
    attempted: f64,
    /// The slave that requested the end of the simulation.
    ended: Option<Ending>,
}

impl Simulation {
    /// Initialises all slaves of `system` at the start time and prepares stepping with `algorithm`.
    ///
    /// # Errors
    ///
    /// Returns an error if a time is invalid, if [`Algorithm::check`] does, if an FMU fails or loses a
    /// setting, if an output is not finite, or if the initial values or events do not settle.
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
    /// Returns an error if [`Simulation::new`] does, if a fault has no connection or is on a String, a binary or a
    /// clock, or if an input has two chains of faults.
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
        let start = experiment.start_time;
        let (grid, early_end) = Grid::new(&system, algorithm.step, &multiples, start, stop)?;
        let origin = Origin::new(&system, algorithm, experiment);
        let order = by_direct_dependencies(&system);
        system.discrete = algorithm.discrete.iter().copied().collect();
        system.hand_over_events(algorithm.repeats(), experiment.start_time)?;
        scenario.limit_faults(&system);
        initialise(&mut system, experiment, &mut scenario, algorithm.allow_nan)?;
        let (instants, ending) = first_instant(&mut system, &mut scenario, algorithm, experiment)?;
        let algorithm = &capabilities::confirm_rollback(&mut system, algorithm);
        if !algorithm.repeats() {
            system.hand_over_events(false, experiment.start_time)?;
        }
        let mut exchange = capabilities::build_exchange(&mut system, algorithm);
        exchange.set_faults(&system, &scenario.faults)?;
        read_at_start(&mut system, &mut exchange, algorithm, experiment.start_time)?;
        scenario.drives.commit(experiment.start_time);
        let drives = scenario.drives;
        let engine = Engine::new(system, exchange, drives, instants, grid, &order, algorithm)?;
        let control = SizeControl::new(&engine.system, &engine.exchange.reals, algorithm)?;
        let events = Events::new(&algorithm.events);
        let varies = algorithm.control != StepControl::Fixed || events.is_some();
        Ok(Self {
            coupler: Coupler { iterated: Iterated::new(&engine, algorithm, control.scale.clone()) },
            engine,
            control,
            events,
            pace: varies.then(|| Pace::new(algorithm.smallest_step)),
            order,
            early_end,
            origin,
            attempted: experiment.start_time,
            ended: ending,
        })
    }

    /// Returns the time reached in s: `start + k H` for fixed steps, or an event or a jump in between; the
    /// last step ends at the stop time.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.engine.grid.time
    }

    /// Whether the step control or sources of events ([`Algorithm::events`]) choose the ends of steps.
    #[must_use]
    pub fn has_varying_steps(&self) -> bool {
        self.pace.is_some()
    }

    /// Whether the stop time is reached or an FMU requested the end.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.ended.is_some() || self.engine.grid.is_finished()
    }

    /// Returns the name of the FMU that requested the end of the simulation (`fmi2Terminated`).
    #[must_use]
    pub fn ended_by(&self) -> Option<&str> {
        self.ended.map(|ending| self.engine.system.slaves[ending.slave].0.as_str())
    }

    /// Returns the time in s at which an FMU requested the end.
    ///
    /// After a request within a step, it is later than [`Simulation::time`] if there are other FMUs and the
    /// algorithm does not repeat steps. The run then ends at the start of the step, and the FMUs have values at
    /// different times.
    #[must_use]
    pub fn ended_at(&self) -> Option<f64> {
        self.ended.map(|ending| ending.time)
    }

    /// Returns the reason if the run ends before its stop time.
    #[must_use]
    pub fn early_end(&self) -> Option<&EarlyEnd> {
        self.early_end.as_ref()
    }

    /// Returns the slaves whose steps cover several communication steps.
    pub(crate) fn slow_slaves(&self) -> impl Iterator<Item = usize> {
        self.engine.slow_slaves()
    }

    /// Returns start and end in s of the current step of a slave that is ahead of
    /// [`Simulation::time`]; `None` if the slave is not ahead.
    pub(crate) fn current_step(&self, slave: usize) -> Option<(f64, f64)> {
        self.engine.exchange.reals.step_ahead(slave, self.engine.grid.time)
    }

    /// Returns the order in which the slaves step.
    #[must_use]
    pub fn order(&self) -> &Order {
        &self.order
    }

    /// Returns the system, to read values between steps.
    pub fn system(&mut self) -> &mut System {
        &mut self.engine.system
    }

    /// Creates a readout of `ports` for [`Simulation::read`].
    #[must_use]
    pub fn readout(&self, ports: &[Port]) -> Readout {
        let mut readout = Readout::new(&self.engine.system, ports);
        self.follow(&mut readout);
        readout
    }

    /// Lets `readout`, which [`Simulation::readout`] has created, follow the present driven variables.
    /// Call it after [`Simulation::change_scenario`].
    pub fn follow(&self, readout: &mut Readout) {
        readout.follow(&self.engine.drives, &self.engine.system);
    }

    /// Reads the values at the time reached. A driven variable has the value of its signal at this
    /// time, which its FMU receives at the start of the next step.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a read.
    pub fn read(&mut self, readout: &mut Readout) -> Result<(), SystemError> {
        readout.read(&mut self.engine.system, self.engine.grid.time)?;
        readout.apply(&mut self.engine.drives, self.engine.grid.time);
        Ok(())
    }

    /// Makes one communication step. Does nothing if the run is finished.
    ///
    /// With fixed steps and without repetition this is one sweep over the slaves. Otherwise the
    /// step ends where the step control or an event requires it. At the end, faults and driven
    /// variables record the new communication point.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU fails or does not complete the step, if an output or input is not finite, if the
    /// iteration or the step control fails, or if events do not settle. Some slaves may then be at the start of the
    /// step and others at the end.
    pub fn step(&mut self) -> Result<(), SystemError> {
        if self.is_finished() {
            return Ok(());
        }
        let Self { engine, coupler, control, events, .. } = self;
        let start = engine.grid.time;
        let planned = control.plan(engine);
        self.attempted = self.attempted.max(planned.end);
        let step = match events {
            None => control.step(engine, coupler, planned)?,
            Some(events) => events.step(engine, coupler, control, planned)?,
        };
        engine.grid.reach(step.end);
        if let Some(ending) = step.ending {
            self.end_early(start, ending);
        }
        if self.time() > start && self.ended.is_none() {
            let settled = self.engine.settle()?;
            self.ended = settled.ending;
            if settled.jumped {
                self.control.clear_history();
            }
        }
        if self.time() > start {
            self.engine.commit();
        }
        match &mut self.pace {
            Some(pace) if self.ended.is_none() && !self.engine.grid.is_finished() => {
                pace.check(self.engine.grid.time - start, &self.engine.grid)
            }
            _ => Ok(()),
        }
    }

    /// Ends the run because a slave requested it in the step from `start`. The time of the run becomes the time of the
    /// request if all slaves have reached it, otherwise `start`.
    #[cold]
    fn end_early(&mut self, start: f64, ending: Ending) {
        self.ended = Some(ending);
        let is_single = self.engine.system.slaves.len() == 1;
        self.engine.grid.time = if is_single || self.engine.repeats { ending.time } else { start };
    }

    /// Returns the count of steps whose iteration failed; `None` without iteration.
    #[must_use]
    pub fn fallbacks(&self) -> Option<&Fallbacks> {
        self.coupler.iterated.as_ref().map(|iterated| &iterated.fallbacks)
    }

    /// Calls [`crate::Slave::free`] of every slave, even if one fails; call it after
    /// [`Simulation::terminate`].
    ///
    /// # Errors
    ///
    /// Returns the first failure.
    pub fn free(&mut self) -> Result<(), SystemError> {
        self.perform_all(|slave| slave.free())
    }

    /// Ends the simulation: calls `fmi2Terminate` of every slave, even if one fails.
    ///
    /// # Errors
    ///
    /// Returns the first failure.
    pub fn terminate(&mut self) -> Result<(), SystemError> {
        self.perform_all(|slave| match slave.terminate() {
            // A slave without `fmi2Terminate` needs no end.
            Err(CallError { failure: Failure::Missing, .. }) => Ok(()),
            done => done,
        })
    }

    /// Performs `action` with every slave, even if one fails; returns the first failure.
    fn perform_all(
        &mut self,
        action: fn(&mut dyn Slave) -> Result<(), CallError>,
    ) -> Result<(), SystemError> {
        let time = self.engine.grid.time;
        let mut first = Ok(());
        for (name, slave) in &mut self.engine.system.slaves {
            first = first.and(action(slave.as_mut()).map_err(|source| call(name, time, source)));
        }
        first
    }
}

/// Reads all connected outputs at the start time `start` in s, clears their history and records the
/// communication point in faults.
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
        exchange.derive_at_start(system, start, algorithm.step)?;
    }
    exchange.accept_at_events(system.slaves.len(), start);
    exchange.reals.clear_history();
    exchange.commit(start);
    Ok(())
}

/// Iterates the events at the start time; returns the slaves whose events the master handles, and the request of one of
/// them for the end of the simulation, if any.
fn first_instant(
    system: &mut System,
    scenario: &mut Scenario,
    algorithm: &Algorithm,
    experiment: &Experiment,
) -> Result<(Instants, Option<Ending>), SystemError> {
    let mut instants = Instants::new(system);
    if instants.is_empty() {
        return Ok((instants, None));
    }
    let mut exchange = Exchange::new(system, algorithm, &[]);
    exchange.set_faults(system, &scenario.faults)?;
    for slave in 0..system.slaves.len() {
        exchange.read_in_event(system, slave, experiment.start_time)?;
    }
    exchange.commit(experiment.start_time);
    let mut parts = Parts { system, exchange: &mut exchange, drives: &mut scenario.drives };
    let end = instants.iterate(&mut parts, experiment.start_time)?;
    Ok((instants, end.ending))
}

// A simulation can move to another thread.
const _: () = {
    const fn is_send<T: Send>() {}
    is_send::<Simulation>();
};
