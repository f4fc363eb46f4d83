//! Runs: a configuration, its changes, Python slaves.

use std::collections::{HashMap, HashSet};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock, OnceLock};

use fmu_description::Kind;
use master::{Port, Simulation, Slave};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::pyclass::{PyTraverseError, PyVisit};
use pyo3::types::{PyDict, PyMapping};
use results::{MemorySink, Recorded, Sink};
use study::config::CheckpointSettings;
use study::table::Table as Signals;
use study::{AssemblyOptions, Config, LoadedConfig, PreparedRun, Run, RunEnd, Store};

use crate::configuration::{merge, read};
use crate::error::{self, Exception};
use crate::guard::{guarded, with_cause};
use crate::logging;
use crate::python_slave::{PythonSlave, Raised};
use crate::stepper::Stepper;
use crate::table::Table;
use crate::value;
use crate::watch::{Cancel, Progress, Stop, Watch};

/// The FMUs of this process, and the identifier of the process that opened them.
static STORE: LazyLock<(Store, u32)> = LazyLock::new(|| (Store::default(), std::process::id()));
/// The program to start for an FMU in a separate process.
static WORKER: OnceLock<PathBuf> = OnceLock::new();

/// Sets the program to start for an FMU in a separate process.
#[pyfunction]
pub(crate) fn set_worker(path: PathBuf) {
    // Only the first call has an effect: the program does not change while the package is imported.
    let _ = WORKER.set(path);
}

/// Closes the FMUs that no run uses, and removes their unpacked files.
#[pyfunction]
pub(crate) fn clear(py: Python<'_>) {
    // A forked process must not remove the files of its parent.
    if STORE.1 == std::process::id() {
        py.detach(|| STORE.0.clear());
    }
}

/// Returns the number of FMUs that are open.
#[pyfunction]
pub(crate) fn open_fmus(py: Python<'_>) -> usize {
    py.detach(|| STORE.0.len())
}

/// A configuration, ready for many runs.
#[pyclass(frozen, module = "aso_ftc._core")]
pub(crate) struct Study {
    config: Config,
    folder: PathBuf,
    slaves: Vec<(String, Py<PyAny>)>,
}

/// An input over time: its name, and its times and values as the bytes of `f64`.
type TableInMemory = (String, PyBackedBytes, PyBackedBytes);

/// Slaves by name, and the last exception that a Python slave raised.
type Slaves = (Vec<(String, Box<dyn Slave>)>, Raised);

#[pymethods]
impl Study {
    /// Reads a configuration, as text or as nested dicts. Relative paths start in `folder`.
    #[new]
    fn new(
        description: &Bound<'_, PyAny>,
        folder: PathBuf,
        slaves: Vec<(String, Py<PyAny>)>,
    ) -> PyResult<Self> {
        let mut config = read(description, &folder)?;
        config.make_absolute()?;
        Ok(Self { config, folder, slaves })
    }

