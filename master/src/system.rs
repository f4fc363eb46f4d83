//! A system: slaves by name, the connections between them, and settings of variables by name.

use fmi2::description::{Causality, Kind, ModelDescription, ScalarVariable};

use crate::error::SystemError;
use crate::nearest::nearest;
use crate::slave::Slave;
use crate::value::Value;

/// One end of a connection: slave by position, variable by position in its description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Position of the slave in [`System::slaves`].
    pub slave: usize,
    /// Position of the variable in `ModelVariables`.
    pub variable: usize,
}

/// A connection from an output to an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Connection {
    /// The output.
    pub from: Port,
    /// The input.
    pub to: Port,
}

/// Slaves and connections.
#[derive(Default)]
pub struct System {
    /// Name and instance, in the order of their addition.
    pub slaves: Vec<(String, Box<dyn Slave>)>,
    /// The connections.
    pub connections: Vec<Connection>,
}

impl System {
    /// Adds a slave.
    pub fn add(&mut self, name: &str, slave: Box<dyn Slave>) {
        self.slaves.push((name.to_owned(), slave));
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

    /// The port called `name`, `slave.variable`.
    ///
    /// # Errors
    ///
    /// Where the form is wrong, or slave or variable do not exist.
    pub fn port(&self, name: &str) -> Result<Port, SystemError> {
        let Some((slave, variable)) = name.split_once('.') else {
            let form = "slave.variable";
            return Err(SystemError::Syntax { text: name.to_owned(), form });
        };
        let Some(position) = self.slaves.iter().position(|(known, _)| known == slave) else {
            let known: Vec<_> = self.slaves.iter().map(|(known, _)| known.as_str()).collect();
            return Err(SystemError::UnknownSlave {
                name: name.to_owned(),
                slave: slave.to_owned(),
                known: known.join(", "),
            });
        };
        let description = self.slaves[position].1.description();
        let variable = description
            .variables
            .iter()
            .position(|candidate| candidate.name == variable)
            .ok_or_else(|| unknown(name, variable, description))?;
        Ok(Port { slave: position, variable })
    }

    /// Connects an output to an input, both `slave.variable`.
    ///
    /// # Errors
    ///
    /// Where one does not exist, causality, type or unit do not fit, or the input has a source.
    pub fn connect(&mut self, from: &str, to: &str) -> Result<(), SystemError> {
        let connection = Connection { from: self.port(from)?, to: self.port(to)? };
        self.expect_causality(connection.from, Causality::Output)?;
        self.expect_causality(connection.to, Causality::Input)?;
        let (source, target) = (self.variable(connection.from), self.variable(connection.to));
        if source.kind.element() != target.kind.element() {
            return Err(SystemError::Role {
                name: to.to_owned(),
                found: format!("a variable of type {}", target.kind.element()),
                expected: format!("{} as {from}", source.kind.element()),
            });
        }
        if matches!(source.kind, Kind::String(_)) {
            return Err(SystemError::Role {
                name: from.to_owned(),
                found: "a String".to_owned(),
                expected: "a Real, Integer, Enumeration or Boolean".to_owned(),
            });
        }
        self.expect_equal_units(connection)?;
        if let Some(first) = self.connections.iter().find(|known| known.to == connection.to) {
            let (input, first) = (to.to_owned(), self.name(first.from));
            return Err(SystemError::Twice { input, first, second: from.to_owned() });
        }
        self.connections.push(connection);
        Ok(())
    }

    fn expect_causality(&self, port: Port, expected: Causality) -> Result<(), SystemError> {
        let found = self.variable(port).causality;
        if found == expected {
            return Ok(());
        }
        Err(SystemError::Role {
            name: self.name(port),
            found: format!("a variable of causality {}", found.as_str()),
            expected: expected.as_str().to_owned(),
        })
    }

    /// Units fit when one end has none, both have the same name, or the same base and factor.
    fn expect_equal_units(&self, connection: Connection) -> Result<(), SystemError> {
        let unit = |port: Port| {
            let Kind::Real(real) = &self.variable(port).kind else { return None };
            let name = real.unit.as_ref()?;
            let description = self.slaves[port.slave].1.description();
            let base = description.units.iter().find(|unit| unit.name == *name)?.base;
            Some((name, base))
        };
        let (Some(from), Some(to)) = (unit(connection.from), unit(connection.to)) else {
            return Ok(());
        };
        if from.0 == to.0 || (from.1.is_some() && from.1 == to.1) {
            return Ok(());
        }
        Err(SystemError::Unit {
            from: self.name(connection.from),
            from_unit: from.0.clone(),
            to: self.name(connection.to),
            to_unit: to.0.clone(),
        })
    }

    /// Connects each output to the inputs of other slaves that have its name and no source yet;
    /// the number of connections made.
    ///
    /// # Errors
    ///
    /// As [`System::connect`], where names agree and types or units do not.
    pub fn connect_equal_names(&mut self) -> Result<usize, SystemError> {
        let before = self.connections.len();
        for from in self.ports(Causality::Output) {
            for to in self.ports(Causality::Input) {
                let equal = self.variable(from).name == self.variable(to).name;
                let free = self.connections.iter().all(|known| known.to != to);
                if from.slave != to.slave && equal && free {
                    self.connect(&self.name(from), &self.name(to))?;
                }
            }
        }
        Ok(self.connections.len() - before)
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

    /// Sets the variable called `name` to the value that `text` spells.
    ///
    /// # Errors
    ///
    /// Where the variable does not exist, the text is no value of its type, or the FMU refuses it.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), SystemError> {
        let port = self.port(name)?;
        let (reference, kind) = {
            let variable = self.variable(port);
            (variable.value_reference, variable.kind.clone())
        };
        let value = Value::parse(&kind, text).map_err(|expected| SystemError::Value {
            name: name.to_owned(),
            value: text.to_owned(),
            expected,
        })?;
        let (_, instance) = &mut self.slaves[port.slave];
        let done = match value {
            Value::Real(value) => instance.set_real(&[reference], &[value]),
            Value::Integer(value) => instance.set_integer(&[reference], &[value]),
            Value::Boolean(value) => instance.set_boolean(&[reference], &[value.into()]),
            Value::String(value) => instance.set_string(&[reference], &[value]),
        };
        let (name, value) = (name.to_owned(), text.to_owned());
        done.map_err(|source| SystemError::Setting { name, value, source })
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
