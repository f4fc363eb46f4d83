//! Reads and sets single variables of any type.

use super::{Port, System};
use crate::error::{SystemError, call};
use fmu_description::{Causality, CoSimulation};
use slave::{CallError, Slave, Transformation, Value, ValueType};

/// Reads the variable of a slave with this value reference and type.
///
/// # Errors
///
/// [`CallError`] if the FMU refuses the read.
pub fn read_value(
    slave: &mut dyn Slave,
    reference: u32,
    kind: ValueType,
) -> Result<Value, CallError> {
    let (mut real, mut integer, mut boolean) = ([0.0], [0], [0]);
    let (mut text, mut bytes) = ([String::new()], [Vec::new()]);
    match kind {
        ValueType::Real => slave.get_real(&[reference], &mut real)?,
        ValueType::Integer => slave.get_integer(&[reference], &mut integer)?,
        ValueType::Boolean => slave.get_boolean(&[reference], &mut boolean)?,
        ValueType::String => slave.get_string(&[reference], &mut text)?,
        ValueType::Binary => slave.get_binary(&[reference], &mut bytes)?,
    }
    let ([text], [bytes]) = (text, bytes);
    Ok(match kind {
        ValueType::Real => Value::Real(real[0]),
        ValueType::Integer => Value::Integer(integer[0]),
        ValueType::Boolean => Value::Boolean(boolean[0] != 0),
        ValueType::String => Value::String(text),
        ValueType::Binary => Value::Binary(bytes),
    })
}

impl System {
    /// Takes over the events of the slaves that hand them over. `stop`: their steps end at the first event.
    pub(crate) fn hand_over_events(&mut self, stop: bool, time: f64) -> Result<(), SystemError> {
        for ((name, slave), events) in self.slaves.iter_mut().zip(&mut self.events) {
            let handed = slave.hand_over_events(stop).map_err(|source| call(name, time, source))?;
            *events = handed && slave.events().is_some();
        }
        Ok(())
    }

    /// Performs `action` with a slave; an error names the slave and `time`, in s.
    pub(crate) fn perform<T>(
        &mut self,
        slave: usize,
        time: f64,
        action: impl FnOnce(&mut dyn Slave) -> Result<T, CallError>,
    ) -> Result<T, SystemError> {
        let (name, instance) = &mut self.slaves[slave];
        action(instance.as_mut()).map_err(|source| call(name, time, source))
    }

    /// Whether a slave has a capability.
    pub(crate) fn can(&self, slave: usize, can: fn(&CoSimulation) -> bool) -> bool {
        self.slaves[slave].1.description().co_simulation.as_ref().is_some_and(can)
    }

    /// Returns the name of the first slave without a capability.
    pub(crate) fn first_without(&self, can: fn(&CoSimulation) -> bool) -> Option<&str> {
        let unable = (0..self.slaves.len()).find(|&slave| !self.can(slave, can));
        unable.map(|slave| self.slaves[slave].0.as_str())
    }

    /// As [`System::get_value`]; an error names the slave and `time`, in s.
    pub(crate) fn read(&mut self, port: Port, time: f64) -> Result<Value, SystemError> {
        self.get_value(port).map_err(|source| call(&self.slaves[port.slave].0, time, source))
    }

    /// As [`System::read`], for a Real; NaN for a variable of another type.
    pub(crate) fn read_real(&mut self, port: Port, time: f64) -> Result<f64, SystemError> {
        let value = self.read(port, time)?;
        Ok(if let Value::Real(value) = value { value } else { f64::NAN })
    }

    /// Reads the variable at `port`.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the FMU refuses the read.
    pub fn get_value(&mut self, port: Port) -> Result<Value, CallError> {
        let variable = self.variable(port);
        let (reference, kind) = (variable.value_reference, ValueType::of(&variable.kind));
        read_value(self.slaves[port.slave].1.as_mut(), reference, kind)
    }

    /// Sets the variable at `port`; `value` has its type. Between two steps of a simulation, only an
    /// input without a connection or a tunable parameter keeps it.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the FMU refuses the value.
    pub fn set_value(&mut self, port: Port, value: &Value) -> Result<(), CallError> {
        let variable = self.variable(port);
        let (reference, causality) = ([variable.value_reference], variable.causality);
        let slave = &mut self.slaves[port.slave].1;
        match value {
            Value::Real(value) => slave.set_real(&reference, &[*value]),
            Value::Integer(value) => slave.set_integer(&reference, &[*value]),
            Value::Boolean(value) => slave.set_boolean(&reference, &[(*value).into()]),
            Value::String(value) => slave.set_string(&reference, std::slice::from_ref(value)),
            Value::Binary(value) => slave.set_binary(&reference, std::slice::from_ref(value)),
        }?;
        if causality == Causality::Input {
            self.input_values.insert(self.holder(port), value.clone());
            self.changes += 1;
        }
        Ok(())
    }

    /// Applies the transformation of a connection to `value`; the result has the type of `to`.
    pub(crate) fn transformed(
        &self,
        value: &Value,
        transformation: &Transformation,
        to: Port,
    ) -> Value {
        match (value, transformation) {
            (Value::Integer(value), Transformation::Integer(pairs)) => {
                Value::Integer(slave::mapped_integer(pairs, *value))
            }
            (Value::Boolean(value), Transformation::Boolean { from_false, from_true }) => {
                Value::Boolean(if *value { *from_true } else { *from_false })
            }
            (Value::Real(value), Transformation::Linear { factor, offset }) => {
                Value::Real(factor * value + offset)
            }
            (Value::Integer(value), _)
                if ValueType::of(&self.variable(to).kind) == ValueType::Real =>
            {
                let (factor, offset) = match transformation {
                    Transformation::Linear { factor, offset } => (*factor, *offset),
                    _ => (1.0, 0.0),
                };
                Value::Real(factor * slave::to_real(*value) + offset)
            }
            _ => value.clone(),
        }
    }
}
