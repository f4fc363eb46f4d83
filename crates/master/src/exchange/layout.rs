//! The layout of connected Reals: value references and array indices of all slaves, computed once.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use crate::algorithm::{Algorithm, Extrapolation};
use crate::order::Rows;
use crate::signal_type::{SignalType, Way};
use crate::system::{Port, System};
use slave::{CommunicationStep, StepRequest, Transformation, ValueType};

/// Derivatives that a slave refuses although its model description promises them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// Whether `fmi2SetRealInputDerivatives` fails.
    pub(crate) inputs: bool,
    /// Whether `fmi2GetRealOutputDerivatives` fails.
    pub(crate) outputs: bool,
}

/// The connected Real inputs and outputs of one slave.
#[derive(Debug, Default)]
pub(super) struct PortMap {
    /// Value references of the inputs.
    pub(super) inputs: Vec<u32>,
    /// Range of the inputs in the arrays of all slaves.
    pub(super) input_range: Range<usize>,
    pub(super) derived_inputs: Vec<u32>,
    pub(super) input_orders: Vec<i32>,
    pub(super) input_derivative_range: Range<usize>,
    pub(super) outputs: Vec<u32>,
    pub(super) output_range: Range<usize>,
    pub(super) derived_outputs: Vec<u32>,
    pub(super) output_orders: Vec<i32>,
    pub(super) output_derivative_range: Range<usize>,
    /// Highest order of derivatives that the inputs take; 0: constant inputs.
    pub(super) input_order: usize,
    /// Highest order of derivatives that the outputs provide.
    pub(super) output_order: usize,
}

impl PortMap {
    /// Builds the request of a step of this slave. `values` are the inputs of all slaves; the other slices belong to
    /// this slave.
    #[inline]
    pub(super) fn request<'a>(
        &'a self,
        values: &'a [f64],
        input_derivatives: &'a [f64],
        step: CommunicationStep,
        output_values: &'a mut [f64],
        output_derivatives: &'a mut [f64],
    ) -> StepRequest<'a> {
        StepRequest {
            inputs: &self.inputs,
            input_values: &values[self.input_range.clone()],
            derived_inputs: &self.derived_inputs,
            input_orders: &self.input_orders,
            input_derivatives,
            step,
            outputs: &self.outputs,
            output_values,
            derived_outputs: &self.derived_outputs,
            output_orders: &self.output_orders,
            output_derivatives,
        }
    }
}

/// The connected Reals of all slaves.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub(super) port_maps: Vec<PortMap>,
    /// For each input, the index of the connected output.
    pub(super) sources: Vec<u32>,
    /// For each input, factor and offset of the transformation of its connection.
    pub(super) factors: Vec<f64>,
    pub(super) offsets: Vec<f64>,
    /// For each input, whether it is constant within a step, because an end of its connection is not continuous.
    pub(super) held: Vec<bool>,
    /// For each input, its slave and variable.
    pub(super) input_ports: Vec<Port>,
    /// For each slave, whether it has no states and therefore uses input values at the end of a step.
    pub(super) functions: Vec<bool>,
    /// For each slave, whether all its inputs are copies of outputs, without transformation.
    pub(super) plain: Vec<bool>,
    /// For each output, its slave and variable.
    pub(super) output_ports: Vec<Port>,
    /// For each output, the index of its slave.
    pub(super) owners: Vec<u32>,
    /// For each output, the index of its first derivative, if the slave provides one.
    pub(super) slopes: Vec<Option<u32>>,
    /// For each output, the index of its second derivative, if the slave provides one.
    pub(super) curvatures: Vec<Option<u32>>,
    /// For each output, whether it is continuous but jumps with a discrete output of another slave.
    pub(super) jumping: Vec<bool>,
    /// For each output, whether it is not continuous.
    pub(super) discrete: Vec<bool>,
    /// Number of derivatives of all outputs.
    pub(super) output_derivatives: usize,
    /// Number of derivatives of all inputs.
    pub(super) input_derivatives: usize,
    /// Integer outputs that are connected to Reals: port, and index in the output array, after the
    /// Real outputs.
    pub(super) from_integers: Vec<(Port, usize)>,
    indices: HashMap<Port, u32>,
}

impl Layout {
    pub(super) fn new(system: &System, algorithm: &Algorithm, refusing: &[Refusal]) -> Self {
        let count = system.slaves.len();
        let functions = system.slaves.iter().map(|(_, slave)| slave.is_function()).collect();
        let mut layout = Self { plain: vec![true; count], functions, ..Self::default() };
        layout.port_maps.resize_with(count, PortMap::default);
        layout.collect_outputs(system);
        layout.collect_inputs(system);
        let is_discrete = |port: &Port| system.signal_type(*port) != SignalType::Continuous;
        layout.discrete = layout.output_ports.iter().map(is_discrete).collect();
        layout.find_jumping(system);
        for (slave, port_map) in layout.port_maps.iter_mut().enumerate() {
            let Some(flags) = &system.slaves[slave].1.description().co_simulation else { continue };
            let order = match algorithm.extrapolation {
                Extrapolation::Hold => 0,
                Extrapolation::Limited | Extrapolation::Linear => 1,
                Extrapolation::Quadratic => 2,
            };
            let refusal = refusing.get(slave).copied().unwrap_or_default();
            if flags.can_interpolate_inputs && !refusal.inputs {
                port_map.input_order = order;
            }
            if !refusal.outputs {
                port_map.output_order = order.min(flags.max_output_derivative_order as usize);
            }
        }
        layout.place_derivatives();
        layout
    }

