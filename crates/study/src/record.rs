//! Records rows of results during the run.

use crate::error::Error;
use std::collections::HashSet;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, TryLockError, Weak};
use std::thread;
use std::time::Duration;

use fmu_description::{Causality, Kind};
use master::{Port, Readout, Simulation, SlowState, SlowValues, System};
use results::{self, Column, ColumnKind, Decimation, Due, ResultsError, Row, Selection, Sink};

use crate::config::Every;
use crate::store::lock;

/// All open results files, so that they can be completed when the process ends.
static FILES: Mutex<Files> = Mutex::new(Files { open: Vec::new(), is_watched: false });
/// Longest time that a row stays in memory while the run makes no further one.
const STALL: Duration = Duration::from_millis(250);
/// Number of attempts to lock a file when the process ends, and the pause between them.
const TRIES: u32 = 50;
const PAUSE: Duration = Duration::from_millis(10);

struct Files {
    open: Vec<Weak<Mutex<Recording>>>,
    /// Whether [`write_stalled`] runs.
    is_watched: bool,
}

impl Files {
    /// Returns the open files.
    fn open(&mut self) -> Vec<Arc<Mutex<Recording>>> {
        self.open.retain(|file| file.strong_count() > 0);
        self.open.iter().filter_map(Weak::upgrade).collect()
    }
}

/// An open results file. The end of the process can take it over.
struct Recording {
    path: PathBuf,
    /// `None` after the file was completed.
    sink: Option<Box<dyn Sink>>,
    /// Whether a row was recorded since the last look of [`write_stalled`], and whether rows were before.
    recent: bool,
    pending: bool,
    /// The error of a write by [`write_stalled`].
    failed: Option<ResultsError>,
}

impl Recording {
    fn new(sink: Box<dyn Sink>) -> Self {
        let (path, sink) = (PathBuf::new(), Some(sink));
        Self { path, sink, recent: false, pending: false, failed: None }
    }

    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError> {
        self.recent = true;
        self.failed.take().map_or(Ok(()), Err)?;
        self.sink.as_mut().map_or(Ok(()), |sink| sink.row(time, row))
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.failed.take().map_or(Ok(()), Err)?;
        self.sink.as_mut().map_or(Ok(()), |sink| sink.flush())
    }
}

/// The recorder of a run: writes variables to a results file at given intervals.
pub struct Recorder {
    recording: Arc<Mutex<Recording>>,
    due: Due,
    readout: Readout,
    slow: SlowValues,
}

impl Recorder {
    /// Creates a recorder of `ports` to the file at `path`; `None` if nothing is recorded.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn create(
        path: &Path,
        simulation: &mut Simulation,
        ports: &[Port],
        every: Every,
        start: f64,
    ) -> Result<Option<Self>, Error> {
        let make = |columns: &[Column]| results::create(path, columns);
        let recorder = Self::with_sink(simulation, ports, every, start, make)?;
        let Some(recorder) = recorder else { return Ok(None) };
        path.clone_into(&mut lock(&recorder.recording).path);
        let mut files = lock(&FILES);
        files.open.push(Arc::downgrade(&recorder.recording));
        if !files.is_watched {
            // Without the thread, rows are written with the next row only.
            let watch = thread::Builder::new().name("results".to_owned()).spawn(write_stalled);
            files.is_watched = watch.is_ok();
        }
        drop(files);
        Ok(Some(recorder))
    }

    /// Creates a recorder of `ports` to the sink that `make` returns for their columns; `None` if
    /// nothing is recorded.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn with_sink(
        simulation: &mut Simulation,
        ports: &[Port],
        every: Every,
        start: f64,
        make: impl FnOnce(&[Column]) -> Result<Box<dyn Sink>, ResultsError>,
    ) -> Result<Option<Self>, Error> {
        let decimation = match every {
            Every::Never => return Ok(None),
            Every::Step => Decimation::All,
            Every::Seconds(seconds) => Decimation::Every(seconds),
        };
        let ports = readable(simulation.system(), ports, start)?;
        let slow = SlowValues::new(simulation, &ports);
        let system = simulation.system();
        let columns: Vec<_> = ports.iter().map(|&port| column(system, port)).collect();
        let (due, readout) = (Due::new(decimation, start), simulation.readout(&ports));
        let recording = Arc::new(Mutex::new(Recording::new(make(&columns)?)));
        Ok(Some(Self { recording, due, readout, slow }))
    }

    /// Restores the time of the next row in a resumed run.
    pub fn set_due(&mut self, due: &Due) {
        self.due = due.clone();
    }

    /// Returns the schedule of the next rows.
    #[must_use]
    pub fn due(&self) -> &Due {
        &self.due
    }

    /// Records a row if one is due at the time of `simulation`.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    #[inline]
    pub fn sample(&mut self, simulation: &mut Simulation) -> Result<(), Error> {
        let time = simulation.time();
        if self.due.at(time) { self.record(simulation, time) } else { Ok(()) }
    }

    /// Reads the start values of slaves that step every several communication steps. Call it before every
    /// [`Simulation::step`].
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    #[inline]
    pub fn before_step(&mut self, simulation: &mut Simulation) -> Result<(), Error> {
        Ok(self.slow.before_step(simulation)?)
    }

    /// Lets the rows follow the driven variables of now, after a change of the scenario.
    pub(crate) fn follow(&mut self, simulation: &Simulation) {
        simulation.follow(&mut self.readout);
    }

    /// Returns the state of the recording for a checkpoint.
    pub fn slow_state(&self, simulation: &mut Simulation) -> SlowState {
        self.slow.state(simulation.system())
    }

    /// Restores the state of the recording in a resumed run.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn restore(&mut self, simulation: &mut Simulation, state: &SlowState) -> Result<(), Error> {
        Ok(self.slow.restore(simulation, state)?)
    }

    fn record(&mut self, simulation: &mut Simulation, time: f64) -> Result<(), Error> {
        simulation.read(&mut self.readout)?;
        self.slow.apply(simulation, &mut self.readout);
        let Readout { reals, integers, booleans, strings, present, .. } = &self.readout;
        let row = Row { reals, integers, booleans, strings, present };
        Ok(lock(&self.recording).row(time, &row)?)
    }

    /// Writes all rows recorded so far to the file.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn flush(&mut self) -> Result<(), Error> {
        Ok(lock(&self.recording).flush()?)
    }

    /// Completes the file.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn finish(self) -> Result<(), Error> {
        let mut recording = lock(&self.recording);
        let failed = recording.failed.take().map_or(Ok(()), Err);
        let finished = recording.sink.take().map_or(Ok(()), Sink::finish);
        Ok(failed.and(finished)?)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Now, and not when `write_stalled` lets go of the recording.
        drop(lock(&self.recording).sink.take());
    }
}

