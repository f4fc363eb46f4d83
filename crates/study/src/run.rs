//! A run: prepared from a configuration, started or resumed, advanced to its end.

mod intervention;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use fmu_description::Version;
use fmu_description::similar::slip;
use fmu_import::crash;
use master::drive::Drive;
use master::signal::reached;
use master::{Port, Scenario, Simulation, Slave, SlowState, System, SystemError};
use results::{Column, ResultsError, Sink};
use serde_spanned::Spanned;
use ssp::Opened;

use crate::assemble::{AssembledSystem, assemble_with};
use crate::assembly_options::AssemblyOptions;
use crate::bus_trace::BusTrace;
use crate::config::{Config, Every, LoadedConfig};
use crate::error::Error;
use crate::plan::{Plan, plan};
use crate::record::{Recorder, select};
use crate::resume::resume;
use crate::saved::SavedRun;
use crate::scenario::Setup;
use crate::table::Table;
pub use intervention::Intervention;

/// A run with all settings chosen, before initialisation.
pub struct PreparedRun {
    /// The configuration, completed with all chosen settings.
    pub config: Config,
    /// The FMUs and their connections.
    pub system: System,
    /// The settings chosen for the run.
    pub plan: Plan,
    /// The variables to record.
    pub ports: Vec<Port>,
    scenario: Scenario,
    /// The tables in memory that the scenario reads.
    tables: Vec<(PathBuf, Table)>,
    /// The system structure, whose folders are removed after the system is dropped.
    opened: Option<Arc<Opened>>,
}

impl PreparedRun {
    /// Loads and connects the FMUs, chooses what `loaded` leaves open, and resolves the variables
    /// of scenario and results. Makes the paths of the configuration absolute, because an FMU may
    /// change the current folder.
    ///
    /// # Errors
    ///
    /// Returns the first error found, with its line for an error in a file.
    pub fn new(loaded: LoadedConfig, options: &AssemblyOptions<'_>) -> Result<Self, Error> {
        Self::with_slaves(loaded, options, Vec::new())
    }

    /// Like [`PreparedRun::new`], with further `slaves`, by name, that are not FMUs.
    ///
    /// # Errors
    ///
    /// Same as [`PreparedRun::new`]; also if a slave has the name of an FMU or of another slave.
    pub fn with_slaves(
        mut loaded: LoadedConfig,
        options: &AssemblyOptions<'_>,
        slaves: Vec<(String, Box<dyn Slave>)>,
    ) -> Result<Self, Error> {
        loaded.config.make_absolute().map_err(Error::file("find", Path::new(".")))?;
        let source = loaded.source.as_ref().map(|source| ("the configuration", &*source.path));
        loaded.config.check_outputs(source.as_slice(), &[])?;
        if options.log_calls.is_some() {
            // With threads, the order of the logged calls would be random.
            loaded.config.algorithm.jobs = Some(1);
        }
        let mut assembled = assemble_with(&loaded, options, slaves)?;
        let plan = plan(&mut loaded.config, &assembled)?;
        let AssembledSystem { system, opened, .. } = &mut assembled;
        let (system, opened) = (std::mem::take(system), opened.take());
        let scenario = scenario(&loaded, &system, &plan, options.tables)?;
        let config = loaded.config;
        let ports = select(&system, &config.results.record, &config.results.exclude)?;
        check_saving(&config, &system)?;
        let tables = options.tables.to_vec();
        Ok(Self { config, system, plan, ports, scenario, tables, opened })
    }

    /// Returns whether a setting or the scenario gives the variable at `port` a value.
    #[must_use]
    pub fn sets(&self, port: Port) -> bool {
        let (holder, name) = (self.system.holder(port), self.system.name(port));
        let is_meant = |setting: &str| {
            let named = self.system.port(setting);
            named.is_ok_and(|named| self.system.holder(named) == holder)
                || name.starts_with(&format!("{setting}["))
        };
        self.config.settings.0.iter().any(|(setting, _, _)| is_meant(setting))
            || self.scenario.drives.iter().any(|drive| drive.port() == holder)
    }

