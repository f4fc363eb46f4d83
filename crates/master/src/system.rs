//! A system: named slaves, connections between their variables, and settings of variables.

mod access;
mod arrays;
mod connecting;
mod settings;
mod terminals;
mod units;

use std::collections::{HashMap, HashSet};

use fmu_description::{Causality, ModelDescription, ScalarVariable};
use serde::{Deserialize, Serialize};

use crate::error::SystemError;
pub use access::read_value;
use fmu_description::similar::nearest;
use slave::{CallError, Slave, Transformation, Value};

/// A variable of a slave: position of the slave, and position of the variable in its description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Port {
    /// Position of the slave in [`System::slaves`].
    pub slave: usize,
    /// Position of the variable in `ModelVariables`.
    pub variable: usize,
}

/// A connection from an output to an input, or to a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection {
    /// The output.
    pub from: Port,
    /// The input.
    pub to: Port,
    /// Transformation of the value, including the conversion of units.
    pub transformation: Transformation,
}

/// Slaves and their connections.
#[derive(Default)]
pub struct System {
    /// Name and instance of each slave, in the order in which they were added.
    pub slaves: Vec<(String, Box<dyn Slave>)>,
    /// The connections.
    pub connections: Vec<Connection>,
    /// Connections to parameters, used in initialization mode only.
    pub(crate) initial: Vec<Connection>,
    /// Values that the FMUs receive during initialisation.
    pub(crate) settings: Vec<settings::Setting>,
    /// Positions of the settings, by the variable that holds the value.
    setting_positions: HashMap<Port, usize>,
    /// Variables of each slave by name.
    variables: Vec<HashMap<String, usize>>,
    /// Slaves by name.
    names: HashMap<String, usize>,
    /// Index of the connection of each input, by the variable that holds the value.
    sources: HashMap<Port, usize>,
    /// Variables that the user says are discrete.
    pub(crate) discrete: HashSet<Port>,
    /// For each slave, whether the master handles its events.
    pub(crate) events: Vec<bool>,
    observer: Option<EventObserver>,
    /// Values of inputs that were set last by [`System::set_value`], by the variable that holds the value.
    pub(crate) input_values: HashMap<Port, Value>,
    /// Number of values that [`System::set_value`] has set at inputs.
    pub(crate) changes: u64,
}

/// Receives the position of a slave in event mode, the time in s and the slave before each update of its discrete
/// states, when its clocks tick.
pub type EventObserver = Box<dyn FnMut(usize, f64, &mut dyn Slave) -> Result<(), CallError> + Send>;

impl System {
    /// Adds a slave.
    ///
    /// # Errors
    ///
    /// Returns an error if the name is already in use.
    pub fn add(&mut self, name: &str, slave: Box<dyn Slave>) -> Result<(), SystemError> {
        if self.names.contains_key(name) {
            return Err(SystemError::SameName { name: name.to_owned() });
        }
        self.names.insert(name.to_owned(), self.slaves.len());
        self.variables.push(by_name(slave.description()));
        self.slaves.push((name.to_owned(), slave));
        self.events.push(false);
        Ok(())
    }

    /// Lets `observer` see the events that the master handles.
    pub fn observe_events(&mut self, observer: EventObserver) {
        self.observer = Some(observer);
    }

    /// Shows a slave in event mode to the observer.
    #[inline]
    pub(crate) fn show_event(&mut self, slave: usize, time: f64) -> Result<(), SystemError> {
        let Some(observer) = &mut self.observer else { return Ok(()) };
        let (name, instance) = &mut self.slaves[slave];
        let observed = observer(slave, time, instance.as_mut());
        observed.map_err(|source| crate::error::call(name, time, source))
    }

    /// Returns the description of the variable at `port`.
    #[must_use]
    pub fn variable(&self, port: Port) -> &ScalarVariable {
        &self.slaves[port.slave].1.description().variables[port.variable]
    }

    /// Returns the name `slave.variable` of a port.
    #[must_use]
    pub fn name(&self, port: Port) -> String {
        format!("{}.{}", self.slaves[port.slave].0, self.variable(port).name)
    }

