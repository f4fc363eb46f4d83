//! A simulation that Python advances step by step.

use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use master::signal::reached;
use master::{Checkpoint, SystemError};
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::MutexExt as _;
use pyo3::types::{PyBytes, PyList};
use study::Run;

use crate::error;
use crate::guard::{guarded, with_cause};
use crate::logging;
use crate::python_slave::Raised;
use crate::value;
use crate::watch::{Progress, Stop, Watch};

/// A running simulation.
#[pyclass(frozen, module = "aso_ftc._core")]
pub(crate) struct Stepper {
    run: Mutex<Option<Run>>,
    raised: Raised,
}

impl Stepper {
    pub(crate) fn new(run: Run, raised: Raised) -> Self {
        Self { run: Mutex::new(Some(run)), raised }
    }

    fn lock<'a>(&'a self, py: Python<'_>) -> MutexGuard<'a, Option<Run>> {
        // Releases the interpreter while it waits: the thread that holds the lock may need it for a step.
        self.run.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// Calls `work` with the run; then passes on the messages that `work` caused.
    ///
    /// # Errors
    ///
    /// `RuntimeError` if the simulation is closed; the exception of a logging handler; the error of `work`.
    fn with<T>(&self, py: Python<'_>, work: impl FnOnce(&mut Run) -> PyResult<T>) -> PyResult<T> {
        // This statement releases the lock, since a logging handler may use the simulation.
        let result = work(self.lock(py).as_mut().ok_or_else(closed)?);
        logging::pass_on(py)?;
        result
    }

    /// Calls `work` with the run and with the interpreter released; then passes on the messages that `work` caused.
    ///
    /// # Errors
    ///
    /// `RuntimeError` if the simulation is closed; the exception of a logging handler; the error of `work`.
    fn detached<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Run) -> Result<T, SystemError> + Send,
    ) -> PyResult<T> {
        let result = guarded(py, || {
            let mut guard = self.run.lock().unwrap_or_else(PoisonError::into_inner);
            guard.as_mut().map(work).transpose()
        });
        logging::pass_on(py)?;
        let result =
            result?.map_err(|error| with_cause(py, error::system(&error), &self.raised))?;
        result.ok_or_else(closed)
    }

    /// Steps until `is_done(steps so far, time)` is true, the run is finished or a signal raises an exception; returns
    /// the number of steps.
    fn advance(
        &self,
        py: Python<'_>,
        is_done: impl Fn(u64, f64) -> bool + Send + Sync,
    ) -> PyResult<u64> {
        let mut watch = Watch::new(py, None, None, Progress::None)?;
        let steps = self.detached(py, |run| {
            let simulation = &mut run.simulation;
            let mut steps = 0;
            while !simulation.is_finished() && !is_done(steps, simulation.time()) {
                simulation.step()?;
                steps += 1;
                if let ControlFlow::Break(()) = watch.after_step(simulation.time()) {
                    break;
                }
            }
            Ok(steps)
        })?;
        match watch.stop {
            Some(Stop::Raised(error)) => Err(error),
            _ => Ok(steps),
        }
    }
}

fn closed() -> PyErr {
    PyRuntimeError::new_err("the simulation is closed; start another one")
}

#[pymethods]
impl Stepper {
    /// Time reached in s.
    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |run| Ok(run.simulation.time()))
    }

    /// Whether the stop time is reached or an FMU requested the end.
    #[getter]
    fn finished(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |run| Ok(run.simulation.is_finished()))
    }

    /// The complete configuration as a `system.toml`.
    #[getter]
    fn settings(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |run| run.config.render().map_err(|error| error::study(&error).raise(py)))
    }

    /// Names of all variables.
    fn names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |run| {
            let slaves = run.simulation.system().slaves.iter();
            let names = slaves.flat_map(|(slave, instance)| {
                let variables = instance.description().variables.iter();
                variables.map(move |variable| format!("{slave}.{}", variable.name))
            });
            Ok(names.collect())
        })
    }

    /// Makes up to `count` communication steps; returns their number.
    #[pyo3(signature = (count = 1))]
    fn step(&self, py: Python<'_>, count: u64) -> PyResult<u64> {
        self.advance(py, |steps, _| steps >= count)
    }

    /// Steps until `time` (in s) is reached or the run is finished; returns the number of steps.
    fn run_until(&self, py: Python<'_>, time: f64) -> PyResult<u64> {
        if time.is_nan() {
            return Err(PyValueError::new_err("time is nan, expected a number"));
        }
        self.advance(py, |_, now| reached(now, time))
    }

    /// Reads variables by name.
    fn get<'py>(&self, py: Python<'py>, names: Vec<String>) -> PyResult<Bound<'py, PyList>> {
        self.with(py, |run| {
            let time = run.simulation.time();
            let system = run.simulation.system();
            let values = PyList::empty(py);
            for name in names {
                let port = system.port(&name);
                let port = port.map_err(|error| error::system(&error).raise(py))?;
                values.append(value::get(py, system, port, time)?)?;
            }
            Ok(values)
        })
    }

    /// Reads a variable. `KeyError` for an unknown name.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.with(py, |run| {
            let time = run.simulation.time();
            let system = run.simulation.system();
            let port = system.port(name);
            let port = port.map_err(|error| PyKeyError::new_err(error.to_string()))?;
            value::get(py, system, port, time)
        })
    }

    /// Sets an input without a connection, or a tunable parameter, from the next step on.
    fn set(&self, py: Python<'_>, name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
        self.with(py, |run| {
            let time = run.simulation.time();
            let system = run.simulation.system();
            let port = value::settable(system, name).map_err(|error| error.raise(py))?;
            value::set(system, port, value, time)
        })
    }

    /// Returns the state of all FMUs and connections as bytes.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let saved = self.detached(py, |run| run.simulation.checkpoint())?;
        let bytes = postcard::to_stdvec(&saved);
        let bytes = bytes.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Returns to a state that [`Stepper::save`] has returned. `ValueError` for other bytes.
    fn restore(&self, py: Python<'_>, state: &[u8]) -> PyResult<()> {
        let checkpoint: Checkpoint = postcard::from_bytes(state).map_err(|_| {
            PyValueError::new_err("the bytes are no state that save() of this version has returned")
        })?;
        self.detached(py, |run| run.simulation.restore(&checkpoint))
    }

    /// Terminates and frees the FMUs. A second call does nothing.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let ended = guarded(py, || {
            let run = self.run.lock().unwrap_or_else(PoisonError::into_inner).take();
            let Some(mut run) = run else { return Ok(()) };
            let terminated = run.simulation.terminate();
            terminated.and(run.simulation.free())
        });
        logging::pass_on(py)?;
        ended?.map_err(|error| with_cause(py, error::system(&error), &self.raised))
    }
}
