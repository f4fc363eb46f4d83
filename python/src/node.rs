//! Structured values between Python and TOML, which keep the order of their entries.

use std::fmt;

use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use study::config::Ordered;

/// Largest depth of nested values that are converted.
const DEPTH: usize = 32;

/// A value of TOML.
#[derive(Serialize)]
#[serde(untagged)]
pub(crate) enum Node {
    Boolean(bool),
    Integer(i64),
    Real(f64),
    Text(String),
    List(Vec<Node>),
    Table(Ordered<Node>),
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value of TOML")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Boolean(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Integer(value))
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Node, E> {
        i64::try_from(value).map(Node::Integer).map_err(|_| E::custom("the integer is too large"))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Real(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Text(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Node, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(list)).map(Node::List)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Node, A::Error> {
        Ordered::deserialize(MapAccessDeserializer::new(map)).map(Node::Table)
    }
}

impl Node {
    /// Returns the text of a TOML file that is given as text or as nested dicts.
    pub(crate) fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
        value.extract().or_else(|_| Self::from_python(value)?.render())
    }

    /// Reads the text of a TOML file.
    pub(crate) fn parse(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }

    /// Writes the text of a TOML file.
    pub(crate) fn render(&self) -> PyResult<String> {
        toml::to_string(self).map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Converts a Python object: a mapping, a list or another iterable, a number, bool, str, path, or an object of
    /// `NumPy`. An entry of a dict that is `None` counts as absent.
    ///
    /// # Errors
    ///
    /// `TypeError` for any other object and for a key that is no str, `ValueError` for an integer beyond 64 bits and
    /// for more than [`DEPTH`] nested values; the message states the place of the value.
    pub(crate) fn from_python(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        convert(value, "", 0)
    }

    /// Converts the value to bool, int, float, str, list or dict of Python.
    pub(crate) fn to_python<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self {
            Self::Boolean(value) => value.into_bound_py_any(py),
            Self::Integer(value) => value.into_bound_py_any(py),
            Self::Real(value) => value.into_bound_py_any(py),
            Self::Text(value) => value.into_bound_py_any(py),
            Self::List(values) => {
                let values: PyResult<Vec<_>> =
                    values.iter().map(|value| value.to_python(py)).collect();
                Ok(PyList::new(py, values?)?.into_any())
            }
            Self::Table(entries) => {
                let table = PyDict::new(py);
                for (name, value) in &entries.0 {
                    table.set_item(name, value.to_python(py)?)?;
                }
                Ok(table.into_any())
            }
        }
    }
}

/// Returns the message `what` after the place of the value in question; the outermost value has no place.
fn at(place: &str, what: &str) -> String {
    if place.is_empty() { what.to_owned() } else { format!("{place}: {what}") }
}

/// Converts the value at `place`, which is nested in `depth` values.
fn convert(value: &Bound<'_, PyAny>, place: &str, depth: usize) -> PyResult<Node> {
    if depth > DEPTH {
        return Err(PyValueError::new_err(at(place, &format!("more than {DEPTH} nested values"))));
    }
    // A bool is an int in Python.
    if let Ok(boolean) = value.cast::<PyBool>() {
        return Ok(Node::Boolean(boolean.is_true()));
    }
    if value.is_instance_of::<PyInt>() {
        let integer = value.extract().map_err(|_| {
            let what = format!("expected an integer of 64 bits, found {value}");
            PyValueError::new_err(at(place, &what))
        })?;
        return Ok(Node::Integer(integer));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Node::Real(value.extract()?));
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Node::Text(value.extract()?));
    }
    if let Ok(mapping) = value.cast::<PyMapping>() {
        return table(mapping, place, depth);
    }
    if value.hasattr("__fspath__")? {
        return Ok(Node::Text(
            value.extract::<std::path::PathBuf>()?.to_string_lossy().into_owned(),
        ));
    }
    if value.hasattr("tolist")? {
        return convert(&value.call_method0("tolist")?, place, depth + 1);
    }
    let Ok(items) = value.try_iter() else {
        let kind = value.get_type().name()?;
        let what = format!("expected a bool, a number, a text, a list or a dict, found {kind}");
        return Err(PyTypeError::new_err(at(place, &what)));
    };
    let items = items.enumerate();
    let list = items.map(|(k, item)| convert(&item?, &format!("{place}[{k}]"), depth + 1));
    Ok(Node::List(list.collect::<PyResult<_>>()?))
}

fn table(mapping: &Bound<'_, PyMapping>, place: &str, depth: usize) -> PyResult<Node> {
    let mut entries = Vec::new();
    for item in mapping.items()?.iter() {
        let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        if value.is_none() {
            continue;
        }
        let Ok(key) = key.extract::<String>() else {
            return Err(PyTypeError::new_err(at(place, &format!("the key {key} is not a text"))));
        };
        let inner = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
        entries.push((key, convert(&value, &inner, depth + 1)?));
    }
    Ok(Node::Table(Ordered(entries)))
}
