//! The channels of all types, used together.

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
    empty: bool,
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
    pub(super) fn has_shape_of(&self, other: &Self) -> bool {
        self.reals.has_shape_of(&other.reals)
            && self.integers.has_shape_of(&other.integers)
            && self.booleans.has_shape_of(&other.booleans)
            && self.strings.has_shape_of(&other.strings)
            && self.binaries.has_shape_of(&other.binaries)
    }
}

/// Calls a method of the channels of all types, one after the other, up to the first error.
macro_rules! all {
    ($channels:ident.$method:ident($($argument:expr),*)?) => {{
        $channels.reals.$method($($argument),*)?;
        $channels.integers.$method($($argument),*)?;
        $channels.booleans.$method($($argument),*)?;
        $channels.strings.$method($($argument),*)?;
        $channels.binaries.$method($($argument),*)
    }};
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
        let reals = Channel::new(system, REALS, &by_type(ValueType::Real), &[]);
        let integers = Channel::new(system, INTEGERS, &by_type(ValueType::Integer), more);
        let booleans = Channel::new(system, BOOLEANS, &by_type(ValueType::Boolean), &[]);
        let strings = Channel::new(system, STRINGS, &by_type(ValueType::String), &[]);
        let binaries = Channel::new(system, BINARIES, &by_type(ValueType::Binary), &[]);
        let empty = reals.is_empty()
            && integers.is_empty()
            && booleans.is_empty()
            && strings.is_empty()
            && binaries.is_empty();
        Self { reals, integers, booleans, strings, binaries, empty }
    }

    /// Whether there are no connections and no other outputs to read.
    pub(super) fn is_empty(&self) -> bool {
        self.empty
    }

    /// Puts a fault on the connection to an input; returns false if the input has no connection here, or is a String or
    /// a binary.
    pub(super) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        self.reals.set_fault(input, fault)
            || self.integers.set_fault(input, fault)
            || self.booleans.set_fault(input, fault)
    }

    /// Returns the faults on the connection to an input.
    pub(super) fn fault(&self, input: Port) -> Option<&FaultChain> {
        let reals = self.reals.fault(input).or_else(|| self.integers.fault(input));
        reals.or_else(|| self.booleans.fault(input))
    }

    /// Records the undisturbed values in the faults at the final communication point `time`. Slaves for which `ahead`
    /// is true contribute the value at the start of their step.
    pub(super) fn commit(&mut self, time: f64, ahead: &dyn Fn(usize) -> bool) {
        self.reals.commit(time, ahead);
        self.integers.commit(time, ahead);
        self.booleans.commit(time, ahead);
    }

    /// Returns the first time after `after` at which a fault starts or ends.
    pub(super) fn next_break(&self, after: f64) -> Option<f64> {
        let breaks = [
            self.reals.next_break(after),
            self.integers.next_break(after),
            self.booleans.next_break(after),
        ];
        breaks.into_iter().flatten().reduce(f64::min)
    }

    /// Iterates over all faults, for a checkpoint.
    pub(super) fn faults(&mut self) -> impl Iterator<Item = &mut FaultChain> {
        self.reals.faults().chain(self.integers.faults()).chain(self.booleans.faults())
    }

    /// Makes the end values of the last step the start values of the next one.
    pub(super) fn shift(&mut self, slave: usize) {
        all!(self.shift(slave););
    }

    /// Computes the inputs of `slave` at `time`. Slaves for which `ahead` is true contribute the value at the
    /// start of their step.
    pub(super) fn gather(&mut self, slave: usize, time: f64, ahead: &dyn Fn(usize) -> bool) {
        all!(self.gather(slave, time, ahead););
    }

    /// Whether a gathered input of `slave` differs from the value that was set last.
    pub(super) fn has_new(&self, slave: usize) -> bool {
        self.reals.has_new(slave)
            || self.integers.has_new(slave)
            || self.booleans.has_new(slave)
            || self.strings.has_new(slave)
            || self.binaries.has_new(slave)
    }

    /// Adds the inputs of `slave` whose gathered value differs from the one that was set last to `ports`.
    pub(super) fn add_new(&self, slave: usize, ports: &mut Vec<Port>) {
        all!(self.add_new(slave, ports););
    }

    /// Records the gathered values of all inputs as those that were set last.
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
        self.reals.save(&mut state.reals);
        self.integers.save(&mut state.integers);
        self.booleans.save(&mut state.booleans);
        self.strings.save(&mut state.strings);
        self.binaries.save(&mut state.binaries);
    }

    /// Restores all values from `state`.
    pub(super) fn restore(&mut self, state: &ChannelsState) {
        self.reals.restore(&state.reals);
        self.integers.restore(&state.integers);
        self.booleans.restore(&state.booleans);
        self.strings.restore(&state.strings);
        self.binaries.restore(&state.binaries);
    }
}
