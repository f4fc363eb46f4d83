//! Python objects as slaves.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

use fmu_description::abi::Status;
use fmu_description::{
    Causality, CoSimulation, Experiment, IntegerType, Kind, ModelDescription, ModelStructure,
    RealType, ScalarVariable, Unknown, Variability,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyString};
use slave::{CallError, Failure, Slave, StepResult};

/// The exception that a Python object raised last, so that the run can raise it as the cause.
pub(crate) type Raised = Arc<Mutex<Option<PyErr>>>;

/// A Python object that steps together with FMUs.
pub(crate) struct PythonSlave {
    object: Py<PyAny>,
    description: ModelDescription,
    /// Positions of the inputs and outputs among the variables.
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    /// Values of all variables; a Boolean is 0 or 1.
    values: Vec<f64>,
    /// Start time in s.
    start: f64,
    raised: Raised,
    /// For each slot, the saved values and the saved state of the Python object.
    saved: Vec<Option<(Vec<f64>, Py<PyAny>)>>,
    /// Whether the object still has to be stopped: true from `start` until `stop`.
    is_started: bool,
}

impl PythonSlave {
    /// Creates a slave from `object`. The attributes `inputs` and `outputs` of the object are names, or a mapping of
    /// names to start values (`float`, `int` or `bool`, also of `NumPy`); without a start value, a variable is the
    /// `float` 0. The attribute `direct` (default true) says whether outputs depend on the inputs of the same time.
    /// With functions `save` and `restore` the slave can save its state.
    ///
    /// # Errors
    ///
    /// `TypeError` if the object has no function `step`, an attribute is a text or a start value is no number;
    /// `ValueError` if a start value is an array of several elements or an integer beyond 32 bits, or if two variables
    /// have the same name; any exception that the object raises.
    pub(crate) fn new(name: &str, object: &Bound<'_, PyAny>, raised: Raised) -> PyResult<Self> {
        if !object.hasattr("step")? {
            let kind = object.get_type().name()?;
            let what =
                format!("{name}: a slave needs a function step(t, dt, inputs), {kind} has none");
            return Err(PyTypeError::new_err(what));
        }
        let mut variables = Vec::new();
        let mut values = Vec::new();
        let mut names = HashSet::new();
        for (attribute, causality) in [("inputs", Causality::Input), ("outputs", Causality::Output)]
        {
            for (variable_name, start) in declarations(object, attribute)? {
                if !names.insert(variable_name.clone()) {
                    let what = format!(
                        "{name}: two variables are called {variable_name}, expected different names"
                    );
                    return Err(PyValueError::new_err(what));
                }
                if let Start::Integer(value) = start {
                    check_integer("the start value of", &variable_name, value)
                        .map_err(PyValueError::new_err)?;
                }
                let reference = u32::try_from(variables.len()).unwrap_or(u32::MAX);
                values.push(start.number());
                variables.push(variable(variable_name, reference, causality, start));
            }
        }
        let all = |causality| {
            let numbered = variables.iter().enumerate();
            numbered
                .filter(|(_, variable): &(_, &ScalarVariable)| variable.causality == causality)
                .map(|(k, _)| k)
                .collect::<Vec<_>>()
        };
        let (inputs, outputs) = (all(Causality::Input), all(Causality::Output));
        let direct = match object.getattr_opt("direct")? {
            Some(direct) => direct.is_truthy()?,
            None => true,
        };
        let can_save = object.hasattr("save")? && object.hasattr("restore")?;
        let structure = structure(&inputs, &outputs, direct);
        let description = describe(name, variables, structure, can_save);
        let object = object.clone().unbind();
        let (start, saved, is_started) = (0.0, Vec::new(), false);
        Ok(Self { object, description, inputs, outputs, values, start, raised, saved, is_started })
    }

