//! Connections of all types that are not extrapolated.

use serde::{Deserialize, Serialize};

use super::discrete::{BINARIES, BOOLEANS, Channel, ChannelState, INTEGERS, REALS, STRINGS};
use crate::fault::FaultChain;
use crate::system::{Connection, Port, System};
use slave::{CallError, Slave, ValueType};

/// Connections of all types that are not extrapolated, one channel for each type.
pub(super) struct Channels {
    reals: Channel<f64>,
    pub(super) integers: Channel<i64>,
    booleans: Channel<i32>,
    strings: Channel<String>,
    binaries: Channel<Vec<u8>>,
    /// Whether there are no connections and no other outputs to read.
    pub(super) is_empty: bool,
}

/// The values of [`Channels`] that change during the run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ChannelsState {
    reals: ChannelState<f64>,
    integers: ChannelState<i64>,
    booleans: ChannelState<i32>,
    strings: ChannelState<String>,
    binaries: ChannelState<Vec<u8>>,
}

impl ChannelsState {
    pub(super) fn lengths(&self) -> [[usize; 3]; 5] {
        [
            self.reals.lengths(),
            self.integers.lengths(),
            self.booleans.lengths(),
            self.strings.lengths(),
            self.binaries.lengths(),
        ]
    }
}

/// Calls a method of the channels of all types, one after the other: up to the first error, up to the first that
/// returns true, or all.
macro_rules! all {
    ($channels:ident.$method:ident($($argument:expr),*)?) => {{
        $channels.reals.$method($($argument),*)?;
        $channels.integers.$method($($argument),*)?;
        $channels.booleans.$method($($argument),*)?;
        $channels.strings.$method($($argument),*)?;
        $channels.binaries.$method($($argument),*)
    }};
    ($channels:ident.$method:ident($($argument:expr),*) || ..) => {
        $channels.reals.$method($($argument),*)
            || $channels.integers.$method($($argument),*)
            || $channels.booleans.$method($($argument),*)
            || $channels.strings.$method($($argument),*)
            || $channels.binaries.$method($($argument),*)
    };
    ($channels:ident.$method:ident($($argument:expr),*);) => {
        $channels.reals.$method($($argument),*);
        $channels.integers.$method($($argument),*);
        $channels.booleans.$method($($argument),*);
        $channels.strings.$method($($argument),*);
        $channels.binaries.$method($($argument),*);
    };
}

impl Channels {
    /// Lays out `connections`, by the types of their inputs. `more` are Integer outputs to read as well.
    pub(super) fn new(system: &System, connections: &[&Connection], more: &[Port]) -> Self {
        let by_type = |kind: ValueType| -> Vec<&Connection> {
            let has_type = |connection: &&&Connection| {
                ValueType::of(&system.variable(connection.to).kind) == kind
            };
            connections.iter().filter(has_type).copied().collect()
        };
        Self {
            reals: Channel::new(system, REALS, &by_type(ValueType::Real), &[]),
            integers: Channel::new(system, INTEGERS, &by_type(ValueType::Integer), more),
            booleans: Channel::new(system, BOOLEANS, &by_type(ValueType::Boolean), &[]),
            strings: Channel::new(system, STRINGS, &by_type(ValueType::String), &[]),
            binaries: Channel::new(system, BINARIES, &by_type(ValueType::Binary), &[]),
            is_empty: connections.is_empty() && more.is_empty(),
        }
    }

    /// Puts a fault on the connection to an input, which is no String and no binary; returns false if the input has no
    /// connection here.
    pub(super) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        all!(self.set_fault(input, fault) || ..)
    }

    /// Records the undisturbed values in the faults at the final communication point `time`. Slaves for which `ahead`
    /// is true, because their step ends later, contribute the value at the start of this step.
    pub(super) fn commit(&mut self, time: f64, ahead: &dyn Fn(usize) -> bool) {
        all!(self.commit(time, ahead););
    }

    /// Iterates over the faults, each with the input of its connection.
    pub(super) fn faults(&self) -> impl Iterator<Item = (Port, &FaultChain)> {
        self.reals.faults().chain(self.integers.faults()).chain(self.booleans.faults())
    }

    /// Makes the end values of the last step the start values of the next one.
    pub(super) fn shift(&mut self, slave: usize) {
        all!(self.shift(slave););
    }

    /// Computes the inputs of `slave` at `time`. Slaves for which `ahead` is true, because their step ends later,
    /// contribute the value at the start of this step.
    pub(super) fn gather(&mut self, slave: usize, time: f64, ahead: &dyn Fn(usize) -> bool) {
        all!(self.gather(slave, time, ahead););
    }

    /// Whether a gathered input of `slave` differs from the value that was set last.
    pub(super) fn has_new(&self, slave: usize) -> bool {
        all!(self.has_new(slave) || ..)
    }

    /// Adds to `ports` the inputs of `slave` whose gathered value differs from the value that was set last.
    pub(super) fn add_new(&self, slave: usize, ports: &mut Vec<Port>) {
        all!(self.add_new(slave, ports););
    }

    /// Records the gathered values of all inputs as the values that were set last.
    pub(super) fn accept(&mut self) {
        all!(self.accept(););
    }

    /// Sets the gathered inputs of `slave`.
    pub(super) fn set(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        all!(self.set(slave, instance)?)
    }

    /// Reads the outputs of `slave`.
    pub(super) fn read(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        all!(self.read(slave, instance)?)
    }

    /// Copies all values to `state`.
    pub(super) fn save(&self, state: &mut ChannelsState) {
        state.reals.copy(&self.reals.state);
        state.integers.copy(&self.integers.state);
        state.booleans.copy(&self.booleans.state);
        state.strings.copy(&self.strings.state);
        state.binaries.copy(&self.binaries.state);
    }

    /// Restores all values from `state`.
    pub(super) fn restore(&mut self, state: &ChannelsState) {
        self.reals.state.copy(&state.reals);
        self.integers.state.copy(&state.integers);
        self.booleans.state.copy(&state.booleans);
        self.strings.state.copy(&state.strings);
        self.binaries.state.copy(&state.binaries);
    }
}