    /// Collects every output that passes as a Real ([`Way::Real`]) once: the Real outputs slave by slave, then the
    /// Integer outputs.
    fn collect_outputs(&mut self, system: &System) {
        let mut by_slave = vec![Vec::new(); self.port_maps.len()];
        let mut integers = Vec::new();
        for connection in &system.connections {
            let from = connection.from;
            if Way::of(system, connection) != Way::Real {
                continue;
            }
            // 0 until `add_output` sets the index.
            if self.indices.insert(from, 0).is_some() {
                continue;
            }
            if ValueType::of(&system.variable(from).kind) == ValueType::Real {
                by_slave[from.slave].push(from);
            } else {
                integers.push(from);
            }
        }
        for (slave, ports) in by_slave.into_iter().enumerate() {
            let start = self.output_ports.len();
            for port in ports {
                self.add_output(port);
                self.port_maps[slave].outputs.push(system.variable(port).value_reference);
            }
            self.port_maps[slave].output_range = start..self.output_ports.len();
        }
        for port in integers {
            self.from_integers.push((port, self.output_ports.len()));
            self.add_output(port);
        }
    }

    fn add_output(&mut self, port: Port) {
        self.indices.insert(port, index(self.output_ports.len()));
        self.output_ports.push(port);
        self.owners.push(index(port.slave));
        self.slopes.push(None);
        self.curvatures.push(None);
    }

    fn collect_inputs(&mut self, system: &System) {
        let mut by_slave = vec![Vec::new(); self.port_maps.len()];
        for connection in &system.connections {
            if Way::of(system, connection) == Way::Real {
                by_slave[connection.to.slave].push(connection);
            }
        }
        for (slave, connections) in by_slave.into_iter().enumerate() {
            let start = self.sources.len();
            for connection in connections {
                let variable = system.variable(connection.to);
                self.port_maps[slave].inputs.push(variable.value_reference);
                self.input_ports.push(connection.to);
                self.sources.push(self.indices[&connection.from]);
                let (factor, offset) = match connection.transformation {
                    Transformation::Linear { factor, offset } => (factor, offset),
                    _ => (1.0, 0.0),
                };
                self.plain[slave] &= connection.transformation == Transformation::Identity;
                self.factors.push(factor);
                self.offsets.push(offset);
                self.held.push(system.is_held(connection));
            }
            self.port_maps[slave].input_range = start..self.sources.len();
        }
    }

    /// Finds the outputs that jump with a discrete output of another slave: outputs that depend directly, also through
    /// further slaves, on a Real input connected to the discrete output. An output counts as smooth if its dependencies
    /// are not stated, or if it depends on discrete outputs only through inputs of other types, such as a Boolean.
    fn find_jumping(&mut self, system: &System) {
        let outputs = || self.output_ports.iter().zip(&self.discrete);
        let discrete = outputs().filter(|(_, is_discrete)| **is_discrete);
        let mut jumping: HashSet<Port> = discrete.map(|(port, _)| *port).collect();
        let rows = Rows::of(system);
        loop {
            let from_jumping =
                system.connections.iter().filter(|connection| jumping.contains(&connection.from));
            let inputs: HashSet<Port> =
                from_jumping.map(|connection| system.holder(connection.to)).collect();
            let is_dependent = |port: &&Port| {
                let dependencies = rows[port.slave].direct_dependencies(port.variable);
                let jumps = |&variable: &usize| inputs.contains(&Port { variable, ..**port });
                !jumping.contains(port) && dependencies.is_some_and(|all| all.iter().any(jumps))
            };
            let dependent: Vec<Port> =
                self.output_ports.iter().filter(is_dependent).copied().collect();
            if dependent.is_empty() {
                break;
            }
            jumping.extend(dependent);
        }
        self.jumping =
            outputs().map(|(port, is_discrete)| jumping.contains(port) && !is_discrete).collect();
    }

    /// Assigns indices to the derivatives: slave by slave, first order before second order.
    fn place_derivatives(&mut self) {
        for port_map in &mut self.port_maps {
            let start = self.output_derivatives;
            let places = [(1, &mut self.slopes), (2, &mut self.curvatures)];
            for (order, places) in places.into_iter().take(port_map.output_order) {
                for output in port_map.output_range.clone() {
                    places[output] = Some(index(self.output_derivatives));
                    self.output_derivatives += 1;
                }
                port_map.derived_outputs.extend(&port_map.outputs);
                port_map.output_orders.extend(port_map.outputs.iter().map(|_| order));
            }
            port_map.output_derivative_range = start..self.output_derivatives;
            let start = self.input_derivatives;
            for order in [1, 2].into_iter().take(port_map.input_order) {
                self.input_derivatives += port_map.inputs.len();
                port_map.derived_inputs.extend(&port_map.inputs);
                port_map.input_orders.extend(port_map.inputs.iter().map(|_| order));
            }
            port_map.input_derivative_range = start..self.input_derivatives;
        }
    }

    /// Returns the index of an output; `None` if the output is not connected to a Real.
    pub(super) fn output(&self, port: Port) -> Option<usize> {
        self.indices.get(&port).map(|&index| index as usize)
    }
}

/// Converts a position to an index; systems have fewer than 2^32 variables.
fn index(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}