    /// Runs `call` with the object. An exception becomes an error of `function`; `raised` then has the exception.
    fn call<T>(
        &self,
        function: &'static str,
        call: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>,
    ) -> Result<T, CallError> {
        Python::attach(|py| {
            call(self.object.bind(py)).map_err(|error| {
                let text = error.to_string();
                *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                let failure = Failure::InvalidAnswer(format!("raised {text}"));
                CallError { function, failure, messages: Vec::new() }
            })
        })
    }

    /// Returns the values of the inputs by name, in their types.
    fn input_values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inputs = PyDict::new(py);
        for &position in &self.inputs {
            let variable = &self.description.variables[position];
            set(&inputs, variable, self.values[position])?;
        }
        Ok(inputs)
    }

    /// Returns position and value of each output in the dict that a call returned; nothing for `None`. An unknown name
    /// is an error; so is a value that is no integer of 32 bits if the output starts with an integer.
    fn read_outputs(&self, answer: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, f64)>> {
        if answer.is_none() {
            return Ok(Vec::new());
        }
        let Ok(answer) = answer.cast::<PyMapping>() else {
            let kind = answer.get_type().name()?;
            let what = format!("expected a dict of outputs or None, found {kind}");
            return Err(PyTypeError::new_err(what));
        };
        let mut outputs = Vec::new();
        for item in answer.items()?.iter() {
            let (name, value): (String, Bound<'_, PyAny>) = item.extract()?;
            let has_name = |position: &&usize| self.description.variables[**position].name == name;
            let Some(&position) = self.outputs.iter().find(has_name) else {
                let name_of =
                    |position: &usize| self.description.variables[*position].name.as_str();
                let known: Vec<_> = self.outputs.iter().map(name_of).collect();
                let what = format!("no output {name}, expected one of {}", known.join(", "));
                return Err(PyValueError::new_err(what));
            };
            let value = number("the output", &name, &value)?;
            if matches!(self.description.variables[position].kind, Kind::Integer(_)) {
                check_integer("the output", &name, value).map_err(PyValueError::new_err)?;
            }
            outputs.push((position, value));
        }
        Ok(outputs)
    }

    /// Sets the values at the given positions.
    fn store(&mut self, outputs: Vec<(usize, f64)>) {
        for (position, value) in outputs {
            self.values[position] = value;
        }
    }

    /// Reads and converts the values of `references`; an unknown reference has NaN.
    fn read<T>(&self, references: &[u32], values: &mut [T], convert: impl Fn(f64) -> T) {
        for (reference, value) in references.iter().zip(values) {
            let known = usize::try_from(*reference).ok().and_then(|k| self.values.get(k));
            *value = convert(known.copied().unwrap_or(f64::NAN));
        }
    }

    /// Writes the values of `references`; ignores an unknown one.
    fn write(&mut self, references: &[u32], values: impl Iterator<Item = f64>) {
        for (reference, value) in references.iter().zip(values) {
            let place = usize::try_from(*reference).ok().and_then(|k| self.values.get_mut(k));
            if let Some(place) = place {
                *place = value;
            }
        }
    }
}

