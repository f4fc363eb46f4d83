//! A system: slaves by name, the connections between them, and settings of variables by name.

mod access;
mod connecting;
mod settings;
mod units;

use std::collections::HashMap;

use fmu_description::{Causality, ModelDescription, ScalarVariable};

use crate::error::SystemError;
use fmu_description::similar::nearest;
use slave::Slave;
use slave::Transformation;
use slave::Value;

/// One end of a connection: slave by position, variable by position in its description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Port {
    /// Position of the slave in [`System::slaves`].
    pub slave: usize,
    /// Position of the variable in `ModelVariables`.
    pub variable: usize,
}

/// A connection from an output to an input.
#[derive(Clone, Debug, PartialEq)]
pub struct Connection {
    /// The output.
    pub from: Port,
    /// The input.
    pub to: Port,
    /// What becomes of the value on its way, conversion of units included.
    pub transformation: Transformation,
}

/// Slaves and connections.
#[derive(Default)]
pub struct System {
    /// Name and instance, in the order of their addition.
    pub slaves: Vec<(String, Box<dyn Slave>)>,
    /// The connections.
    pub connections: Vec<Connection>,
    /// Connections to parameters, of use in initialization mode only.
    pub(crate) initial: Vec<Connection>,
    /// Values for variables that the FMUs get when they are initialised.
    pub(crate) settings: Vec<settings::Setting>,
    /// Variables of each slave by name.
    variables: Vec<HashMap<String, usize>>,
    /// Slaves by name.
    names: HashMap<String, usize>,
    /// Connection by its input.
    sources: HashMap<Port, usize>,
}

impl System {
    /// Adds a slave.
    ///
    /// # Errors
    ///
    /// Where there is one of that name already.
    pub fn add(&mut self, name: &str, slave: Box<dyn Slave>) -> Result<(), SystemError> {
        if self.names.insert(name.to_owned(), self.slaves.len()).is_some() {
            return Err(SystemError::SameName { name: name.to_owned() });
        }
        let variables = slave.description().variables.iter().enumerate();
        self.variables.push(variables.map(|(k, variable)| (variable.name.clone(), k)).collect());
        self.slaves.push((name.to_owned(), slave));
        Ok(())
    }

    /// The variable behind a port.
    #[must_use]
    pub fn variable(&self, port: Port) -> &ScalarVariable {
        &self.slaves[port.slave].1.description().variables[port.variable]
    }

    /// `slave.variable`.
    #[must_use]
    pub fn name(&self, port: Port) -> String {
        format!("{}.{}", self.slaves[port.slave].0, self.variable(port).name)
    }