    /// Returns the port called `name`, in the form `slave.variable`. Both parts may contain dots:
    /// the longest slave name that has such a variable applies.
    ///
    /// # Errors
    ///
    /// Returns an error if the form is wrong, or if slave or variable do not exist.
    pub fn port(&self, name: &str) -> Result<Port, SystemError> {
        let mut missing = None;
        for (at, _) in name.match_indices('.').rev() {
            let (slave, variable) = (&name[..at], &name[at + 1..]);
            let Some(&position) = self.names.get(slave) else { continue };
            if let Some(&variable) = self.variables[position].get(variable) {
                return Ok(Port { slave: position, variable });
            }
            missing = missing.or(Some((position, variable)));
        }
        if let Some((slave, variable)) = missing {
            return Err(unknown(name, variable, self.slaves[slave].1.description()));
        }
        let Some((slave, _)) = name.split_once('.') else {
            let form = "FMU.VARIABLE";
            return Err(SystemError::Syntax { text: name.to_owned(), form });
        };
        Err(self.unknown_slave(name, slave))
    }

    /// Returns the port of the variable `variable` of the slave `slave`.
    ///
    /// # Errors
    ///
    /// Returns an error if slave or variable do not exist.
    pub fn terminal(&self, slave: &str, variable: &str) -> Result<Port, SystemError> {
        let name = format!("{slave}.{variable}");
        let Some(&position) = self.names.get(slave) else {
            return Err(self.unknown_slave(&name, slave));
        };
        match self.variables[position].get(variable) {
            Some(&variable) => Ok(Port { slave: position, variable }),
            None => Err(unknown(&name, variable, self.slaves[position].1.description())),
        }
    }

    /// Returns the position of the slave called `name`.
    ///
    /// # Errors
    ///
    /// Returns an error if there is no such slave.
    pub fn slave(&self, name: &str) -> Result<usize, SystemError> {
        self.names.get(name).copied().ok_or_else(|| self.unknown_slave(name, name))
    }

    fn unknown_slave(&self, name: &str, slave: &str) -> SystemError {
        let known: Vec<_> = self.slaves.iter().map(|(known, _)| known.as_str()).collect();
        SystemError::UnknownSlave {
            name: name.to_owned(),
            slave: slave.to_owned(),
            known: known.join(", "),
        }
    }

    /// Connects each output to the inputs of other slaves with the same name and no source; returns
    /// the number of new connections.
    ///
    /// # Errors
    ///
    /// Returns an error if names agree and types or units do not fit.
    pub fn connect_equal_names(&mut self) -> Result<usize, SystemError> {
        let before = self.connections.len();
        let mut inputs: HashMap<String, Vec<Port>> = HashMap::new();
        for to in self.ports(Causality::Input) {
            inputs.entry(self.variable(to).name.clone()).or_default().push(to);
        }
        for from in self.ports(Causality::Output) {
            let Some(same) = inputs.get(&self.variable(from).name) else { continue };
            for &to in same {
                if from.slave != to.slave && self.source(to).is_none() {
                    self.connect_ports(from, to, Transformation::Identity, false)?;
                }
            }
        }
        Ok(self.connections.len() - before)
    }

    /// Connects a free output to a free input of another FMU if they have the same unit, no other free
    /// output or input has it, and it is not dimensionless; returns the new connections.
    ///
    /// # Errors
    ///
    /// Same as [`System::connect_ports`].
    pub fn connect_equal_units(&mut self) -> Result<Vec<Connection>, SystemError> {
        let before = self.connections.len();
        let (outputs, inputs) = (self.free_outputs(), self.free_inputs());
        let unit = |port: Port| self.unit_name(port).map(str::to_owned);
        let input_units: Vec<_> = inputs.iter().map(|&input| unit(input)).collect();
        let output_units: Vec<_> = outputs.iter().map(|&output| unit(output)).collect();
        for (&to, unit) in inputs.iter().zip(&input_units) {
            let same = |other: &&Option<String>| unit.is_some() && *other == unit;
            let is_single = |units: &[Option<String>]| units.iter().filter(same).count() == 1;
            if !is_single(&input_units) || !is_single(&output_units) {
                continue;
            }
            let from = output_units.iter().position(|other| other == unit).map(|at| outputs[at]);
            if let Some(from) = from.filter(|from| from.slave != to.slave) {
                self.connect_ports(from, to, Transformation::Identity, false)?;
            }
        }
        Ok(self.connections[before..].to_vec())
    }