impl Slave for PythonSlave {
    fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.start = experiment.start_time;
        Ok(())
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        let start = self.start;
        let outputs = self.call("start", |object| match object.getattr_opt("start")? {
            Some(function) => {
                let inputs = self.input_values(object.py())?;
                self.read_outputs(&function.call1((start, inputs))?)
            }
            None => Ok(Vec::new()),
        })?;
        self.store(outputs);
        self.is_started = true;
        Ok(())
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.is_started = false;
        self.call("stop", stop)
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.read(references, values, |value| value);
        Ok(())
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.write(references, values.iter().copied());
        Ok(())
    }

    #[expect(clippy::cast_possible_truncation, reason = "an integer")]
    fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Result<(), CallError> {
        self.read(references, values, |value| value as i64);
        Ok(())
    }

    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        for (&reference, &value) in references.iter().zip(values) {
            let variable = self.description.variables.get(reference as usize);
            let name = variable.map_or("", |variable| variable.name.as_str());
            check_integer("the input", name, slave::to_real(value)).map_err(|what| {
                let failure = Failure::InvalidAnswer(format!("was not called: {what}"));
                CallError { function: "step", failure, messages: Vec::new() }
            })?;
        }
        self.write(references, values.iter().map(|value| slave::to_real(*value)));
        Ok(())
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.read(references, values, |value| i32::from(value != 0.0));
        Ok(())
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.write(references, values.iter().map(|value| f64::from(*value != 0)));
        Ok(())
    }

    fn do_step(&mut self, time: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        let outputs = self.call("step", |object| {
            let inputs = self.input_values(object.py())?;
            self.read_outputs(&object.call_method1("step", (time, size, inputs))?)
        })?;
        self.store(outputs);
        Ok(StepResult::Whole)
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        let state = self.call("save", |object| Ok(object.call_method0("save")?.unbind()))?;
        if self.saved.len() <= slot {
            self.saved.resize_with(slot + 1, || None);
        }
        self.saved[slot] = Some((self.values.clone(), state));
        Ok(())
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        let Some(Some((values, state))) = self.saved.get(slot) else {
            let (function, failure) = ("restore", Failure::Status(Status::Error));
            return Err(CallError { function, failure, messages: Vec::new() });
        };
        self.call("restore", |object| object.call_method1("restore", (state,)).map(|_| ()))?;
        self.values = values.clone();
        Ok(())
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        self.call("save", |object| {
            let state = (object.call_method0("save")?, self.values.clone());
            object.py().import("pickle")?.call_method1("dumps", (state,))?.extract()
        })
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        self.values = self.call("restore", |object| {
            let state = object.py().import("pickle")?.call_method1("loads", (bytes,))?;
            let (state, values): (Bound<'_, PyAny>, Vec<f64>) = state.extract()?;
            object.call_method1("restore", (state,))?;
            Ok(values)
        })?;
        Ok(())
    }
}

impl Drop for PythonSlave {
    /// Calls the object's `stop` if its run failed or its simulation was not closed.
    fn drop(&mut self) {
        if self.is_started {
            // `None` while the interpreter shuts down.
            let _ = Python::try_attach(|py| {
                let object = self.object.bind(py);
                stop(object).unwrap_or_else(|error| error.write_unraisable(py, Some(object)));
            });
        }
    }
}

/// Calls the function `stop` of the object, if the object has one.
fn stop(object: &Bound<'_, PyAny>) -> PyResult<()> {
    match object.getattr_opt("stop")? {
        Some(function) => function.call0().map(|_| ()),
        None => Ok(()),
    }
}

/// The start value of a declared variable.
#[derive(Clone, Copy)]
enum Start {
    Real(f64),
    /// An integer, which [`PythonSlave::new`] checks.
    Integer(f64),
    Boolean(bool),
}

impl Start {
    fn number(&self) -> f64 {
        match self {
            Self::Real(value) | Self::Integer(value) => *value,
            Self::Boolean(value) => f64::from(u8::from(*value)),
        }
    }
}

/// Checks that a value is an `Integer` of FMI 2.0, as required of a variable that starts with an integer. Otherwise
/// returns the error message, in which `what` is the role of the value, such as "the output".
fn check_integer(what: &str, name: &str, value: f64) -> Result<(), String> {
    if value.fract() == 0.0 && (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&value) {
        return Ok(());
    }
    Err(format!(
        "{what} {name} is {value}, expected an integer of 32 bits; a variable that starts with a float takes any number"
    ))
}

/// Returns the variables that an attribute of the object declares; none if the object lacks the attribute. Raises
/// `TypeError` for a text, which Python would iterate by letters.
fn declarations(object: &Bound<'_, PyAny>, attribute: &str) -> PyResult<Vec<(String, Start)>> {
    let Some(declaration) = object.getattr_opt(attribute)? else { return Ok(Vec::new()) };
    if declaration.is_instance_of::<PyString>() {
        let what = format!("{attribute}: expected names or a dict, found the text {declaration}");
        return Err(PyTypeError::new_err(what));
    }
    if let Ok(mapping) = declaration.cast::<PyMapping>() {
        let items = mapping.items()?;
        let item = |item: Bound<'_, PyAny>| {
            let (name, value): (String, Bound<'_, PyAny>) = item.extract()?;
            start(&name, &value).map(|start| (name, start))
        };
        return items.iter().map(item).collect();
    }
    declaration.try_iter()?.map(|name| Ok((name?.extract()?, Start::Real(0.0)))).collect()
}