    /// Visits the slaves for the garbage collector: a slave may refer to the system that has this configuration.
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.slaves.iter().try_for_each(|(_, slave)| visit.call(slave))
    }

    /// Loads and connects the FMUs, and resolves all names, without a run. Returns the variables as dicts. If `quiet`,
    /// drops the messages, which a run of the same configuration repeats.
    #[pyo3(signature = (changes, *, quiet = false))]
    fn check(
        &self,
        py: Python<'_>,
        changes: &Bound<'_, PyAny>,
        quiet: bool,
    ) -> PyResult<Vec<Py<PyDict>>> {
        logging::adopt_level(py);
        let (loaded, (slaves, _)) = (self.with_changes(changes)?, self.slaves(py)?);
        let prepared = guarded(py, || logging::quietly(quiet, || prepare(loaded, slaves, &[])));
        logging::pass_on(py)?;
        let prepared = prepared?.map_err(|error| error::study(&error).raise(py))?;
        let mut variables = Vec::new();
        for (name, slave) in &prepared.system.slaves {
            for variable in &slave.description().variables {
                let described = crate::description::variable(py, variable, slave.description())?;
                described.bind(py).set_item("name", format!("{name}.{}", variable.name))?;
                variables.push(described);
            }
        }
        Ok(variables)
    }

    /// Runs to the end. Returns the outcome, and an exception if the run failed or was ended early; raises an error
    /// that occurs before the start.
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    #[pyo3(signature = (changes, *, time_limit = None, cancel = None, progress = None, input = None, tables = None, prefix = None))]
    fn run(
        &self,
        py: Python<'_>,
        changes: &Bound<'_, PyAny>,
        time_limit: Option<f64>,
        cancel: Option<&Bound<'_, Cancel>>,
        progress: Option<&Bound<'_, PyAny>>,
        input: Option<Py<PyAny>>,
        tables: Option<Vec<TableInMemory>>,
        prefix: Option<&str>,
    ) -> PyResult<(Outcome, Option<Py<PyAny>>)> {
        logging::adopt_level(py);
        let (loaded, (slaves, raised)) = (self.with_changes(changes)?, self.slaves(py)?);
        let cancel = cancel.map(|cancel| cancel.get().flag.clone());
        let watch = Watch::new(py, time_limit, cancel, Progress::new(progress)?)?;
        let input = input.map(Input::new);
        let tables = tables.unwrap_or_default().iter().map(|table| self.table(table)).collect();
        let result = guarded(py, || run(loaded, slaves, watch, input, tables));
        logging::pass_on(py)?;
        let run = result?.map_err(|error| with_cause(py, error::study(&error), &raised))?;
        let EndedRun { ended, time, steps, seconds, recorded, settings, reasons, mut watch } = run;
        let (recorded, binaries) = recorded;
        // A time limit or a cancellation that is noticed only after the last step has not ended the run.
        if matches!(ended, RunEnd::AtStop | RunEnd::ByFmu(_))
            && !matches!(watch.stop, Some(Stop::Raised(_)))
        {
            watch.finish(py);
        }
        let shown = fmu_description::number::seconds(time);
        let (end, exception) = match (watch.stop.take(), ended) {
            (Some(Stop::Raised(error)), _) => ("interrupted".to_owned(), Some(error)),
            (_, RunEnd::Failed(error)) => {
                let error = with_cause(py, error::study(&error).with_time(time), &raised);
                ("failed".to_owned(), Some(error))
            }
            (Some(Stop::TimeLimit(limit)), _) => {
                let sentence =
                    format!("the run reached its time limit of {limit} s at t = {shown} s");
                let exception = Exception::new("TimeLimitError", "TimeLimit", sentence);
                ("time limit".to_owned(), Some(exception.number("time", time).raise(py)))
            }
            (Some(Stop::Cancelled), _) => {
                let sentence = format!("the run was cancelled at t = {shown} s");
                let exception = Exception::new("CancelledError", "Cancelled", sentence);
                ("cancelled".to_owned(), Some(exception.number("time", time).raise(py)))
            }
            (None, RunEnd::ByFmu(name)) => (name, None),
            (None, RunEnd::AtStop | RunEnd::Interrupted) => ("stop time".to_owned(), None),
        };
        let table = Table::new(recorded, &binaries, prefix)?;
        let outcome = Outcome { table, end, time, steps, seconds, settings, reasons };
        Ok((outcome, exception.map(|error| error.into_value(py).into_any())))
    }

    /// Initialises the FMUs to be advanced step by step, without a results file and without checkpoints.
    fn simulation(&self, py: Python<'_>, changes: &Bound<'_, PyAny>) -> PyResult<Stepper> {
        logging::adopt_level(py);
        let (mut loaded, (slaves, raised)) = (self.with_changes(changes)?, self.slaves(py)?);
        (loaded.config.results.file, loaded.config.checkpoint) =
            (None, CheckpointSettings::default());
        let started = guarded(py, || prepare(loaded, slaves, &[])?.start(None));
        logging::pass_on(py)?;
        let run = started?.map_err(|error| with_cause(py, error::study(&error), &raised))?;
        Ok(Stepper::new(run, raised))
    }
}

impl Study {
    /// Returns the configuration of a run with `changes` applied.
    fn with_changes(&self, changes: &Bound<'_, PyAny>) -> PyResult<LoadedConfig> {
        let mut config = self.config.clone();
        if changes.len()? > 0 {
            merge(&mut config, read(changes, &self.folder)?, changes);
        }
        Ok(LoadedConfig { config, source: None })
    }

    /// Returns the path by which the configuration refers to a table in memory, and the table.
    fn table(&self, (name, times, values): &TableInMemory) -> (PathBuf, Signals) {
        let numbers = |bytes: &[u8]| -> Arc<[f64]> {
            bytes.as_chunks().0.iter().map(|bytes| f64::from_ne_bytes(*bytes)).collect()
        };
        let (times, columns) = (numbers(times), vec![numbers(values)]);
        (self.folder.join(name), Signals { names: vec![name.clone()], times, columns })
    }

    /// Returns the Python slaves of a run.
    fn slaves(&self, py: Python<'_>) -> PyResult<Slaves> {
        let raised = Raised::default();
        let mut slaves: Vec<(String, Box<dyn Slave>)> = Vec::new();
        for (name, object) in &self.slaves {
            let slave = PythonSlave::new(name, object.bind(py), raised.clone())?;
            slaves.push((name.clone(), Box::new(slave)));
        }
        Ok((slaves, raised))
    }
}