    /// Returns the inputs without a connection.
    #[must_use]
    pub fn free_inputs(&self) -> Vec<Port> {
        let mut inputs = self.ports(Causality::Input);
        inputs.retain(|input| self.source(*input).is_none());
        inputs
    }

    /// Returns the outputs without a connection.
    #[must_use]
    pub fn free_outputs(&self) -> Vec<Port> {
        let mut outputs = self.ports(Causality::Output);
        outputs.retain(|output| self.connections.iter().all(|known| known.from != *output));
        outputs
    }

    /// Returns the outputs that may belong to `input`: free outputs of other FMUs with its type and unit
    /// that have its name or, if the unit is stated, do not depend on the FMU of the input. A unit alone
    /// is no reason to close a loop: the estimate of a disturbance has the unit of the disturbance.
    #[must_use]
    pub fn candidates(&self, input: Port) -> Vec<Port> {
        let dependent = self.dependent_slaves(input.slave);
        let has_unit = self.unit_name(input).is_some();
        let mut outputs = self.free_outputs();
        outputs.retain(|&output| {
            output.slave != input.slave
                && self.variable(output).kind.element() == self.variable(input).kind.element()
                && self.unit_name(output) == self.unit_name(input)
                && (self.variable(output).name == self.variable(input).name
                    || has_unit && !dependent[output.slave])
        });
        outputs
    }

    /// Returns for each slave whether connections lead from `slave` to it.
    fn dependent_slaves(&self, slave: usize) -> Vec<bool> {
        let mut dependent = vec![false; self.slaves.len()];
        let mut open = vec![slave];
        while let Some(source) = open.pop() {
            for connection in self.connections.iter().filter(|known| known.from.slave == source) {
                if !std::mem::replace(&mut dependent[connection.to.slave], true) {
                    open.push(connection.to.slave);
                }
            }
        }
        dependent
    }

    /// Returns all variables of the given causality.
    #[must_use]
    pub fn ports(&self, causality: Causality) -> Vec<Port> {
        let slaves = self.slaves.iter().enumerate();
        let ports = slaves.flat_map(|(slave, (_, instance))| {
            let variables = instance.description().variables.iter().enumerate();
            let chosen = variables.filter(move |(_, variable)| variable.causality == causality);
            chosen.map(move |(variable, _)| Port { slave, variable })
        });
        ports.collect()
    }

    /// Returns the connection that ends at `input` or at an alias of it.
    #[must_use]
    pub fn source(&self, input: Port) -> Option<&Connection> {
        self.connections.get(*self.sources.get(&self.holder(input))?)
    }

    /// Returns the variable that holds the value of `port`: the variable of which it is an alias, otherwise itself. A
    /// negated alias counts as a variable of its own.
    #[must_use]
    pub fn holder(&self, port: Port) -> Port {
        let variable = self.variable(port);
        let holder = variable.alias_of.as_ref().filter(|_| !variable.negated);
        let holder = holder.and_then(|name| self.variables[port.slave].get(name));
        holder.map_or(port, |&variable| Port { variable, ..port })
    }

    /// Parses `text` as a value of the variable at `port`.
    pub(crate) fn value(&self, port: Port, text: &str) -> Result<Value, SystemError> {
        let description = self.slaves[port.slave].1.description();
        let kind = &self.variable(port).kind;
        Value::parse(kind, &description.types, text).map_err(|expected| SystemError::Value {
            name: self.name(port),
            value: text.to_owned(),
            expected,
        })
    }
}

/// Returns the positions of the variables by name. A name that two variables have refers to the first one.
fn by_name(description: &ModelDescription) -> HashMap<String, usize> {
    let variables = description.variables.iter().enumerate().rev();
    variables.map(|(position, variable)| (variable.name.clone(), position)).collect()
}

/// Returns the error for a missing variable, with similar names.
fn unknown(name: &str, variable: &str, description: &ModelDescription) -> SystemError {
    SystemError::UnknownVariable {
        name: name.to_owned(),
        model: description.model_name.clone(),
        variable: variable.to_owned(),
        nearest: nearest(description, variable),
    }
}