/// Reads a start value. A bool is an int in Python, so the test for bool is first.
fn start(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Start> {
    use pyo3::types::{PyBool, PyInt};
    // `item` converts a scalar of `NumPy`, which is neither an int nor a bool of Python.
    let scalar = if value.hasattr("item")? { value.call_method0("item")? } else { value.clone() };
    if let Ok(boolean) = scalar.cast::<PyBool>() {
        return Ok(Start::Boolean(boolean.is_true()));
    }
    if scalar.is_instance_of::<PyInt>() {
        return scalar.extract().map(Start::Integer);
    }
    number("the start value of", name, &scalar).map(Start::Real)
}

/// Reads a number; the `TypeError` of another object names the variable.
fn number(what: &str, name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    let Ok(number) = value.extract::<f64>() else {
        let kind = value.get_type().name()?;
        let sentence = format!("{what} {name}: expected a number, found {kind}");
        return Err(PyTypeError::new_err(sentence));
    };
    Ok(number)
}

#[expect(clippy::cast_possible_truncation, reason = "an integer")]
fn variable(name: String, reference: u32, causality: Causality, start: Start) -> ScalarVariable {
    let is_input = causality == Causality::Input;
    let (kind, variability) = match start {
        Start::Real(value) => {
            let start = is_input.then_some(value);
            (Kind::Real(RealType { start, ..RealType::default() }), Variability::Continuous)
        }
        Start::Integer(value) => {
            let start = is_input.then_some(value as i128);
            (Kind::Integer(IntegerType { start, ..IntegerType::default() }), Variability::Discrete)
        }
        Start::Boolean(value) => (Kind::Boolean(is_input.then_some(value)), Variability::Discrete),
    };
    ScalarVariable {
        name,
        value_reference: reference,
        causality,
        variability,
        kind,
        ..ScalarVariable::default()
    }
}

fn structure(inputs: &[usize], outputs: &[usize], direct: bool) -> ModelStructure {
    let index = |position: &usize| u32::try_from(position + 1).unwrap_or(u32::MAX);
    let dependencies: Vec<_> = if direct { inputs.iter().map(index).collect() } else { Vec::new() };
    let unknown = |output| Unknown {
        index: index(output),
        dependencies: Some(dependencies.clone()),
        kinds: None,
    };
    let outputs = outputs.iter().map(unknown).collect();
    ModelStructure { outputs, ..ModelStructure::default() }
}

fn describe(
    name: &str,
    variables: Vec<ScalarVariable>,
    structure: ModelStructure,
    can_save: bool,
) -> ModelDescription {
    ModelDescription {
        fmi_version: "2.0".to_owned(),
        model_name: name.to_owned(),
        guid: format!("python {name}"),
        co_simulation: Some(CoSimulation {
            model_identifier: name.to_owned(),
            can_handle_variable_communication_step_size: true,
            can_get_and_set_fmu_state: can_save,
            can_serialize_fmu_state: can_save,
            ..CoSimulation::default()
        }),
        variables,
        structure,
        ..ModelDescription::default()
    }
}

/// Sets the entry of `inputs` for `variable`, converted to the type of the variable.
#[expect(clippy::cast_possible_truncation, reason = "an integer")]
fn set(inputs: &Bound<'_, PyDict>, variable: &ScalarVariable, value: f64) -> PyResult<()> {
    match &variable.kind {
        Kind::Boolean(_) => inputs.set_item(&variable.name, value != 0.0),
        Kind::Integer(_) => inputs.set_item(&variable.name, value as i64),
        _ => inputs.set_item(&variable.name, value),
    }
}
