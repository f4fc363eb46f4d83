//! Initialisation of the connected system: settings, outputs in the order of their dependencies,
//! algebraic loops.

use std::collections::HashMap;

use fmu_description::{DefaultExperiment, Experiment, ModelDescription};

use crate::drive::{Drive, Scenario};
use crate::error::{SystemError, call};
use crate::fault::FaultChain;
use crate::limits::check_start;
use crate::order::Rows;
use crate::signal_type::SignalType;
use crate::step_control::nominal;
use crate::system::{Port, System};
use slave::{Value, ValueType};
use solve::{Components, Newton, Progress, Scale, Solver, components};

/// Tolerance of the values in a loop, relative and as a fraction of nominal values.
const TOLERANCE: f64 = 1e-10;
/// Largest number of evaluations of a loop of Reals, and of passes through a loop of discrete
/// values.
const EVALUATIONS: u32 = 100;

/// Initialises all slaves: settings, initialization mode, values of connections, end of initialization mode. Settings
/// follow `fmi2SetupExperiment`, because some FMUs reset settings in this call. With `allow_nan` a loop may have values
/// that are not finite.
pub(crate) fn initialise(
    system: &mut System,
    experiment: &Experiment,
    scenario: &mut Scenario,
    allow_nan: bool,
) -> Result<(), SystemError> {
    let start = experiment.start_time;
    for (name, slave) in &mut system.slaves {
        let experiment = experiment_of(experiment, slave.description());
        slave.setup_experiment(&experiment).map_err(|source| call(name, start, source))?;
    }
    system.apply_settings()?;
    for (name, slave) in &mut system.slaves {
        slave.enter_initialization_mode().map_err(|source| call(name, start, source))?;
    }
    system.repeat_settings(start)?;
    scenario.drives.write(system, start)?;
    solve_connections(system, scenario, start, allow_nan)?;
    for (name, slave) in &mut system.slaves {
        slave.exit_initialization_mode().map_err(|source| call(name, start, source))?;
    }
    let connections = system.connections.iter().chain(&system.initial);
    let driven = scenario.drives.iter().map(Drive::port);
    let replaced = connections.map(|connection| connection.to).chain(driven);
    let replaced = replaced.map(|port| system.holder(port)).collect();
    check_start(system);
    system.confirm_settings(&replaced, start)
}

/// Returns the experiment for one FMU: with the tolerance of its own `DefaultExperiment` if the
/// user states none.
fn experiment_of(experiment: &Experiment, description: &ModelDescription) -> Experiment {
    let default = description.default_experiment.as_ref();
    let default = default.and_then(DefaultExperiment::usable_tolerance);
    Experiment { tolerance: experiment.tolerance.or(default), ..*experiment }
}

/// Transfers connected outputs to their inputs in initialization mode, in the order of their
/// dependencies, and solves algebraic loops.
fn solve_connections(
    system: &mut System,
    scenario: &Scenario,
    start: f64,
    allow_nan: bool,
) -> Result<(), SystemError> {
    let mut graph = Graph { allow_nan, ..Graph::new(system, &scenario.faults) };
    for component in 0..graph.components.len() {
        let nodes = graph.components.nodes(component).to_vec();
        if graph.components.is_loop(component) {
            graph.solve(system, &nodes, start)?;
        } else {
            for node in nodes {
                let value = system.read(graph.outputs[node], start)?;
                graph.write(system, node, &value, start)?;
            }
        }
    }
    Ok(())
}

/// A point of the iteration on a loop: the unknowns u and G(u).
#[derive(Clone, Copy)]
struct Iterate<'a> {
    u: &'a [f64],
    g: &'a [f64],
}

/// The dependency graph of the connected outputs in initialization mode.
struct Graph<'a> {
    faults: HashMap<Port, &'a FaultChain>,
    outputs: Vec<Port>,
    /// For each output, the indices of its connections in [`System::connections`] followed by `System::initial`.
    connections: Vec<Vec<usize>>,
    components: Components,
    /// Whether the values of a loop need not be finite.
    allow_nan: bool,
}

impl<'a> Graph<'a> {
    fn new(system: &System, faults: &'a [(Port, FaultChain)]) -> Self {
        let mut outputs: Vec<Port> = Vec::new();
        let mut nodes: HashMap<Port, usize> = HashMap::new();
        let mut connections: Vec<Vec<usize>> = Vec::new();
        let mut inputs: Vec<Vec<(usize, usize)>> = vec![Vec::new(); system.slaves.len()];
        for (number, connection) in system.connections.iter().chain(&system.initial).enumerate() {
            if system.signal_type(connection.to) == SignalType::Clocked {
                // Clocked values are passed at the ticks of their clock, in event mode.
                continue;
            }
            let node = *nodes.entry(connection.from).or_insert_with(|| {
                outputs.push(connection.from);
                connections.push(Vec::new());
                outputs.len() - 1
            });
            connections[node].push(number);
            inputs[connection.to.slave].push((system.holder(connection.to).variable, node));
        }
        let rows = Rows::of(system);
        let mut edges = Vec::new();
        for (node, output) in outputs.iter().enumerate() {
            let inputs = &inputs[output.slave];
            match rows[output.slave].initial_dependencies(output.variable) {
                None => edges.extend(inputs.iter().map(|&(_, source)| (source, node))),
                Some(list) => {
                    let needed = inputs.iter().filter(|(input, _)| list.contains(input));
                    edges.extend(needed.map(|&(_, source)| (source, node)));
                }
            }
        }
        let components = components(outputs.len(), &edges);
        let faults = faults.iter().map(|(input, fault)| (*input, fault)).collect();
        Self { faults, outputs, connections, components, allow_nan: false }
    }