    /// Initialises the FMUs, or restores them from the checkpoint `saved`, and creates the results
    /// file and the bus trace of the configuration.
    ///
    /// # Errors
    ///
    /// Returns [`Error`] if an FMU fails, if the checkpoint does not match the run, if a bus trace is requested
    /// and there is no CAN bus, or if a file cannot be written.
    pub fn start(self, saved: Option<&SavedRun>) -> Result<Run, Error> {
        let file = self.config.results.file.clone();
        self.start_recording(saved, |simulation, ports, every, start| match file {
            Some(file) => Recorder::create(&file, simulation, ports, every, start),
            None => Ok(None),
        })
    }

    /// Like [`PreparedRun::start`], but writes the results to the sink that `make` returns for their
    /// columns, not to the file of the configuration.
    ///
    /// # Errors
    ///
    /// Same as [`PreparedRun::start`].
    pub fn start_into(
        self,
        saved: Option<&SavedRun>,
        make: impl FnOnce(&[Column]) -> Result<Box<dyn Sink>, ResultsError>,
    ) -> Result<Run, Error> {
        self.start_recording(saved, |simulation, ports, every, start| {
            Recorder::with_sink(simulation, ports, every, start, make)
        })
    }

    /// Starts or resumes the run; `record` creates the recorder for the ports, the interval and the start time.
    fn start_recording(
        self,
        saved: Option<&SavedRun>,
        record: impl FnOnce(&mut Simulation, &[Port], Every, f64) -> Result<Option<Recorder>, Error>,
    ) -> Result<Run, Error> {
        let Self { config, mut system, plan, ports, scenario, tables, opened } = self;
        let trace = config.results.bus_trace.as_deref();
        let start = plan.experiment.start_time;
        let trace = trace.map(|path| BusTrace::start(path, &mut system, start)).transpose()?;
        let text = config.render()?;
        let Plan { algorithm, experiment, .. } = &plan;
        let mut simulation = match saved {
            None => Simulation::with_scenario(system, algorithm, experiment, scenario)?,
            Some(saved) => resume(system, &plan, scenario, &saved.checkpoint)?,
        };
        if let Some(early) = simulation.early_end() {
            tracing::warn!("{early}");
        }
        let recorder = record(&mut simulation, &ports, plan.every, start);
        let mut recorder = recorder.inspect_err(|error| crash::note(error.sentence()))?;
        let next_rows = saved.and_then(|saved| saved.due(plan.every));
        if let (Some(recorder), Some(saved)) = (&mut recorder, saved) {
            recorder.slow.restore(&mut simulation, &saved.slow)?;
            if let Some(due) = next_rows {
                recorder.due = due.clone();
            }
        }
        trace.as_ref().map_or(Ok(()), BusTrace::create)?;
        Ok(Run {
            resumed: next_rows.is_some(),
            checkpoints: Checkpoints::new(&config, text, plan.every),
            simulation,
            recorder,
            tally: RunStatistics::default(),
            config,
            plan,
            trace,
            tables,
            _opened: opened,
        })
    }
}

/// Resolves the signals and faults of the run.
fn scenario(
    loaded: &LoadedConfig,
    system: &System,
    plan: &Plan,
    tables: &[(PathBuf, Table)],
) -> Result<Scenario, Error> {
    // The paths are absolute already.
    let folder = Path::new("");
    let (start, step) = (plan.experiment.start_time, plan.algorithm.step);
    let setup = Setup { folder, start, step, tables };
    let resolved = loaded.config.scenario.resolve(system, &setup);
    let prepared = resolved.map_err(|error| {
        let place = error.place.clone();
        loaded.point(&place, Error::Scenario(error))
    })?;
    let faults = prepared.windows.iter();
    let faults =
        faults.map(|(input, window)| (format!("the fault of {input} starts"), window.from));
    let settings = loaded.config.scenario.set.iter().map(Spanned::get_ref);
    let settings = settings.map(|entry| (format!("{} is set", entry.variable.get_ref()), entry.at));
    for (what, at) in faults.chain(settings).filter(|(_, at)| !reached(plan.stop, *at)) {
        let stop = plan.stop;
        tracing::warn!("{what} at {at} s, after the stop time {stop} s: it has no effect");
    }
    let driven: Vec<Port> = prepared.scenario.drives.iter().map(Drive::port).collect();
    let free = system.free_inputs().into_iter().filter(|port| !driven.contains(port));
    let free: Vec<String> = free.map(|port| system.name(port)).collect();
    // A column of an existing variable is no misspelt input: the variable is an output, connected or driven elsewhere.
    let entries = loaded.config.scenario.table.iter();
    let elements = entries.filter_map(|entry| Some(entry.get_ref().element.as_ref()?.get_ref()));
    let elements: Vec<&String> = elements.collect();
    let exists = |column: &str| {
        let in_element = |element: &&String| system.port(&format!("{element}.{column}")).is_ok();
        system.port(column).is_ok() || elements.iter().any(in_element)
    };
    for (file, column) in &prepared.unused {
        let file = file.display();
        let variable =
            |name: &str| name.split_once('.').map_or("", |(_, variable)| variable).to_owned();
        let is_meant = |name: &&String| {
            let names = [name.as_str(), &variable(name)];
            slip(names.into_iter(), column).is_some()
        };
        let meant = if exists(column) { None } else { free.iter().find(is_meant) };
        match meant {
            Some(input) => tracing::warn!(
                "{file}: the column {column:?} names no input and is not used; {input}, of a similar name, has no \
                 column and keeps its start value"
            ),
            None => {
                tracing::info!("{file}: the column {column:?} has no free input and is not used");
            }
        }
    }
    Ok(prepared.scenario)
}

