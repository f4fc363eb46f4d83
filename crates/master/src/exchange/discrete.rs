//! Connected Integers, Enumerations, Booleans and Strings: always held.

use std::collections::HashMap;
use std::ops::Range;

use fmu_description::Kind;

use crate::fault::FaultChain;
use crate::system::{Connection, Port, System};
use slave::Transformation;
use slave::{CallError, Slave};

type Get<T> = fn(&mut dyn Slave, &[u32], &mut [T]) -> Result<(), CallError>;
type Set<T> = fn(&mut dyn Slave, &[u32], &[T]) -> Result<(), CallError>;

/// The functions and the transformation of a type.
pub(crate) struct Access<T> {
    get: Get<T>,
    set: Set<T>,
    /// What becomes of a value, into the place of another.
    map: fn(&T, &Transformation, &mut T),
    disturb: fn(&FaultChain, f64, &T) -> T,
    number: fn(&T) -> f64,
}

/// Integers and Enumerations.
pub(crate) const INTEGERS: Access<i32> = Access {
    get: |slave, references, values| slave.get_integer(references, values),
    set: |slave, references, values| slave.set_integer(references, values),
    map: |value, transformation, target| {
        *target = match transformation {
            Transformation::Integer(pairs) => {
                pairs.iter().find(|(from, _)| from == value).map_or(*value, |(_, to)| *to)
            }
            _ => *value,
        }
    },
    disturb: |fault, time, value| fault.apply_integer(time, *value),
    number: |value| f64::from(*value),
};

/// Booleans.
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
};

/// Strings.
pub(crate) const STRINGS: Access<String> = Access {
    get: |slave, references, values| slave.get_string(references, values),
    set: |slave, references, values| slave.set_string(references, values),
    map: |value, _, target| target.clone_from(value),
    disturb: |_, _, value| value.clone(),
    number: |_| f64::NAN,
};

/// What one slave sets and reads of a type.
#[derive(Default)]
struct PortMap {
    inputs: Vec<u32>,
    input_range: Range<usize>,
    outputs: Vec<u32>,
    output_range: Range<usize>,
}

/// The connected variables of one type.
pub(crate) struct Channel<T> {
    access: Access<T>,
    port_maps: Vec<PortMap>,
    output_ports: Vec<Port>,
    /// For each input the index of its output, and what becomes of the value.
    sources: Vec<usize>,
    transformations: Vec<Transformation>,
    input_ports: Vec<Port>,
    faults: Vec<Option<FaultChain>>,
    /// Values of the outputs.
    pub(crate) latest: Vec<T>,
    /// Their values at the begins of the last steps, where slaves make several steps at once.
    pub(crate) begin: Vec<T>,
    /// What the inputs get.
    values: Vec<T>,
}

impl<T: Clone + Default> Channel<T> {
    /// The connections between variables of the kinds that `is_of` accepts, and the outputs `more`.
    pub(crate) fn new(
        system: &System,
        access: Access<T>,
        is_of: fn(&Kind) -> bool,
        more: impl Iterator<Item = Port>,
    ) -> Self {
        let belongs = |connection: &&Connection| is_of(&system.variable(connection.to).kind);
        let connections: Vec<_> = system.connections.iter().filter(belongs).collect();
        let mut outputs: Vec<Port> =
            connections.iter().map(|connection| connection.from).chain(more).collect();
        outputs.sort_unstable_by_key(|port| (port.slave, port.variable));
        outputs.dedup();
        let mut inputs: Vec<_> = connections.clone();
        inputs.sort_by_key(|connection| connection.to.slave);
        let indices: HashMap<Port, usize> =
            outputs.iter().enumerate().map(|(index, &port)| (port, index)).collect();
        let mut port_maps: Vec<PortMap> =
            system.slaves.iter().map(|_| PortMap::default()).collect();
        for (slave, lane) in port_maps.iter_mut().enumerate() {
            let begin = outputs.partition_point(|port| port.slave < slave);
            let end = outputs.partition_point(|port| port.slave <= slave);
            lane.outputs = references(system, outputs[begin..end].iter().copied());
            lane.output_range = begin..end;
            let begin = inputs.partition_point(|connection| connection.to.slave < slave);
            let end = inputs.partition_point(|connection| connection.to.slave <= slave);
            let ports = inputs[begin..end].iter().map(|connection| connection.to);
            lane.inputs = references(system, ports);
            lane.input_range = begin..end;
        }
        Self {
            access,
            port_maps,
            sources: inputs.iter().map(|connection| indices[&connection.from]).collect(),
            transformations: inputs.iter().map(|each| each.transformation.clone()).collect(),
            input_ports: inputs.iter().map(|connection| connection.to).collect(),
            faults: vec![None; inputs.len()],
            latest: vec![T::default(); outputs.len()],
            begin: vec![T::default(); outputs.len()],
            values: vec![T::default(); inputs.len()],
            output_ports: outputs,
        }
    }

