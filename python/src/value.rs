//! Values of variables between Python and a system.

use fmu_description::{Causality, Variability};
use master::{Port, System, SystemError, Value, ValueType};
use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyString};
use slave::CallError;

use crate::error::{self, Exception};

/// Returns the port of an input without a connection or of a tunable parameter. Any other name is an error.
pub(crate) fn settable(system: &System, name: &str) -> Result<Port, Exception> {
    let port = system.port(name).map_err(|error| error::system(&error))?;
    let variable = system.variable(port);
    let is_input = variable.causality == Causality::Input;
    let is_tunable =
        variable.causality == Causality::Parameter && variable.variability == Variability::Tunable;
    let actual = match system.source(port) {
        Some(connection) => format!("is connected to {}", system.name(connection.from)),
        None if is_input || is_tunable => return Ok(port),
        None => {
            let (variability, causality) = (variable.variability, variable.causality);
            format!("has causality {} and variability {}", causality.as_str(), variability.as_str())
        }
    };
    let expected = "an input without a connection or a tunable parameter";
    let sentence = format!("{name} {actual}, expected {expected}");
    Err(Exception::new("ConfigurationError", "Role", sentence))
}

/// Sets a variable to a value of Python. An error of the FMU states `time` in s; a value of the wrong type raises a
/// `ConfigurationError`.
pub(crate) fn set(
    system: &mut System,
    port: Port,
    value: &Bound<'_, PyAny>,
    time: f64,
) -> PyResult<()> {
    let converted = match ValueType::of(&system.variable(port).kind) {
        ValueType::Real => value.extract().map(Value::Real),
        ValueType::Integer => value.extract().map(Value::Integer),
        ValueType::Boolean if value.is_instance_of::<PyString>() => {
            Err(PyTypeError::new_err("expected True or False, found a text"))
        }
        // Requires a number, because any object has a truth value, also None and a list.
        ValueType::Boolean => value.extract().map(|number: f64| Value::Boolean(number != 0.0)),
        ValueType::String => value.extract().map(Value::String),
        ValueType::Binary => value.extract().map(Value::Binary),
    };
    let py = value.py();
    let converted = converted.map_err(|cause| {
        let sentence = format!("{} cannot be set to {value}", system.name(port));
        let error = Exception::new("ConfigurationError", "Value", sentence).raise(py);
        error.set_cause(py, Some(cause));
        error
    })?;
    if let Value::String(text) = &converted
        && let Err(expected) = Value::parse(&system.variable(port).kind, &[], text)
    {
        let (name, value) = (system.name(port), text.clone());
        return Err(error::system(&SystemError::Value { name, value, expected }).raise(py));
    }
    system.set_value(port, &converted).map_err(|source| failed(py, system, port, time, source))
}

/// Returns the exception for a call of the FMU that failed.
fn failed(py: Python<'_>, system: &System, port: Port, time: f64, source: CallError) -> PyErr {
    let slave = system.slaves[port.slave].0.clone();
    error::system(&SystemError::Call { slave, time, source }).raise(py)
}

/// Reads a variable. An error of the FMU states `time` in s.
pub(crate) fn get<'py>(
    py: Python<'py>,
    system: &mut System,
    port: Port,
    time: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let value = system.get_value(port);
    match value.map_err(|source| failed(py, system, port, time, source))? {
        Value::Real(value) => value.into_bound_py_any(py),
        Value::Integer(value) => value.into_bound_py_any(py),
        Value::Boolean(value) => value.into_bound_py_any(py),
        Value::String(value) => value.into_bound_py_any(py),
        Value::Binary(value) => Ok(PyBytes::new(py, &value).into_any()),
    }
}