/// If checkpoints are requested, checks before the run that their file is stated and all FMUs can save their state.
fn check_saving(config: &Config, system: &System) -> Result<(), Error> {
    let Some(path) = &config.checkpoint.file else { return Ok(()) };
    if path.is_dir() {
        let path = path.display();
        return Err(Error::Invalid(format!("cannot write the checkpoint {path}: it is a folder")));
    }
    let unable = system.slaves.iter().find(|(_, slave)| {
        let flags = slave.description().co_simulation.as_ref();
        !flags.is_some_and(|flags| flags.can_serialize_fmu_state)
    });
    match unable {
        Some((name, slave)) => Err(Error::Invalid(format!(
            "{name} cannot take part in a checkpoint: {}",
            match slave.description().version() {
                Version::V1 => "FMI 1.0 has no functions that save the state of an FMU",
                Version::V2 => "its canSerializeFMUstate is false",
                Version::V3 => "its canSerializeFMUState is false",
            }
        ))),
        None => Ok(()),
    }
}

/// The reason for the end of a run.
pub enum RunEnd {
    /// The run reached its stop time.
    AtStop,
    /// The FMU with this name requested the end.
    ByFmu(String),
    /// The caller requested the end.
    Interrupted,
    /// The run failed.
    Failed(Error),
}

/// Number of steps and wall-clock time of a run, since its start or resumption.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunStatistics {
    /// Number of communication steps.
    pub steps: u64,
    /// Wall-clock time of [`Run::advance`] in s; 0 until that call has returned.
    pub seconds: f64,
}

/// File and interval of the checkpoints.
struct Checkpoints {
    path: PathBuf,
    /// Simulated time in s between two checkpoints; `None`: only the checkpoint at the end.
    interval: Option<f64>,
    /// The complete configuration as text.
    text: String,
    every: Every,
}

impl Checkpoints {
    fn new(config: &Config, text: String, every: Every) -> Option<Self> {
        let interval = config.checkpoint.every.as_ref().map(|every| *every.get_ref());
        config.checkpoint.file.clone().map(|path| Self { path, interval, text, every })
    }
}

/// A running study.
pub struct Run {
    /// The simulation.
    pub simulation: Simulation,
    /// The complete configuration.
    pub config: Config,
    /// The settings chosen for the run.
    pub plan: Plan,
    recorder: Option<Recorder>,
    checkpoints: Option<Checkpoints>,
    /// Whether the run was resumed with the same interval between rows, so that the original run has already handled
    /// the communication point at which this run starts.
    resumed: bool,
    tally: RunStatistics,
    trace: Option<BusTrace>,
    /// The tables in memory that the scenario reads.
    tables: Vec<(PathBuf, Table)>,
    /// The system structure, whose folders are removed after the simulation is dropped.
    _opened: Option<Arc<Opened>>,
}

impl Run {
    /// Steps to the stop time, records rows, writes checkpoints and terminates the FMUs. Calls
    /// `watch` at the start and after every step; `watch` can end the run by [`ControlFlow::Break`] or by an
    /// error. After an error the FMUs are not terminated and no checkpoint is written.
    pub fn advance(
        &mut self,
        mut watch: impl FnMut(&mut Simulation) -> Result<ControlFlow<()>, SystemError>,
    ) -> RunEnd {
        self.advance_open(|run| Ok(watch(&mut run.simulation)?))
    }