    /// The value of an output that is exchanged.
    pub(crate) fn value(&self, port: Port) -> Option<&T> {
        let key = |known: &Port| (known.slave, known.variable);
        let found = self.output_ports.binary_search_by_key(&key(&port), key);
        found.ok().map(|index| &self.latest[index])
    }

    /// Puts a fault on the way to an input; false where there is no such connected input.
    pub(crate) fn set_fault(&mut self, input: Port, fault: &FaultChain) -> bool {
        let Some(k) = self.input_ports.iter().position(|&port| port == input) else {
            return false;
        };
        self.faults[k] = Some(fault.clone());
        true
    }

    /// Tells the faults the undisturbed values at `time`, which is reached for good; those of slaves
    /// that are `ahead` of it have not changed yet.
    pub(crate) fn commit(&mut self, time: f64, ahead: impl Fn(usize) -> bool) {
        for k in 0..self.faults.len() {
            if self.faults[k].is_some() {
                let mut value = T::default();
                (self.access.map)(self.source(k, &ahead), &self.transformations[k], &mut value);
                let number = (self.access.number)(&value);
                if let Some(fault) = &mut self.faults[k] {
                    fault.commit(time, number);
                }
            }
        }
    }

    /// The first time past `after` at which a fault begins or ends.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        let faults = self.faults.iter().flatten();
        faults.filter_map(|fault| fault.next_break(after)).reduce(f64::min)
    }

    /// The value that the input at index `k` is connected to: that at the begin of its slave's last
    /// step where the slave is `ahead`.
    fn source(&self, k: usize, ahead: impl Fn(usize) -> bool) -> &T {
        let source = self.sources[k];
        let slave = self.output_ports[source].slave;
        if ahead(slave) { &self.begin[source] } else { &self.latest[source] }
    }

    /// The slave will step: what was its end is its begin.
    pub(crate) fn shift(&mut self, slave: usize) {
        let range = self.port_maps[slave].output_range.clone();
        self.begin[range.clone()].clone_from_slice(&self.latest[range]);
    }

    /// The faults, for a checkpoint.
    pub(crate) fn faults(&mut self) -> impl Iterator<Item = &mut FaultChain> {
        self.faults.iter_mut().flatten()
    }

    /// The inputs of `slave` from the values of now, for a step from `time`; those of slaves that are
    /// `ahead` have not changed yet.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, ahead: impl Fn(usize) -> bool) {
        for k in self.port_maps[slave].input_range.clone() {
            let source = self.sources[k];
            let is_ahead = ahead(self.output_ports[source].slave);
            let value = if is_ahead { &self.begin[source] } else { &self.latest[source] };
            (self.access.map)(value, &self.transformations[k], &mut self.values[k]);
            if let Some(fault) = &self.faults[k] {
                self.values[k] = (self.access.disturb)(fault, time, &self.values[k]);
            }
        }
    }

    /// Sets the gathered inputs.
    pub(crate) fn set(&self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let lane = &self.port_maps[slave];
        if lane.inputs.is_empty() {
            return Ok(());
        }
        (self.access.set)(instance, &lane.inputs, &self.values[lane.input_range.clone()])
    }

    /// Reads the outputs.
    pub(crate) fn read(&mut self, slave: usize, instance: &mut dyn Slave) -> Result<(), CallError> {
        let lane = &self.port_maps[slave];
        if lane.outputs.is_empty() {
            return Ok(());
        }
        (self.access.get)(instance, &lane.outputs, &mut self.latest[lane.output_range.clone()])
    }
}

fn references(system: &System, ports: impl Iterator<Item = Port>) -> Vec<u32> {
    ports.map(|port| system.variable(port).value_reference).collect()
}
