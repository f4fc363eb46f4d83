//! The master algorithm at work: initialisation and communication steps.

mod grid;
mod initial;
mod sweep;

use fmi2::Experiment;

use crate::algorithm::Algorithm;
use crate::error::SystemError;
use crate::exchange::{Exchange, call};
use crate::order::{Order, by_direct_dependencies};
use crate::system::System;
use grid::Grid;

/// A system in simulation.
pub struct Simulation {
    system: System,
    algorithm: Algorithm,
    exchange: Exchange,
    order: Order,
    grid: Grid,
    /// Slaves that have a step to make now, and for each the steps of the grid that it takes.
    due: Vec<bool>,
    multiples: Vec<u32>,
    /// The slave that asked for the end of the simulation.
    ended: Option<usize>,
}

impl Simulation {
    /// Initialises all slaves of `system` at the start time, to be advanced by `algorithm`.
    ///
    /// # Errors
    ///
    /// Where times make no sense, the algorithm asks for what an FMU cannot do, an FMU fails, or
    /// an output is not finite.
    pub fn new(
        mut system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
    ) -> Result<Self, SystemError> {
        algorithm.check(&system)?;
        let grid = Grid::new(&system, algorithm, experiment)?;
        let mut exchange = Exchange::new(&system, algorithm);
        let order = by_direct_dependencies(&system);
        initial::initialise(&mut system, experiment)?;
        for slave in 0..system.slaves.len() {
            exchange.read(&mut system, slave, experiment.start_time)?;
        }
        exchange.reals.forget();
        let count = system.slaves.len();
        let multiples = grid::multiples(&system, algorithm)?;
        Ok(Self {
            system,
            algorithm: algorithm.clone(),
            exchange,
            order,
            grid,
            due: vec![true; count],
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
        self.ended.map(|slave| self.system.slaves[slave].0.as_str())
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

    /// One communication step.
    ///
    /// # Errors
    ///
    /// Where an FMU does not finish the step or an output is not finite; the simulation then
    /// stands at the begin of the step in some slaves and at its end in others.
    pub fn step(&mut self) -> Result<(), SystemError> {
        let (end, size) = self.grid.next();
        let swept = self.sweep(self.grid.time, size, true)?;
        self.grid.advance(end);
        if let Some((slave, reached)) = swept.terminated {
            self.ended = Some(slave);
            self.grid.time = reached;
        }
        Ok(())
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
            let done = slave.terminate().map_err(|source| call(name, time, source));
            first = first.and(done);
        }
        first
    }
}
