//! Connections that are not extrapolated: their inputs are held during a step or set at events.

use std::collections::HashMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::fault::FaultChain;
use crate::system::{Connection, Port, System};
use slave::{CallError, Slave, Transformation};

type Get<T> = fn(&mut dyn Slave, &[u32], &mut [T]) -> Result<(), CallError>;
type Set<T> = fn(&mut dyn Slave, &[u32], &[T]) -> Result<(), CallError>;

/// The functions for values of one type: get and set, transformation, fault.
pub(crate) struct Access<T> {
    get: Get<T>,
    set: Set<T>,
    /// Applies a transformation to a value and stores the result in the third argument.
    map: fn(&T, &Transformation, &mut T),
    /// Applies faults to a value at a time in s.
    disturb: fn(&FaultChain, f64, &T) -> T,
    /// Returns a value as the number that faults record; NaN for a text.
    number: fn(&T) -> f64,
    /// Whether two values are equal, so that an input with the first need not be set to the second.
    same: fn(&T, &T) -> bool,
}

pub(crate) const REALS: Access<f64> = Access {
    get: |slave, references, values| slave.get_real(references, values),
    set: |slave, references, values| slave.set_real(references, values),
    map: |value, transformation, target| {
        *target = match transformation {
            Transformation::Linear { factor, offset } => factor * value + offset,
            _ => *value,
        }
    },
    disturb: |fault, time, value| fault.apply(time, *value),
    number: |value| *value,
    same: |one, other| one.to_bits() == other.to_bits(),
};

/// Access to Integers and Enumerations.
pub(crate) const INTEGERS: Access<i64> = Access {
    get: |slave, references, values| slave.get_integer(references, values),
    set: |slave, references, values| slave.set_integer(references, values),
    map: |value, transformation, target| {
        *target = match transformation {
            Transformation::Integer(pairs) => slave::mapped_integer(pairs, *value),
            _ => *value,
        }
    },
    disturb: |fault, time, value| fault.apply_integer(time, *value),
    number: |value| slave::to_real(*value),
    same: |one, other| one == other,
};

pub(crate) const BOOLEANS: Access<i32> = Access {
    get: |slave, references, values| slave.get_boolean(references, values),
    set: |slave, references, values| slave.set_boolean(references, values),
    map: |value, transformation, target| {
        *target = match transformation {
            Transformation::Boolean { from_false, from_true } => {
                i32::from(if *value == 0 { *from_false } else { *from_true })
            }
            _ => *value,
        }
    },
    disturb: |fault, time, value| fault.apply_boolean(time, *value),
    number: |value| f64::from(i32::from(*value != 0)),
    same: |one, other| (*one != 0) == (*other != 0),
};

pub(crate) const STRINGS: Access<String> = Access {
    get: |slave, references, values| slave.get_string(references, values),
    set: |slave, references, values| slave.set_string(references, values),
    map: |value, _, target| target.clone_from(value),
    disturb: |_, _, value| value.clone(),
    number: |_| f64::NAN,
    same: |one, other| one == other,
};

pub(crate) const BINARIES: Access<Vec<u8>> = Access {
    get: |slave, references, values| slave.get_binary(references, values),
    set: |slave, references, values| slave.set_binary(references, values),
    map: |value, _, target| target.clone_from(value),
    disturb: |_, _, value| value.clone(),
    number: |_| f64::NAN,
    same: |one, other| one == other,
};

/// The connected inputs and outputs of one slave, of one type.
#[derive(Default)]
struct PortMap {
    inputs: Vec<u32>,
    input_range: Range<usize>,
    outputs: Vec<u32>,
    output_range: Range<usize>,
}

/// The connections of one type, without their values.
struct Wiring {
    port_maps: Vec<PortMap>,
    output_ports: Vec<Port>,
    /// For each input, the index of the connected output.
    sources: Vec<usize>,
    /// For each input, the transformation (factor and offset) of its connection.
    transformations: Vec<Transformation>,
    input_ports: Vec<Port>,
    faults: Vec<Option<FaultChain>>,
}

