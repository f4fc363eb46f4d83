//! Arrays: each element is a variable `name[1,2]`; connections and settings may name the whole array.

use super::{Connection, Port, System, by_name};
use crate::error::SystemError;
use fmu_description::Causality;
use slave::{Transformation, Value, ValueType};

/// The meaning of a name: a variable, or the elements of an array with their indices.
enum Named {
    One(Port),
    Array(Vec<(String, Port)>),
}

impl Named {
    /// Returns the size for a message.
    fn size(&self) -> String {
        match self {
            Named::One(_) => "a scalar".to_owned(),
            Named::Array(elements) => {
                let last = elements.last().map_or("[0]", |(indices, _)| indices.as_str());
                format!("an array of size {last}")
            }
        }
    }
}

/// Returns the name of the first element of `named`, which is called `name`, if it is an array.
fn first_element(name: &str, named: &Named) -> Option<String> {
    let Named::Array(elements) = named else { return None };
    elements.first().map(|(indices, _)| format!("{name}{indices}"))
}

/// Whether `text` has the form of indices: `[1,2]`.
fn is_indices(text: &str) -> bool {
    text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).is_some_and(|inner| {
        inner.split(',').all(|index| !index.is_empty() && index.bytes().all(|b| b.is_ascii_digit()))
    })
}

impl System {
    /// Returns the variable or the elements of the array that a name `slave.variable` denotes.
    fn named(&self, name: &str) -> Result<Named, SystemError> {
        let error = match self.port(name) {
            Ok(port) => return Ok(Named::One(port)),
            Err(error) => error,
        };
        let splits = name.match_indices('.').rev();
        let elements = splits.filter_map(|(at, _)| {
            let slave = *self.names.get(&name[..at])?;
            Some(self.elements(slave, &name[at + 1..])).filter(|elements| !elements.is_empty())
        });
        elements.map(Named::Array).next().ok_or(error)
    }

    /// Returns the elements of the array `variable`, with their indices, in the order of the description.
    fn elements(&self, slave: usize, variable: &str) -> Vec<(String, Port)> {
        let variables = self.slaves[slave].1.description().variables.iter().enumerate();
        let element = |(position, element): (usize, &fmu_description::ScalarVariable)| {
            let indices = element.name.strip_prefix(variable).filter(|rest| is_indices(rest))?;
            Some((indices.to_owned(), Port { slave, variable: position }))
        };
        variables.filter_map(element).collect()
    }

    /// Returns the pairs of output and input that a connection from `from` to `to` consists of, both in
    /// the form `slave.variable`: one pair for two scalars, one for each element of two arrays of equal
    /// size, or one for each pair of members of two terminals. An array of one element counts as a scalar.
    ///
    /// # Errors
    ///
    /// Returns an error if a variable does not exist, if the sizes differ, or if the terminals do not match.
    pub fn pairs(&self, from: &str, to: &str) -> Result<Vec<(Port, Port)>, SystemError> {
        let (source, target) = match (self.named(from), self.named(to)) {
            (Ok(source), Ok(target)) => (source, target),
            (Err(error), _) | (_, Err(error)) => {
                return self.pairs_of_terminals(from, to)?.ok_or(error);
            }
        };
        let only = |named: &Named| match named {
            Named::One(port) => Some(*port),
            Named::Array(elements) if elements.len() == 1 => Some(elements[0].1),
            Named::Array(_) => None,
        };
        let pairs = match (&source, &target) {
            (Named::Array(sources), Named::Array(targets))
                if sources.len() == targets.len() && sources.len() > 1 =>
            {
                let partner = |indices: &String| {
                    let target = targets.iter().find(|(other, _)| other == indices);
                    target.map(|(_, port)| *port)
                };
                let pair = |(position, (indices, port)): (usize, &(String, Port))| {
                    // Usually both arrays have their elements in the same order.
                    let same = targets[position].0 == *indices;
                    Some((*port, if same { targets[position].1 } else { partner(indices)? }))
                };
                sources.iter().enumerate().map(pair).collect()
            }
            _ => only(&source).zip(only(&target)).map(|pair| vec![pair]),
        };
        pairs.ok_or_else(|| SystemError::Size {
            from: from.to_owned(),
            from_size: source.size(),
            to: to.to_owned(),
            to_size: target.size(),
            element: first_element(from, &source)
                .or_else(|| first_element(to, &target))
                .unwrap_or_default()
                .into_boxed_str(),
        })
    }

    /// As [`System::pairs`], with separate names of slave and variable.
    ///
    /// # Errors
    ///
    /// Same as [`System::pairs`].
    pub fn terminal_pairs(
        &self,
        from: (&str, &str),
        to: (&str, &str),
    ) -> Result<Vec<(Port, Port)>, SystemError> {
        match (self.terminal(from.0, from.1), self.terminal(to.0, to.1)) {
            (Ok(from), Ok(to)) => Ok(vec![(from, to)]),
            (Err(error), _) | (_, Err(error)) => {
                let name = |(slave, variable): (&str, &str)| format!("{slave}.{variable}");
                let is_array = |(slave, variable): (&str, &str)| {
                    let slave = self.names.get(slave);
                    slave.is_some_and(|slave| !self.elements(*slave, variable).is_empty())
                };
                if is_array(from) || is_array(to) {
                    self.pairs(&name(from), &name(to))
                } else {
                    self.pairs_of_terminals(&name(from), &name(to))?.ok_or(error)
                }
            }
        }
    }

