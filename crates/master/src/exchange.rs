//! Exchange of connected values: gathers the inputs of a slave, steps the slave, reads its outputs.
//!
//! The arrays are laid out once, so that stepping allocates nothing. For each step of a slave,
//! [`Exchange::shift`] makes the last end values the start values, [`Exchange::gather`] computes
//! the inputs (extrapolation, transformation, fault), and [`Exchange::advance`] sets them, calls
//! `fmi2DoStep` and reads the outputs.

mod channels;
mod discrete;
mod extrapolation;
mod faulty;
mod instant;
mod layout;
mod multirate;
mod pass;
mod reals;
mod repeat;
mod start;
mod tasks;
mod trace;

use std::collections::HashSet;

use fmu_description::number::seconds;
use serde::{Deserialize, Serialize};

use crate::algorithm::Algorithm;
use crate::error::{SystemError, contradiction};
use crate::fault::FaultChain;
use crate::limits::Watch;
use crate::signal_type::Way;
use crate::system::{Connection, Port, System};
use channels::{Channels, ChannelsState};
use instant::Ticks;
pub(crate) use layout::Refusal;
pub(crate) use reals::{Reals, Trace};
use slave::{CallError, CommunicationStep, Slave, StepResult, ValueType};
pub(crate) use tasks::Task;

/// All connections of a system with the current values of their outputs.
pub(crate) struct Exchange {
    pub(crate) reals: Reals,
    /// The connections whose values are held during a step; their inputs are set before the step.
    held: Channels,
    /// The connections to discrete and clocked inputs of slaves whose events the master handles. These inputs are
    /// set in event mode only.
    at_events: Channels,
    ticks: Ticks,
    allow_nan: bool,
    /// Whether any connection has a fault.
    pub(crate) is_faulty: bool,
    watch: Watch,
}

/// The values of all connections that change during the run, saved to repeat a step or for a checkpoint.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Values {
    reals: Trace,
    held: ChannelsState,
    at_events: ChannelsState,
}

impl Values {
    /// Returns the numbers of connected variables, by the way in which their values pass and by type.
    pub(crate) fn lengths(&self) -> ([usize; 7], [[[usize; 3]; 5]; 2]) {
        (self.reals.lengths(), [&self.held, &self.at_events].map(ChannelsState::lengths))
    }
}

impl Exchange {
    /// Lays out the connections of `system`. `refusing` lists for each slave the derivatives that this slave refuses;
    /// empty if no slave refuses any.
    pub(crate) fn new(system: &System, algorithm: &Algorithm, refusing: &[Refusal]) -> Self {
        let reals = Reals::new(system, algorithm, refusing);
        let to_reals: Vec<Port> =
            reals.layout.from_integers.iter().map(|(port, _)| *port).collect();
        let by_way = |way| -> Vec<&Connection> {
            system
                .connections
                .iter()
                .filter(|connection| Way::of(system, connection) == way)
                .collect()
        };
        // The held connections also read the Integer outputs that are connected to Reals.
        let held = Channels::new(system, &by_way(Way::Held), &to_reals);
        let at_events = Channels::new(system, &by_way(Way::AtEvents), &[]);
        let ticks = Ticks::new(system, &by_way(Way::Tick));
        let watch = Watch::new(system, |port| reals.output(port));
        let allow_nan = algorithm.allow_nan;
        Self { reals, held, at_events, ticks, allow_nan, is_faulty: false, watch }
    }

    /// Puts faults on connections; each fault is given with the input of its connection. Returns an error, and changes
    /// no fault, if an input has no connection, if it is a String, a binary or a clock that ticks in event mode, or if
    /// an input occurs twice.
    pub(crate) fn set_faults(
        &mut self,
        system: &System,
        faults: &[(Port, FaultChain)],
    ) -> Result<(), SystemError> {
        let wrong = faults.iter().find(|(input, _)| !carries_numbers(system, *input));
        if let Some((input, _)) = wrong {
            return Err(contradiction(format!(
                "{} has a fault, expected a connected input that is no String, no binary and no \
                 clock",
                system.name(*input)
            )));
        }
        let mut inputs = HashSet::new();
        if let Some((input, _)) = faults.iter().find(|(input, _)| !inputs.insert(*input)) {
            return Err(contradiction(format!(
                "{} has two chains of faults, expected one with all its faults",
                system.name(*input)
            )));
        }
        for (input, fault) in faults {
            let _ = self.reals.set_fault(*input, fault)
                || self.held.set_fault(*input, fault)
                || self.at_events.set_fault(*input, fault);
        }
        self.is_faulty = !faults.is_empty();
        Ok(())
    }