/// All connections of one type.
pub(crate) struct Channel<T> {
    access: Access<T>,
    wiring: Wiring,
    pub(crate) state: ChannelState<T>,
    /// Values for the inputs.
    values: Vec<T>,
}

/// The values of a channel that change during the run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ChannelState<T> {
    /// Current values of the outputs.
    latest: Vec<T>,
    /// Values of the outputs at the start of the last steps, used if some slaves make steps of
    /// several communication steps.
    start: Vec<T>,
    /// Values of the inputs that were set last.
    #[serde(rename = "given")]
    inputs: Vec<T>,
}

impl<T: Clone> ChannelState<T> {
    pub(crate) fn lengths(&self) -> [usize; 3] {
        [&self.latest, &self.start, &self.inputs].map(Vec::len)
    }

    pub(crate) fn copy(&mut self, other: &Self) {
        self.latest.clone_from(&other.latest);
        self.start.clone_from(&other.start);
        self.inputs.clone_from(&other.inputs);
    }

    /// Returns the source value of the input at index `k`: the value at the start of the source's
    /// step if the source is `ahead`, otherwise the latest one.
    fn source(&self, wiring: &Wiring, k: usize, ahead: &dyn Fn(usize) -> bool) -> &T {
        let source = wiring.sources[k];
        let slave = wiring.output_ports[source].slave;
        if ahead(slave) { &self.start[source] } else { &self.latest[source] }
    }
}

impl Wiring {
    fn new(system: &System, connections: &[&Connection], more: &[Port]) -> Self {
        let outputs = connections.iter().map(|connection| connection.from);
        let mut outputs: Vec<Port> = outputs.chain(more.iter().copied()).collect();
        outputs.sort_unstable_by_key(|port| (port.slave, port.variable));
        outputs.dedup();
        let mut inputs = connections.to_vec();
        inputs.sort_by_key(|connection| connection.to.slave);
        let indices: HashMap<Port, usize> =
            outputs.iter().enumerate().map(|(index, &port)| (port, index)).collect();
        let mut port_maps: Vec<PortMap> =
            system.slaves.iter().map(|_| PortMap::default()).collect();
        for (slave, port_map) in port_maps.iter_mut().enumerate() {
            let start = outputs.partition_point(|port| port.slave < slave);
            let end = outputs.partition_point(|port| port.slave <= slave);
            port_map.outputs = references(system, outputs[start..end].iter().copied());
            port_map.output_range = start..end;
            let start = inputs.partition_point(|connection| connection.to.slave < slave);
            let end = inputs.partition_point(|connection| connection.to.slave <= slave);
            let ports = inputs[start..end].iter().map(|connection| connection.to);
            port_map.inputs = references(system, ports);
            port_map.input_range = start..end;
        }
        Self {
            port_maps,
            sources: inputs.iter().map(|connection| indices[&connection.from]).collect(),
            transformations: inputs.iter().map(|input| input.transformation.clone()).collect(),
            input_ports: inputs.iter().map(|connection| connection.to).collect(),
            faults: vec![None; inputs.len()],
            output_ports: outputs,
        }
    }
}

impl<T: Clone + Default> Channel<T> {
    /// Creates the channel of `connections`, which also reads the outputs `more`.
    pub(crate) fn new(
        system: &System,
        access: Access<T>,
        connections: &[&Connection],
        more: &[Port],
    ) -> Self {
        let wiring = Wiring::new(system, connections, more);
        let (outputs, inputs) = (wiring.output_ports.len(), wiring.input_ports.len());
        let defaults = |count: usize| vec![T::default(); count];
        let state = ChannelState {
            latest: defaults(outputs),
            start: defaults(outputs),
            inputs: defaults(inputs),
        };
        Self { access, wiring, state, values: defaults(inputs) }
    }

    /// Returns the current value of a connected output; `None` if no connection of this channel starts at the output.
    pub(crate) fn value(&self, port: Port) -> Option<&T> {
        let key = |known: &Port| (known.slave, known.variable);
        let position = self.wiring.output_ports.binary_search_by_key(&key(&port), key);
        position.ok().map(|index| &self.state.latest[index])
    }

