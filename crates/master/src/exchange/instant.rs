//! The exchange within an instant, in event mode: discrete and clocked inputs, ticks of clocks, and the continuous
//! inputs of slaves in event mode.

use super::Exchange;
use crate::error::SystemError;
use crate::exchange::Reals;
use crate::system::{Connection, Port, System};
use slave::{CallError, Slave};

/// The connections between clocks.
#[derive(Debug, Default)]
pub(super) struct Ticks {
    sources: Vec<TickSource>,
    targets: Vec<TickTarget>,
}

/// The connected output clocks of a slave.
#[derive(Debug)]
struct TickSource {
    slave: usize,
    references: Vec<u32>,
    /// For each clock, nonzero if the clock ticks.
    flags: Vec<i32>,
}

/// A connected input clock.
#[derive(Debug)]
struct TickTarget {
    port: Port,
    reference: u32,
    /// The index of the [`TickSource`] from which ticks arrive.
    source: usize,
    /// The index of the output clock in this [`TickSource`].
    clock: usize,
    /// Whether the input clock has received the present tick.
    received: bool,
}

impl Ticks {
    pub(super) fn new(system: &System, connections: &[&Connection]) -> Self {
        let mut ticks = Self::default();
        for connection in connections {
            let from = system.variable(connection.from).value_reference;
            let slave = connection.from.slave;
            let known = ticks.sources.iter().position(|source| source.slave == slave);
            let number = known.unwrap_or_else(|| {
                let (references, flags) = (Vec::new(), Vec::new());
                ticks.sources.push(TickSource { slave, references, flags });
                ticks.sources.len() - 1
            });
            let source = &mut ticks.sources[number];
            let clock = source.references.iter().position(|known| *known == from);
            let clock = clock.unwrap_or_else(|| {
                source.references.push(from);
                source.flags.push(0);
                source.references.len() - 1
            });
            let reference = system.variable(connection.to).value_reference;
            ticks.targets.push(TickTarget {
                port: connection.to,
                reference,
                source: number,
                clock,
                received: false,
            });
        }
        ticks
    }

    /// Asks which clocks of `slave` tick.
    fn read(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let sources = self.sources.iter_mut().filter(|source| source.slave == slave);
        for TickSource { references, flags, .. } in sources {
            instance.get_boolean(references, flags)?;
        }
        Ok(())
    }

    /// Whether the source of `target` ticks and `target` has not received the tick.
    fn is_due(&self, target: &TickTarget) -> bool {
        !target.received && self.sources[target.source].flags[target.clock] != 0
    }

    /// Whether an input clock of `slave` is due.
    fn has_due(&self, slave: usize) -> bool {
        self.targets.iter().any(|target| target.port.slave == slave && self.is_due(target))
    }

    /// Makes the due input clocks of `slave` tick.
    fn deliver(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        for number in 0..self.targets.len() {
            let target = &self.targets[number];
            if target.port.slave == slave && self.is_due(target) {
                instance.set_boolean(&[target.reference], &[1])?;
                self.targets[number].received = true;
            }
        }
        Ok(())
    }

    /// Ends all ticks.
    fn end(&mut self) {
        self.sources.iter_mut().for_each(|source| source.flags.fill(0));
        self.targets.iter_mut().for_each(|target| target.received = false);
    }
}

impl Exchange {
    /// Reads the connected outputs of a slave, without derivatives, and its clocks.
    pub(crate) fn read_in_event(
        &mut self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        system.perform(slave, time, |instance| {
            self.ticks.read(slave, instance)?;
            self.reals.read_values(slave, instance)?;
            self.read_discrete(slave, instance)
        })
    }

    /// Computes the discrete and clocked inputs of `slave` at `time`. Returns whether there is a new value or a
    /// tick for them.
    pub(crate) fn gather_at_events(&mut self, slave: usize, time: f64) -> bool {
        if !self.at_events.is_empty {
            self.at_events.gather(slave, time, &|source| self.reals.is_ahead(source, time));
        }
        self.at_events.has_new(slave) || self.ticks.has_due(slave)
    }