    /// The port called `name`, `slave.variable`. Both may have dots in them: of the slaves whose
    /// name begins `name` and that have such a variable, the one with the longest name counts.
    ///
    /// # Errors
    ///
    /// Where the form is wrong, or slave or variable do not exist.
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
            let form = "slave.variable";
            return Err(SystemError::Syntax { text: name.to_owned(), form });
        };
        Err(self.unknown_slave(name, slave))
    }

    /// The port of the variable `variable` of the slave `slave`.
    ///
    /// # Errors
    ///
    /// Where slave or variable do not exist.
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

    /// The slave called `name`.
    ///
    /// # Errors
    ///
    /// Where there is none.
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

    /// Connects an output to an input, both `slave.variable`.
    ///
    /// # Errors
    ///
    /// Where one does not exist, causality, type or unit do not fit, or the input has a source.
    pub fn connect(&mut self, from: &str, to: &str) -> Result<(), SystemError> {
        let (from, to) = (self.port(from)?, self.port(to)?);
        self.connect_ports(from, to, Transformation::Identity, false)
    }

    /// Connects each output to the inputs of other slaves that have its name and no source yet;
    /// the number of connections made.
    ///
    /// # Errors
    ///
    /// As [`System::connect`], where names agree and types or units do not.
    pub fn connect_equal_names(&mut self) -> Result<usize, SystemError> {
        let before = self.connections.len();
        let mut inputs: HashMap<String, Vec<Port>> = HashMap::new();
        for to in self.ports(Causality::Input) {
            inputs.entry(self.variable(to).name.clone()).or_default().push(to);
        }
        for from in self.ports(Causality::Output) {
            let Some(same) = inputs.get(&self.variable(from).name) else { continue };
            for &to in same {
                if from.slave != to.slave && !self.sources.contains_key(&to) {
                    self.connect_ports(from, to, Transformation::Identity, false)?;
                }
            }
        }
        Ok(self.connections.len() - before)
    }

    /// Connects an output to an input of another FMU where each is the only free one of its unit in the
    /// whole system; the connections made.
    ///
    /// # Errors
    ///
    /// As [`System::connect`].
    pub fn connect_equal_units(&mut self) -> Result<Vec<Connection>, SystemError> {
        let before = self.connections.len();
        let (outputs, inputs) = (self.free_outputs(), self.free_inputs());
        let unit = |port: Port| self.dimension(port).map(str::to_owned);
        let units: Vec<_> = inputs.iter().map(|&input| unit(input)).collect();
        let sources: Vec<_> = outputs.iter().map(|&output| unit(output)).collect();
        for (&to, unit) in inputs.iter().zip(&units) {
            let same = |other: &&Option<String>| unit.is_some() && *other == unit;
            if units.iter().filter(same).count() != 1 || sources.iter().filter(same).count() != 1 {
                continue;
            }
            let from = sources.iter().position(|other| other == unit).map(|at| outputs[at]);
            if let Some(from) = from.filter(|from| from.slave != to.slave) {
                self.connect_ports(from, to, Transformation::Identity, false)?;
            }
        }
        Ok(self.connections[before..].to_vec())
    }

    /// Inputs without a connection.
    #[must_use]
    pub fn free_inputs(&self) -> Vec<Port> {
        let mut inputs = self.ports(Causality::Input);
        inputs.retain(|input| self.source(*input).is_none());
        inputs
    }

    /// Outputs without a connection.
    #[must_use]
    pub fn free_outputs(&self) -> Vec<Port> {
        let mut outputs = self.ports(Causality::Output);
        outputs.retain(|output| self.connections.iter().all(|known| known.from != *output));
        outputs
    }

    /// Outputs that may be connected to `input`: of other FMUs, free, of its type and its unit.
    #[must_use]
    pub fn candidates(&self, input: Port) -> Vec<Port> {
        let mut outputs = self.free_outputs();
        outputs.retain(|&output| {
            output.slave != input.slave
                && self.variable(output).kind.element() == self.variable(input).kind.element()
                && self.dimension(output) == self.dimension(input)
        });
        outputs
    }

    /// Every variable of that causality.
    #[must_use]
    pub fn ports(&self, causality: Causality) -> Vec<Port> {
        let of = |(slave, (_, instance)): (usize, &(String, Box<dyn Slave>))| {
            let variables = instance.description().variables.iter().enumerate();
            variables
                .filter(|(_, variable)| variable.causality == causality)
                .map(|(variable, _)| Port { slave, variable })
                .collect::<Vec<_>>()
        };
        self.slaves.iter().enumerate().flat_map(of).collect()
    }

    /// The connection that ends at that input.
    #[must_use]
    pub fn source(&self, input: Port) -> Option<&Connection> {
        self.sources.get(&input).map(|&position| &self.connections[position])
    }

    /// What `text` spells for that variable.
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

/// The error for a missing variable, with similar names.
fn unknown(name: &str, variable: &str, description: &ModelDescription) -> SystemError {
    SystemError::UnknownVariable {
        name: name.to_owned(),
        model: description.model_name.clone(),
        variable: variable.to_owned(),
        nearest: nearest(description, variable),
    }
}