    /// Connects an output to an input, the elements of two arrays of equal size, or the members of two
    /// terminals; both in the form `slave.variable`.
    ///
    /// # Errors
    ///
    /// Returns an error if a variable does not exist, if causality, type, unit or size do not fit, if
    /// terminals do not match, or if an input already has a source.
    pub fn connect(&mut self, from: &str, to: &str) -> Result<(), SystemError> {
        for (from, to) in self.pairs(from, to)? {
            self.connect_ports(from, to, Transformation::Identity, false)?;
        }
        Ok(())
    }

    /// Sets the variable called `name` to the value of `text`. The FMU receives it when the
    /// simulation is initialised. A later setting of the same variable replaces it.
    ///
    /// A whole array gets one value for each element in row-major order, separated by blanks, commas,
    /// semicolons or brackets, or one value for all elements. A structural parameter is set at once, and
    /// arrays change their sizes; set it before connections and settings of their elements.
    ///
    /// # Errors
    ///
    /// Returns an error if the variable does not exist, if the standard allows nobody to set it, if `text`
    /// is not a value of its type, if the number of values is neither 1 nor the number of elements, for an
    /// array of Strings, if a structural parameter is neither an integer nor a Boolean, or if the FMU refuses it or
    /// loses a connected or set element by it.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), SystemError> {
        let elements = match self.named(name)? {
            Named::One(port) => return self.set_port(port, text),
            Named::Array(elements) => elements,
        };
        let wrong = |expected: String| SystemError::Value {
            name: name.to_owned(),
            value: text.to_owned(),
            expected,
        };
        let kind = ValueType::of(&self.variable(elements[0].1).kind);
        if kind == ValueType::String {
            return Err(wrong(format!(
                "a setting for each element, such as {name}{}, as the elements are Strings",
                elements[0].0
            )));
        }
        let separator = |letter: char| letter.is_whitespace() || ",;[]".contains(letter);
        let values: Vec<&str> = text.split(separator).filter(|value| !value.is_empty()).collect();
        if values.len() != 1 && values.len() != elements.len() {
            let count = elements.len();
            return Err(wrong(format!("{count} values or one for all, found {}", values.len())));
        }
        for (position, (indices, _)) in elements.into_iter().enumerate() {
            // A structural parameter moves the ports of further elements.
            let port = self.port(&format!("{name}{indices}"))?;
            self.set_port(port, values[position % values.len()])?;
        }
        Ok(())
    }

    /// Whether the variable called `name` is a structural parameter, which must be set before others.
    #[must_use]
    pub fn is_structural(&self, name: &str) -> bool {
        let port = self.port(name);
        port.is_ok_and(|port| self.variable(port).causality == Causality::StructuralParameter)
    }

    /// Sets a structural parameter now; an error if it is neither an integer nor a Boolean. Arrays of the slave change
    /// their sizes; ports move with their names.
    pub(super) fn configure(
        &mut self,
        port: Port,
        value: &Value,
        text: &str,
    ) -> Result<(), SystemError> {
        let number = match value {
            Value::Integer(value) => *value,
            Value::Boolean(value) => i64::from(*value),
            _ => {
                return Err(SystemError::Role {
                    name: self.name(port),
                    actual: format!("a structural parameter of type {}", self.type_name(port)),
                    expected: "an integer or a Boolean, as no other one can be set".to_owned(),
                });
            }
        };
        let name = self.name(port);
        let description = self.slaves[port.slave].1.description();
        let before: Vec<String> =
            description.variables.iter().map(|variable| variable.name.clone()).collect();
        let reference = self.variable(port).value_reference;
        let slave = &mut self.slaves[port.slave].1;
        slave.configure(&[reference], &[number]).map_err(|source| SystemError::Setting {
            name,
            value: text.to_owned(),
            source,
        })?;
        self.variables[port.slave] = by_name(slave.description());
        self.move_ports(port.slave, &before)
    }

    /// Replaces the ports of a slave, whose variables had the names `before`; an error if a connected or set variable
    /// does not exist any more.
    fn move_ports(&mut self, slave: usize, before: &[String]) -> Result<(), SystemError> {
        let (slave_name, variables) = (&self.slaves[slave].0, &self.variables[slave]);
        let move_port = |port: &mut Port| -> Result<(), SystemError> {
            if port.slave != slave {
                return Ok(());
            }
            let name = &before[port.variable];
            port.variable = *variables
                .get(name)
                .ok_or_else(|| SystemError::Resized { name: format!("{slave_name}.{name}") })?;
            Ok(())
        };
        for Connection { from, to, .. } in self.connections.iter_mut().chain(&mut self.initial) {
            move_port(from)?;
            move_port(to)?;
        }
        for setting in &mut self.settings {
            move_port(&mut setting.port)?;
        }
        let connections = self.connections.iter().enumerate();
        self.sources = connections
            .map(|(position, connection)| (self.holder(connection.to), position))
            .collect();
        let settings = self.settings.iter().enumerate();
        self.setting_positions =
            settings.map(|(position, setting)| (self.holder(setting.port), position)).collect();
        Ok(())
    }
}