    /// Sets the discrete and clocked inputs of `slave`, and makes its due clocks tick.
    pub(crate) fn set_at_events(
        &mut self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        system.perform(slave, time, |instance| {
            self.at_events.set(slave, instance)?;
            self.ticks.deliver(slave, instance)
        })
    }

    /// Sets the continuous inputs of `slave` to their values at `time`, unless all are unchanged; returns whether it
    /// set them.
    pub(crate) fn set_reals_in_event(
        &mut self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<bool, SystemError> {
        system.perform(slave, time, |instance| self.reals.set_now(slave, instance, time))
    }

    /// Ends the ticks of all clocks, after an update of the discrete states.
    pub(crate) fn end_ticks(&mut self) {
        self.ticks.end();
    }

    /// Computes the discrete and clocked inputs of all `count` slaves at `time`, the start of the run, and records
    /// these values as set.
    pub(crate) fn accept_at_events(&mut self, count: usize, time: f64) {
        for slave in 0..count {
            self.gather_at_events(slave, time);
        }
        self.at_events.accept();
    }

    /// Returns the names of the inputs of `slave` that have a new value or a tick.
    pub(crate) fn unsettled(&self, system: &System, slave: usize) -> Vec<String> {
        let mut ports = Vec::new();
        self.at_events.add_new(slave, &mut ports);
        let due = self.ticks.targets.iter().filter(|target| self.ticks.is_due(target));
        ports.extend(due.map(|target| target.port).filter(|port| port.slave == slave));
        ports.into_iter().map(|port| system.name(port)).collect()
    }
}

impl Reals {
    /// Reads the connected outputs of a slave without their derivatives.
    pub(super) fn read_values(
        &mut self,
        slave: usize,
        instance: &mut dyn Slave,
    ) -> Result<(), CallError> {
        let port_map = &self.layout.port_maps[slave];
        if port_map.outputs.is_empty() {
            return Ok(());
        }
        instance.get_real(&port_map.outputs, &mut self.trace.latest[port_map.output_range.clone()])
    }

    /// Sets the inputs of a slave to their values at `time` if a value differs from the value set last or has a
    /// derivative. Returns whether it has set them.
    fn set_now(
        &mut self,
        slave: usize,
        instance: &mut dyn Slave,
        time: f64,
    ) -> Result<bool, CallError> {
        let port_map = &self.layout.port_maps[slave];
        let range = port_map.input_range.clone();
        // An input with a derivative has moved since it was set.
        let derivatives = &mut self.input_derivatives[port_map.input_derivative_range.clone()];
        let mut changed = derivatives.iter().any(|derivative| *derivative != 0.0);
        derivatives.fill(0.0);
        for k in range.clone() {
            let value = self.value_at(self.layout.sources[k] as usize, time);
            let mut value = self.layout.factors[k] * value + self.layout.offsets[k];
            if let Some(Some(fault)) = self.faults.get(k) {
                value = fault.apply(time, value);
            }
            changed |= self.values[k].to_bits() != value.to_bits();
            self.values[k] = value;
        }
        if changed {
            instance.set_real(&self.layout.port_maps[slave].inputs, &self.values[range])?;
        }
        Ok(changed)
    }

    /// Clears the history of the outputs that have jumped: their values differ from `before`. Returns whether any has.
    pub(crate) fn forget_jumps(&mut self, before: &[f64]) -> bool {
        let trace = &mut self.trace;
        let mut any = false;
        for (output, before) in before.iter().enumerate() {
            let value = trace.latest[output];
            if value.to_bits() != before.to_bits() {
                any = true;
                for past in [&mut trace.start, &mut trace.before, &mut trace.earlier] {
                    past[output] = value;
                }
            }
        }
        any
    }
}