    /// Returns the faults on the connection to an input.
    pub(crate) fn fault(&self, input: Port) -> Option<&FaultChain> {
        self.faults().find(|(known, _)| *known == input).map(|(_, fault)| fault)
    }

    /// Records the undisturbed values in the faults, and checks the limits of inputs; the communication point `time` is
    /// final.
    #[inline]
    pub(crate) fn commit(&mut self, time: f64) {
        if !self.watch.is_empty() {
            let (held, at_events) = (&self.held.integers, &self.at_events.integers);
            let integer = |port| held.value(port).or_else(|| at_events.value(port)).copied();
            self.watch.check(time, self.reals.outputs(), integer);
        }
        if self.is_faulty {
            self.reals.commit(time);
            let ahead = |slave| self.reals.is_ahead(slave, time);
            self.held.commit(time, &ahead);
            self.at_events.commit(time, &ahead);
        }
    }

    /// Returns the first time after `after`, both in s, at which a fault on a connection starts or
    /// ends.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        if !self.is_faulty {
            return None;
        }
        self.faults().filter_map(|(_, fault)| fault.next_break(after)).reduce(f64::min)
    }

    /// Iterates over the faults, each with the input of its connection.
    pub(crate) fn faults(&self) -> impl Iterator<Item = (Port, &FaultChain)> {
        self.reals.faults().chain(self.held.faults()).chain(self.at_events.faults())
    }

    /// Prepares a step of `slave` from `time` over `size`: the last end values become the start
    /// values.
    pub(crate) fn shift(&mut self, slave: usize, time: f64, size: f64) {
        self.reals.shift(slave, time, size);
        if self.reals.multirate {
            self.held.shift(slave);
            self.at_events.shift(slave);
        }
    }

    /// Computes the inputs of `slave` for a step from `time` over `size`.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, size: f64) {
        self.reals.gather(slave, time, size);
        if !self.held.is_empty {
            let ahead = |source| {
                self.reals.is_ahead(source, self.reals.source_time(slave, source, time, size))
            };
            self.held.gather(slave, time, &ahead);
        }
    }

    /// Sets the gathered inputs of the slave at `position`, steps it and reads its outputs.
    #[inline]
    pub(crate) fn advance(
        &mut self,
        system: &mut System,
        position: usize,
        step: CommunicationStep,
    ) -> Result<StepResult, SystemError> {
        system.perform(position, step.time, |slave| {
            self.set_held(position, slave)?;
            let done = slave.advance(&mut self.reals.request(position, step))?;
            self.reals.trace.spans[position].stepped = true;
            self.read_discrete(position, slave).map(|()| done)
        })
    }

    /// Sets the inputs of a background slave and starts its step; does nothing for other slaves.
    pub(crate) fn start(
        &mut self,
        system: &mut System,
        position: usize,
        step: CommunicationStep,
    ) -> Result<(), SystemError> {
        system.perform(position, step.time, |slave| {
            if slave.in_background().is_some() {
                self.set_held(position, slave)?;
            }
            match slave.in_background() {
                Some(slave) => slave.begin_advance(&self.reals.request(position, step)),
                None => Ok(()),
            }
        })
    }

    /// Waits for the step of a background slave and reads its outputs; steps any other slave with
    /// [`Exchange::advance`].
    pub(crate) fn finish(
        &mut self,
        system: &mut System,
        position: usize,
        step: CommunicationStep,
    ) -> Result<StepResult, SystemError> {
        if system.slaves[position].1.in_background().is_none() {
            return self.advance(system, position, step);
        }
        system.perform(position, step.time, |slave| {
            let done = slave::finish(slave, &mut self.reals.request(position, step))?;
            self.reals.trace.spans[position].stepped = true;
            self.read_discrete(position, slave).map(|()| done)
        })
    }

    /// Steps several slaves at once; returns their results in the order of `slaves`, or the first error
    /// in this order. `run` makes the steps that may run in another thread; `step` returns the step of
    /// each slave.
    pub(crate) fn advance_all(
        &mut self,
        system: &mut System,
        slaves: &[usize],
        step: &dyn Fn(usize) -> CommunicationStep,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Result<Vec<StepResult>, SystemError> {
        for &position in slaves {
            let time = step(position).time;
            system.perform(position, time, |slave| self.set_held(position, slave))?;
        }
        let results = self.reals.advance_all(system, slaves, step, run);
        // `collect` into a `Result` does not know the length, and would allocate several times.
        let mut steps = Vec::with_capacity(slaves.len());
        for (&position, result) in slaves.iter().zip(results) {
            steps.push(system.perform(position, step(position).time, |slave| {
                let done = result?;
                self.read_discrete(position, slave).map(|()| done)
            })?);
        }
        Ok(steps)
    }

    /// Whether [`Reals::pass`] can make a complete sweep.
    pub(crate) fn passes(&self) -> bool {
        self.held.is_empty && self.at_events.is_empty && self.reals.passes()
    }

    #[inline]
    fn set_held(&mut self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        if self.held.is_empty { Ok(()) } else { self.held.set(position, slave) }
    }

    /// Reads the connected outputs of the slave at `position` that are not extrapolated.
    #[inline]
    fn read_discrete(&mut self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        if !self.held.is_empty {
            self.held.read(position, slave)?;
            for &(port, output) in &self.reals.layout.from_integers {
                if let Some(&value) = self.held.integers.value(port) {
                    self.reals.trace.latest[output] = slave::to_real(value);
                }
            }
        }
        if self.at_events.is_empty { Ok(()) } else { self.at_events.read(position, slave) }
    }

    /// Reads all connected outputs, and their derivatives, of the slave at `position`.
    pub(crate) fn read(
        &mut self,
        system: &mut System,
        position: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        system.perform(position, time, |slave| {
            self.reals.read(position, slave)?;
            self.read_discrete(position, slave)
        })?;
        self.check_finite(system, position, time)
    }

    /// Checks that every connected Real output of the slave is finite; warns once for each output whose derivative is
    /// not finite.
    #[inline]
    pub(crate) fn check_finite(
        &mut self,
        system: &System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        if !self.reals.derivatives_are_finite(slave) {
            self.report_derivatives(system, slave, time);
        }
        self.check_value(system, time, || self.reals.not_finite(slave))
    }

    /// Warns about outputs of the slave whose derivative is not finite, once for each output.
    #[cold]
    fn report_derivatives(&mut self, system: &System, slave: usize, time: f64) {
        while let Some((port, value)) = self.reals.report_derivative(slave) {
            let name = system.name(port);
            tracing::warn!(
                "{name}: its output derivative is {value} at t = {} s; connections from {name} are \
                 held while it is not finite",
                seconds(time)
            );
        }
    }

    /// Checks that the gathered inputs of the slave are finite after transformations and faults.
    #[inline]
    pub(crate) fn check_inputs(
        &self,
        system: &System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        self.check_value(system, time, || self.reals.input_not_finite(slave))
    }

    /// Returns an error for the value that `wrong` finds, unless NaN and infinity are allowed.
    #[inline]
    fn check_value(
        &self,
        system: &System,
        time: f64,
        wrong: impl FnOnce() -> Option<(Port, f64)>,
    ) -> Result<(), SystemError> {
        if self.allow_nan {
            return Ok(());
        }
        match wrong() {
            None => Ok(()),
            Some((port, value)) => {
                Err(SystemError::NotFinite { name: system.name(port), value, time })
            }
        }
    }

    pub(crate) fn save(&self, values: &mut Values) {
        values.reals.copy(&self.reals.trace);
        self.held.save(&mut values.held);
        self.at_events.save(&mut values.at_events);
    }

    pub(crate) fn restore(&mut self, values: &Values) {
        self.reals.trace.copy(&values.reals);
        self.held.restore(&values.held);
        self.at_events.restore(&values.at_events);
    }
}

/// Whether a connection passes numbers or Booleans to `input`, so that it can have a fault.
fn carries_numbers(system: &System, input: Port) -> bool {
    let kind = ValueType::of(&system.variable(input).kind);
    !matches!(kind, ValueType::String | ValueType::Binary)
        && system
            .connections
            .iter()
            .any(|connection| connection.to == input && Way::of(system, connection) != Way::Tick)
}
