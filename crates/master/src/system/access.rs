//! Reads and sets single variables of any type.

use fmu_description::Kind;

use super::{Port, System};
use slave::CallError;
use slave::Transformation;
use slave::Value;

impl System {
    /// Reads the variable at `port`.
    pub(crate) fn get_value(&mut self, port: Port) -> Result<Value, CallError> {
        let variable = self.variable(port);
        let (reference, element) = ([variable.value_reference], variable.kind.element());
        let slave = &mut self.slaves[port.slave].1;
        let (mut real, mut integer, mut text) = ([0.0], [0], [String::new()]);
        match element {
            "Real" => slave.get_real(&reference, &mut real).map(|()| Value::Real(real[0])),
            "Boolean" => {
                slave.get_boolean(&reference, &mut integer)?;
                Ok(Value::Boolean(integer[0] != 0))
            }
            "String" => {
                slave.get_string(&reference, &mut text)?;
                Ok(Value::String(std::mem::take(&mut text[0])))
            }
            _ => slave.get_integer(&reference, &mut integer).map(|()| Value::Integer(integer[0])),
        }
    }

    /// Sets the variable at `port`; `value` has its type.
    pub(crate) fn set_value(&mut self, port: Port, value: &Value) -> Result<(), CallError> {
        let reference = [self.variable(port).value_reference];
        let slave = &mut self.slaves[port.slave].1;
        match value {
            Value::Real(value) => slave.set_real(&reference, &[*value]),
            Value::Integer(value) => slave.set_integer(&reference, &[*value]),
            Value::Boolean(value) => slave.set_boolean(&reference, &[(*value).into()]),
            Value::String(value) => slave.set_string(&reference, std::slice::from_ref(value)),
        }
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
                let pair = pairs.iter().find(|(from, _)| from == value);
                Value::Integer(pair.map_or(*value, |(_, to)| *to))
            }
            (Value::Boolean(value), Transformation::Boolean { from_false, from_true }) => {
                Value::Boolean(if *value { *from_true } else { *from_false })
            }
            (Value::Real(value), Transformation::Linear { factor, offset }) => {
                Value::Real(factor * value + offset)
            }
            (Value::Integer(value), _) if matches!(self.variable(to).kind, Kind::Real(_)) => {
                let (factor, offset) = match transformation {
                    Transformation::Linear { factor, offset } => (*factor, *offset),
                    _ => (1.0, 0.0),
                };
                Value::Real(factor * f64::from(*value) + offset)
            }
            _ => value.clone(),
        }
    }
}
