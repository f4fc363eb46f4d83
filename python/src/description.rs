//! Model descriptions as dicts, which `aso_ftc` turns into dataclasses.

use std::path::PathBuf;

use fmu_description::package::Unpacked;
use fmu_description::{Elements, Kind, ModelDescription, ScalarVariable};
use pyo3::IntoPyObjectExt as _;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

use crate::error::{self, Exception};
use crate::guard::guarded;

/// Largest number of elements of an array whose start values are listed; the start value of a larger array is `None`.
const ELEMENTS: usize = 1_000_000;

/// Returns the model description of the FMU at `path` (an archive or a folder) as a dict. Its entry `warnings` lists
/// the warnings about the description and about the FMU.
#[pyfunction]
pub(crate) fn read_model_description(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let unpacked = guarded(py, || {
        if path.is_dir() { Unpacked::in_folder(&path) } else { Unpacked::open(&path) }
    })?;
    let unpacked = unpacked.map_err(|error| error::package(&error).raise(py))?;
    let described = describe(py, &unpacked.description)?;
    let warnings = unpacked.warnings.iter().map(ToString::to_string);
    let warnings: Vec<_> = unpacked.archive_warnings.iter().cloned().chain(warnings).collect();
    described.set_item("warnings", warnings)?;
    Ok(described)
}

/// Returns the path of an FMU with a library for this platform: `path`, or an FMU built from it if it has source code
/// only.
#[pyfunction]
pub(crate) fn compile(py: Python<'_>, path: PathBuf) -> PyResult<PathBuf> {
    let compiled = guarded(py, || fmu_import::compile(&path))?;
    compiled
        .map_err(|error| Exception::new("FmuError", "Compile", files::sentence(&error)).raise(py))
}

fn describe<'py>(py: Python<'py>, fmu: &ModelDescription) -> PyResult<Bound<'py, PyDict>> {
    let description = PyDict::new(py);
    description.set_item("fmi_version", &fmu.fmi_version)?;
    description.set_item("model_name", &fmu.model_name)?;
    description.set_item("guid", &fmu.guid)?;
    description.set_item("description", &fmu.description)?;
    description.set_item("author", &fmu.author)?;
    description.set_item("version", &fmu.version)?;
    description.set_item("copyright", &fmu.copyright)?;
    description.set_item("license", &fmu.license)?;
    description.set_item("generation_tool", &fmu.generation_tool)?;
    description.set_item("generation_date_and_time", &fmu.generation_date_and_time)?;
    let mut interfaces = Vec::new();
    interfaces.extend(fmu.co_simulation.as_ref().map(|_| "co-simulation"));
    interfaces.extend(fmu.model_exchange.as_ref().map(|_| "model-exchange"));
    interfaces.extend(fmu.scheduled_execution.as_ref().map(|_| "scheduled-execution"));
    description.set_item("interfaces", interfaces)?;
    let co_simulation = fmu.co_simulation.as_ref().map(|flags| &flags.model_identifier);
    let model_exchange = fmu.model_exchange.as_ref().map(|flags| &flags.model_identifier);
    let scheduled = fmu.scheduled_execution.as_ref().map(|flags| &flags.model_identifier);
    let identifier = co_simulation.or(model_exchange).or(scheduled);
    description.set_item("model_identifier", identifier)?;
    description.set_item("capabilities", capabilities(py, fmu)?)?;
    let experiment = fmu.default_experiment.unwrap_or_default();
    let default = PyDict::new(py);
    default.set_item("start_time", experiment.start_time)?;
    default.set_item("stop_time", experiment.stop_time)?;
    default.set_item("tolerance", experiment.tolerance)?;
    default.set_item("step_size", experiment.step_size)?;
    description.set_item("default_experiment", default)?;
    let variables = PyList::empty(py);
    for declared in &fmu.variables {
        variables.append(variable(py, declared, fmu)?)?;
    }
    description.set_item("variables", variables)?;
    Ok(description)
}

/// Returns the capability flags of co-simulation, by the names of FMI 2.0; none without co-simulation.
fn capabilities<'py>(py: Python<'py>, fmu: &ModelDescription) -> PyResult<Bound<'py, PyDict>> {
    let capabilities = PyDict::new(py);
    if let Some(flags) = &fmu.co_simulation {
        for (name, flag) in [
            ("needsExecutionTool", flags.needs_execution_tool),
            (
                "canHandleVariableCommunicationStepSize",
                flags.can_handle_variable_communication_step_size,
            ),
            ("canInterpolateInputs", flags.can_interpolate_inputs),
            (
                "canBeInstantiatedOnlyOncePerProcess",
                flags.can_be_instantiated_only_once_per_process,
            ),
            ("canGetAndSetFMUstate", flags.can_get_and_set_fmu_state),
            ("canSerializeFMUstate", flags.can_serialize_fmu_state),
            ("providesDirectionalDerivative", flags.provides_directional_derivative),
        ] {
            capabilities.set_item(name, flag)?;
        }
    }
    Ok(capabilities)
}

/// Returns a variable of `description` as a dict.
pub(crate) fn variable(
    py: Python<'_>,
    declared: &ScalarVariable,
    description: &ModelDescription,
) -> PyResult<Py<PyDict>> {
    let variable = PyDict::new(py);
    variable.set_item("name", &declared.name)?;
    variable.set_item("value_reference", declared.value_reference)?;
    variable.set_item("type", declared.kind.element_in(description.version()))?;
    variable.set_item("causality", declared.causality.as_str())?;
    variable.set_item("variability", declared.variability.as_str())?;
    variable
        .set_item("initial", declared.initial_in_force().map(fmu_description::Initial::as_str))?;
    variable.set_item("description", &declared.description)?;
    variable.set_item("declared_type", declared.kind.declared_type())?;
    variable.set_item("shape", declared.extents(description))?;
    variable.set_item("start", start(py, declared, description)?)?;
    let real = declared.kind.as_real();
    variable.set_item("unit", real.and_then(|real| real.unit.as_ref()))?;
    variable.set_item("nominal", real.and_then(|real| real.nominal))?;
    match (real, declared.kind.as_integer()) {
        (Some(real), _) => {
            variable.set_item("min", real.min)?;
            variable.set_item("max", real.max)?;
        }
        (_, integer) => {
            variable.set_item("min", integer.and_then(|integer| integer.min))?;
            variable.set_item("max", integer.and_then(|integer| integer.max))?;
        }
    }
    Ok(variable.unbind())
}

/// Returns the start value, for an array a list of its elements in row-major order; `None` without a start value and
/// for an array with more than [`ELEMENTS`] elements.
fn start<'py>(
    py: Python<'py>,
    declared: &ScalarVariable,
    description: &ModelDescription,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(elements) = declared.start_values(description, ELEMENTS) else { return Ok(None) };
    let list = match elements {
        Elements::Real(values) => PyList::new(py, values)?,
        Elements::Integer(values) => PyList::new(py, values)?,
        Elements::Boolean(values) => PyList::new(py, values)?,
        Elements::String(values) => PyList::new(py, values)?,
        Elements::Binary(values) => {
            PyList::new(py, values.iter().map(|bytes| PyBytes::new(py, bytes)))?
        }
    };
    let is_scalar = declared.dimensions.is_empty() || matches!(declared.kind, Kind::Clock(_));
    match list.len() {
        1 if is_scalar => Ok(Some(list.get_item(0)?)),
        _ => list.into_bound_py_any(py).map(Some),
    }
}