/// Loads and connects the FMUs and the slaves.
fn prepare(
    loaded: LoadedConfig,
    slaves: Vec<(String, Box<dyn Slave>)>,
    tables: &[(PathBuf, Signals)],
) -> Result<PreparedRun, study::Error> {
    #[cfg(unix)]
    if loaded.config.isolation.isolate != Some(true)
        && let Ok(here) = std::env::current_dir()
    {
        // The file explains a crash; the run does not depend on it.
        let _ = fmu_import::crash::leave_file(&here);
    }
    let worker = WORKER.get().map(PathBuf::as_path);
    let (store, logging) = (Some(&STORE.0), logging::is_debugging());
    let options = AssemblyOptions { store, worker, logging, tables, ..AssemblyOptions::default() };
    PreparedRun::with_slaves(loaded, &options, slaves)
}

/// A run that has ended.
struct EndedRun {
    ended: RunEnd,
    /// Time reached in s.
    time: f64,
    /// Number of communication steps.
    steps: u64,
    /// Wall-clock time of the steps in s.
    seconds: f64,
    /// The rows, and the names of the columns that hold values of the type Binary.
    recorded: (results::Columns, HashSet<String>),
    /// The complete configuration as a `system.toml`.
    settings: String,
    /// One sentence for each setting that was chosen.
    reasons: Vec<String>,
    watch: Watch,
}

/// Runs to the end; other Python threads may run meanwhile.
fn run(
    loaded: LoadedConfig,
    slaves: Vec<(String, Box<dyn Slave>)>,
    mut watch: Watch,
    mut input: Option<Input>,
    tables: Vec<(PathBuf, Signals)>,
) -> Result<EndedRun, study::Error> {
    let prepared = prepare(loaded, slaves, &tables)?;
    let is_binary = |port: &&Port| matches!(prepared.system.variable(**port).kind, Kind::Binary(_));
    let binaries = prepared.ports.iter().filter(is_binary);
    let binaries = binaries.map(|port| prepared.system.name(*port)).collect();
    let file = prepared.config.results.file.clone();
    let recorded = Recorded::default();
    let mut run = prepared.start_into(None, |columns| {
        let second = file.map(|file| results::create(&file, columns)).transpose()?;
        Ok(Box::new(MemorySink::new(columns, recorded.clone(), second)?) as Box<dyn Sink>)
    })?;
    watch.span = (run.simulation.time(), run.plan.stop);
    let ended = run.advance(|simulation| {
        if let Some(input) = &mut input
            && let Err(error) = input.set(simulation)
        {
            watch.stop = Some(Stop::Raised(error));
            return Ok(ControlFlow::Break(()));
        }
        Ok(watch.after_step(simulation.time()))
    });
    let settings = run.config.render()?;
    let Run { simulation, .. } = &run;
    let (time, tally) = (simulation.time(), run.tally());
    let finished = run.finish().map(|_| ()).and(run.finish_trace());
    let reasons = std::mem::take(&mut run.plan.reasons);
    drop(run);
    // The rows are in memory even if writing their file failed.
    let ended = match (ended, finished) {
        (RunEnd::Failed(error), _) | (_, Err(error)) => RunEnd::Failed(error),
        (ended, Ok(())) => ended,
    };
    let recorded = (recorded.take(), binaries);
    let (steps, seconds) = (tally.steps, tally.seconds);
    Ok(EndedRun { ended, time, steps, seconds, recorded, settings, reasons, watch })
}

/// A function of time that returns values of inputs.
struct Input {
    function: Py<PyAny>,
    /// The ports of the inputs that were set so far, by name.
    ports: HashMap<String, Port>,
}

impl Input {
    fn new(function: Py<PyAny>) -> Self {
        Self { function, ports: HashMap::new() }
    }

    /// Sets the inputs to the values at the time reached.
    fn set(&mut self, simulation: &mut Simulation) -> PyResult<()> {
        let time = simulation.time();
        Python::attach(|py| {
            let values = self.function.bind(py).call1((time,))?;
            let system = simulation.system();
            for item in values.cast::<PyMapping>()?.items()?.iter() {
                let (name, value): (String, Bound<'_, PyAny>) = item.extract()?;
                let port = if let Some(port) = self.ports.get(&name) {
                    *port
                } else {
                    let port = value::settable(system, &name);
                    let port = port.map_err(|error| error.raise(py))?;
                    self.ports.insert(name.clone(), port);
                    port
                };
                value::set(system, port, &value, time)?;
            }
            Ok(())
        })
    }
}

/// The outcome of a run, a dict in Python.
#[derive(IntoPyObject)]
struct Outcome {
    /// The recorded columns.
    table: Table,
    /// `stop time`, `time limit`, `cancelled`, `interrupted`, `failed`, or the name of the FMU that requested the end.
    end: String,
    /// Time reached in s.
    time: f64,
    /// Number of communication steps.
    steps: u64,
    /// Wall-clock time of the steps in s.
    seconds: f64,
    /// The complete configuration as a `system.toml`.
    settings: String,
    /// One sentence for each setting that was chosen.
    reasons: Vec<String>,
}