    /// Puts a fault on the connection to an input; returns false if the input has no connection.
    pub(crate) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        let index = self.wiring.input_ports.iter().position(|&port| port == input);
        index.map(|k| self.wiring.faults[k] = Some(fault.clone())).is_some()
    }

    /// Records the undisturbed values in the faults at the final communication point `time`. Slaves for which `ahead`
    /// is true, because their step ends later, contribute the value at the start of this step.
    pub(crate) fn commit(&mut self, time: f64, ahead: &dyn Fn(usize) -> bool) {
        for k in 0..self.wiring.faults.len() {
            if self.wiring.faults[k].is_some() {
                let mut value = T::default();
                let source = self.state.source(&self.wiring, k, ahead);
                (self.access.map)(source, &self.wiring.transformations[k], &mut value);
                let number = (self.access.number)(&value);
                if let Some(fault) = &mut self.wiring.faults[k] {
                    fault.commit(time, number);
                }
            }
        }
    }

    /// Makes the end values of the last step the start values of the next one.
    pub(crate) fn shift(&mut self, slave: usize) {
        let range = self.wiring.port_maps[slave].output_range.clone();
        self.state.start[range.clone()].clone_from_slice(&self.state.latest[range]);
    }

    /// Iterates over the faults, each with the input of its connection.
    pub(crate) fn faults(&self) -> impl Iterator<Item = (Port, &FaultChain)> {
        let inputs = self.wiring.input_ports.iter().zip(&self.wiring.faults);
        inputs.filter_map(|(port, fault)| Some((*port, fault.as_ref()?)))
    }

    /// Computes the inputs of `slave` for a step from `time`. Slaves for which `ahead` is true, because their step ends
    /// later, contribute the value at the start of this step.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, ahead: &dyn Fn(usize) -> bool) {
        for k in self.wiring.port_maps[slave].input_range.clone() {
            let source = self.state.source(&self.wiring, k, ahead);
            (self.access.map)(source, &self.wiring.transformations[k], &mut self.values[k]);
            if let Some(fault) = &self.wiring.faults[k] {
                self.values[k] = (self.access.disturb)(fault, time, &self.values[k]);
            }
        }
    }

    /// Whether a gathered input of `slave` differs from the value that was set last.
    pub(crate) fn has_new(&self, slave: usize) -> bool {
        let range = self.wiring.port_maps[slave].input_range.clone();
        range.into_iter().any(|k| !(self.access.same)(&self.values[k], &self.state.inputs[k]))
    }

    /// Adds to `ports` the inputs of `slave` whose gathered value differs from the value that was set last.
    pub(crate) fn add_new(&self, slave: usize, ports: &mut Vec<Port>) {
        for k in self.wiring.port_maps[slave].input_range.clone() {
            if !(self.access.same)(&self.values[k], &self.state.inputs[k]) {
                ports.push(self.wiring.input_ports[k]);
            }
        }
    }

    /// Sets the gathered inputs.
    pub(crate) fn set(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let port_map = &self.wiring.port_maps[slave];
        if port_map.inputs.is_empty() {
            return Ok(());
        }
        let range = port_map.input_range.clone();
        (self.access.set)(instance, &port_map.inputs, &self.values[range.clone()])?;
        self.state.inputs[range.clone()].clone_from_slice(&self.values[range]);
        Ok(())
    }

    /// Records the gathered values of all inputs as the values that were set last.
    pub(crate) fn accept(&mut self) {
        self.state.inputs.clone_from(&self.values);
    }

    /// Reads the outputs.
    pub(crate) fn read(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let port_map = &self.wiring.port_maps[slave];
        if port_map.outputs.is_empty() {
            return Ok(());
        }
        (self.access.get)(
            instance,
            &port_map.outputs,
            &mut self.state.latest[port_map.output_range.clone()],
        )
    }
}

fn references(system: &System, ports: impl Iterator<Item = Port>) -> Vec<u32> {
    ports.map(|port| system.variable(port).value_reference).collect()
}