    /// Sets all inputs and parameters that are connected to an output, after transformations and faults.
    fn write(
        &self,
        system: &mut System,
        node: usize,
        value: &Value,
        time: f64,
    ) -> Result<(), SystemError> {
        for &number in &self.connections[node] {
            let connection = match number.checked_sub(system.connections.len()) {
                None => &system.connections[number],
                Some(number) => &system.initial[number],
            };
            let to = connection.to;
            let mut value = system.transformed(value, &connection.transformation, to);
            if let Some(fault) = self.faults.get(&to) {
                fault.disturb(time, &mut value);
            }
            system
                .set_value(to, &value)
                .map_err(|source| call(&system.slaves[to.slave].0, time, source))?;
        }
        Ok(())
    }

    /// Solves an algebraic loop: in each pass of a fixed-point iteration of the discrete values, the
    /// Reals by Newton's method.
    fn solve(
        &mut self,
        system: &mut System,
        nodes: &[usize],
        time: f64,
    ) -> Result<(), SystemError> {
        let is_real = |node: &usize| {
            ValueType::of(&system.variable(self.outputs[*node]).kind) == ValueType::Real
        };
        let (reals, discrete): (Vec<usize>, Vec<usize>) =
            nodes.iter().partition(|node| is_real(node));
        let mut values = self.read_all(system, &discrete, time)?;
        for _ in 0..EVALUATIONS {
            for (&node, value) in discrete.iter().zip(&values) {
                self.write(system, node, value, time)?;
            }
            self.solve_reals(system, &reals, time)?;
            let next = self.read_all(system, &discrete, time)?;
            if next == values {
                return Ok(());
            }
            values = next;
        }
        let why = format!("its discrete values do not settle within {EVALUATIONS} passes");
        Err(self.unsolved(system, nodes, time, why))
    }

    fn read_all(
        &self,
        system: &mut System,
        nodes: &[usize],
        time: f64,
    ) -> Result<Vec<Value>, SystemError> {
        nodes.iter().map(|&node| system.read(self.outputs[node], time)).collect()
    }

    /// Evaluates `G(u)`: the outputs, with the values `u` at the connected inputs.
    fn evaluate(
        &self,
        system: &mut System,
        nodes: &[usize],
        u: &[f64],
        time: f64,
    ) -> Result<Vec<f64>, SystemError> {
        for (&node, &value) in nodes.iter().zip(u) {
            self.write(system, node, &Value::Real(value), time)?;
        }
        self.reals(system, nodes, time)
    }

    fn reals(
        &self,
        system: &mut System,
        nodes: &[usize],
        time: f64,
    ) -> Result<Vec<f64>, SystemError> {
        nodes.iter().map(|&node| system.read_real(self.outputs[node], time)).collect()
    }

    fn solve_reals(
        &self,
        system: &mut System,
        nodes: &[usize],
        time: f64,
    ) -> Result<(), SystemError> {
        let nominals = nodes.iter().map(|&node| nominal(system, self.outputs[node])).collect();
        let mut solver = Newton::new(Scale::new(TOLERANCE, TOLERANCE, nominals), EVALUATIONS);
        let mut u = self.reals(system, nodes, time)?;
        let mut next = u.clone();
        solver.begin();
        let mut g = self.evaluate(system, nodes, &u, time)?;
        loop {
            let why = match solver.next(&u, &g, &mut next) {
                Progress::Converged { .. } => return Ok(()),
                Progress::Evaluate => {
                    u.copy_from_slice(&next);
                    g = self.evaluate(system, nodes, &u, time)?;
                    continue;
                }
                Progress::Matrix => {
                    self.differentiate(system, nodes, Iterate { u: &u, g: &g }, &mut solver, time)?;
                    continue;
                }
                Progress::NotConverged { iterations, residual } => format!(
                    "not solved within {iterations} evaluations, the residual is {residual:.1e} of \
                     the tolerance {TOLERANCE:e}"
                ),
                Progress::Diverged { iterations } => {
                    format!("the iteration diverges (evaluation {iterations})")
                }
                Progress::Singular { condition } => format!(
                    "it has no solution or many: its matrix is singular (condition {condition:.1e})"
                ),
            };
            if self.allow_nan && g.iter().any(|value| !value.is_finite()) {
                return self.evaluate(system, nodes, &g, time).map(|_| ());
            }
            return Err(self.unsolved(system, nodes, time, why));
        }
    }

    /// Computes the Jacobian `dG/du` by finite differences, then sets the inputs to `point` again.
    fn differentiate(
        &self,
        system: &mut System,
        nodes: &[usize],
        point: Iterate<'_>,
        solver: &mut Newton,
        time: f64,
    ) -> Result<(), SystemError> {
        for column in 0..nodes.len() {
            let change = solver.perturbation(column, point.u);
            let mut moved = point.u.to_vec();
            moved[column] += change;
            let there = self.evaluate(system, nodes, &moved, time)?;
            let quotients: Vec<f64> =
                there.iter().zip(point.g).map(|(there, here)| (there - here) / change).collect();
            solver.set_column(column, &quotients);
        }
        self.evaluate(system, nodes, point.u, time).map(|_| ())
    }

    fn unsolved(&self, system: &System, nodes: &[usize], time: f64, why: String) -> SystemError {
        let names: Vec<_> = nodes.iter().map(|&node| system.name(self.outputs[node])).collect();
        SystemError::Loop { names: names.join(", "), time, why }
    }
}