/// Writes the rows of files whose run has made no row for some time: an FMU may take long for its step,
/// or for ever, and nobody knows how the process ends. Returns when no file is open.
fn write_stalled() {
    loop {
        thread::sleep(STALL);
        let mut files = lock(&FILES);
        let open = files.open();
        files.is_watched = !open.is_empty();
        drop(files);
        if open.is_empty() {
            return;
        }
        for file in open {
            // The run is writing.
            let Ok(mut recording) = file.try_lock() else { continue };
            let was_recent = std::mem::take(&mut recording.recent);
            if !was_recent && recording.pending {
                let flushed = recording.flush();
                recording.failed = flushed.err();
            }
            recording.pending = was_recent;
        }
    }
}

/// Returns `ports` without the variables that their FMUs refuse to read, with a warning for each.
fn readable(system: &mut System, ports: &[Port], time: f64) -> Result<Vec<Port>, Error> {
    let refused = Readout::new(system, ports).unreadable(system, ports, time)?;
    for (port, error) in &refused {
        tracing::warn!("{}: {error}; it is left out of the results", system.name(*port));
    }
    let readable = ports.iter().filter(|port| refused.iter().all(|(refused, _)| refused != *port));
    Ok(readable.copied().collect())
}

/// Writes the rows of all open files when the process is about to end; returns each file with the
/// result. No recorder writes a row afterwards.
pub fn keep_results() -> Vec<(PathBuf, Result<(), ResultsError>)> {
    let files = match FILES.try_lock() {
        Ok(mut files) => files.open(),
        Err(_) => Vec::new(),
    };
    files.iter().filter_map(|file| keep(file)).collect()
}

/// Writes the rows of a file if its thread releases the lock in time.
fn keep(file: &Mutex<Recording>) -> Option<(PathBuf, Result<(), ResultsError>)> {
    for _ in 0..TRIES {
        let mut recording = match file.try_lock() {
            Ok(recording) => recording,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                std::thread::sleep(PAUSE);
                continue;
            }
        };
        let (path, mut sink) = (recording.path.clone(), recording.sink.take()?);
        // The FMU may have overwritten memory of the sink.
        let flushed = catch_unwind(AssertUnwindSafe(|| sink.flush()));
        std::mem::forget(sink);
        let damaged = || io::Error::other("the FMU has overwritten memory of the master");
        let lost = |_| Err(ResultsError::Write { path: path.clone(), source: damaged() });
        let outcome = flushed.unwrap_or_else(lost);
        return Some((path, outcome));
    }
    None
}

fn column(system: &System, port: Port) -> Column {
    let variable = system.variable(port);
    let kind = match &variable.kind {
        Kind::Boolean(_) | Kind::Clock(_) => ColumnKind::Boolean,
        Kind::String(_) | Kind::Binary(_) => ColumnKind::String,
        Kind::UInt32(_) | Kind::Int64(_) | Kind::UInt64(_) => ColumnKind::Long,
        other if other.as_real().is_some() => ColumnKind::Real,
        _ => ColumnKind::Integer,
    };
    let clocked = system.is_absent_between_ticks(port);
    Column { name: system.name(port), kind, unit: unit(system, port), clocked }
}

/// Returns the unit of a variable, if it has one.
#[must_use]
pub fn unit(system: &System, port: Port) -> Option<String> {
    match &system.variable(port).kind {
        Kind::Real(real) | Kind::Float32(real) => real.unit.clone(),
        _ => None,
    }
}

/// Returns the variables selected by `record` and not by `exclude`. A pattern matches inputs,
/// outputs and locals; a name may be any variable.
///
/// # Errors
///
/// Returns an error if a name or a pattern matches no variable.
pub fn select(system: &System, record: &[String], exclude: &[String]) -> Result<Vec<Port>, Error> {
    let shown = [Causality::Input, Causality::Output, Causality::Local];
    let mut ports: Vec<Port> =
        shown.into_iter().flat_map(|causality| system.ports(causality)).collect();
    ports.sort_by_key(|port| (port.slave, port.variable));
    // A name that two variables have stands for the first one.
    let mut known = HashSet::new();
    ports.retain(|port| known.insert(system.name(*port)));
    for name in record {
        if let Ok(port) = system.port(name)
            && !shown.contains(&system.variable(port).causality)
        {
            ports.push(port);
        }
    }
    let names: Vec<_> = ports.iter().map(|&port| system.name(port)).collect();
    let selection = Selection { include: record.to_vec(), exclude: exclude.to_vec() };
    let chosen = selection.choose(&names);
    let chosen = chosen.map_err(|error| Error::from(error).within("results"))?;
    Ok(chosen.into_iter().map(|position| ports[position]).collect())
}