    /// Like [`Run::advance`], but passes the whole run to `watch`, which may change the scenario by
    /// [`Run::intervene`].
    pub fn advance_open(
        &mut self,
        watch: impl FnMut(&mut Self) -> Result<ControlFlow<()>, Error>,
    ) -> RunEnd {
        let start = Instant::now();
        let end = self.steps(watch).unwrap_or_else(RunEnd::Failed);
        self.tally.seconds = start.elapsed().as_secs_f64();
        end
    }

    fn steps(
        &mut self,
        mut watch: impl FnMut(&mut Self) -> Result<ControlFlow<()>, Error>,
    ) -> Result<RunEnd, Error> {
        let start = self.simulation.time();
        let interval = self.checkpoints.as_ref().and_then(|checkpoints| checkpoints.interval);
        // Number of the interval at whose end a checkpoint was written last.
        let mut intervals = 0.0;
        let mut save_at = interval.map_or(f64::INFINITY, |interval| start + interval);
        let mut flow = watch(self)?;
        if !self.resumed {
            self.sample()?;
        }
        while flow.is_continue() && !self.simulation.is_finished() {
            if let Some(recorder) = &mut self.recorder {
                recorder.slow.before_step(&mut self.simulation)?;
            }
            let before = self.simulation.time();
            self.simulation.step()?;
            self.tally.steps += 1;
            flow = watch(self)?;
            let time = self.simulation.time();
            // An FMU may request the end at a time that the other FMUs have not reached.
            if time > before {
                self.sample()?;
            }
            if let Some(interval) = interval
                && time >= save_at
            {
                self.save()?;
                intervals = ((time - start) / interval).floor().max(intervals + 1.0);
                save_at = start + (intervals + 1.0) * interval;
            }
        }
        self.save()?;
        // Before `terminate`, in which an FMU may end the process.
        self.recorder.as_mut().map_or(Ok(()), Recorder::flush)?;
        self.simulation.terminate()?;
        self.simulation.free()?;
        Ok(match self.simulation.ended_by() {
            Some(name) => RunEnd::ByFmu(name.to_owned()),
            None if self.simulation.is_finished() => RunEnd::AtStop,
            None => RunEnd::Interrupted,
        })
    }

    #[inline]
    fn sample(&mut self) -> Result<(), Error> {
        let simulation = &mut self.simulation;
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.sample(simulation))
    }

    /// Writes the rows up to now, then a checkpoint. Does nothing if no checkpoints are requested.
    fn save(&mut self) -> Result<(), Error> {
        let Some(checkpoints) = &self.checkpoints else { return Ok(()) };
        let (mut due, mut slow) = (None, SlowState::default());
        if let Some(recorder) = &mut self.recorder {
            recorder.flush()?;
            due = Some((checkpoints.every.to_string(), recorder.due.clone()));
            slow = recorder.slow.state(self.simulation.system());
        }
        let (text, checkpoint) = (checkpoints.text.clone(), self.simulation.checkpoint()?);
        SavedRun { text, checkpoint, due, slow }.write(&checkpoints.path)
    }

    /// Returns the number of steps so far, and the wall-clock time of [`Run::advance`], 0 until that call has returned.
    #[must_use]
    pub fn tally(&self) -> RunStatistics {
        self.tally
    }

    /// Returns the checkpoint file, if checkpoints are written.
    #[must_use]
    pub fn checkpoint_file(&self) -> Option<&Path> {
        self.checkpoints.as_ref().map(|checkpoints| checkpoints.path.as_path())
    }

    /// Completes the results. Returns the path of the results file in the configuration; `None` if there is none, if
    /// nothing is recorded, or if this was called before.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Results`] if the results cannot be completed.
    pub fn finish(&mut self) -> Result<Option<&Path>, Error> {
        match self.recorder.take() {
            Some(recorder) => recorder.finish().map(|()| self.config.results.file.as_deref()),
            None => Ok(None),
        }
    }

    /// Completes the bus trace, if there is one.
    ///
    /// # Errors
    ///
    /// Returns an error that names the file if a frame could not be written.
    pub fn finish_trace(&mut self) -> Result<(), Error> {
        self.trace.take().map_or(Ok(()), |trace| trace.finish())
    }
}
