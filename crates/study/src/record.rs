//! Rows of results, read from the FMUs and written as the run goes.

use crate::error::Error;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak};
use std::time::Duration;

use fmu_description::{Causality, Kind};
use master::{Port, Readout, Simulation, SlowState, SlowValues, System};
use results::{self, Column, ColumnKind, Decimation, Due, ResultsError, Row, Selection, Sink};

use crate::config::Every;

/// The files that recorders write to.
static FILES: Mutex<Vec<Weak<Mutex<Recording>>>> = Mutex::new(Vec::new());
/// How often, and how long, the end of the process tries to take a file from the thread that has it.
const TRIES: u32 = 50;
const PAUSE: Duration = Duration::from_millis(10);

/// A file of results as it is written; the end of the process takes it over.
struct Recording {
    path: PathBuf,
    /// None after the end of the file.
    sink: Option<Box<dyn Sink>>,
}

/// What is recorded, how often, and where to.
pub struct Recorder {
    recording: Arc<Mutex<Recording>>,
    due: Due,
    readout: Readout,
    slow: SlowValues,
}

impl Recorder {
    /// A recorder of `ports` into the file at `path`; none where nothing is to be recorded.
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
        let sink = Some(results::create(path, &columns)?);
        let recording = Arc::new(Mutex::new(Recording { path: path.to_owned(), sink }));
        let mut files = FILES.lock().unwrap_or_else(PoisonError::into_inner);
        files.retain(|file| file.strong_count() > 0);
        files.push(Arc::downgrade(&recording));
        Ok(Some(Self { recording, due, readout, slow }))
    }

    /// Goes on with the rows of a run that was resumed.
    pub fn set_due(&mut self, due: &Due) {
        self.due = due.clone();
    }

    /// Which rows come next.
    #[must_use]
    pub fn due(&self) -> &Due {
        &self.due
    }

    /// Records a row where one is due at the time of `simulation`.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    #[inline]
    pub fn sample(&mut self, simulation: &mut Simulation) -> Result<(), Error> {
        let time = simulation.time();
        if self.due.at(time) { self.record(simulation, time) } else { Ok(()) }
    }

    /// Before a step: see [`SlowValues::before_step`].
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    #[inline]
    pub fn before_step(&mut self, simulation: &mut Simulation) -> Result<(), Error> {
        Ok(self.slow.before_step(simulation)?)
    }

    /// What a checkpoint holds of the recording.
    pub fn slow_state(&self, simulation: &mut Simulation) -> SlowState {
        self.slow.state(simulation.system())
    }

    /// Goes on with the recording of a run that was resumed.
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
        let Readout { reals, integers, booleans, strings, .. } = &self.readout;
        let row = Row { reals, integers, booleans, strings };
        let mut recording = lock(&self.recording);
        Ok(recording.sink.as_mut().map_or(Ok(()), |sink| sink.row(time, &row))?)
    }

    /// Hands all rows over; the file is whole.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn flush(&mut self) -> Result<(), Error> {
        Ok(lock(&self.recording).sink.as_mut().map_or(Ok(()), |sink| sink.flush())?)
    }

    /// Ends the file.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn finish(self) -> Result<(), Error> {
        let sink = lock(&self.recording).sink.take();
        Ok(sink.map_or(Ok(()), Sink::finish)?)
    }
}

/// `ports` without the variables that their FMUs refuse to read, which are named in a warning.
fn readable(system: &mut System, ports: &[Port], time: f64) -> Result<Vec<Port>, Error> {
    let refused = Readout::new(system, ports).unreadable(system, ports, time)?;
    for (port, error) in &refused {
        tracing::warn!("{}: {error}; it is left out of the results", system.name(*port));
    }
    let kept = ports.iter().filter(|port| refused.iter().all(|(refused, _)| refused != *port));
    Ok(kept.copied().collect())
}

fn lock(recording: &Mutex<Recording>) -> MutexGuard<'_, Recording> {
    recording.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Hands the rows of all open files over, for a process that is about to end: the files, and what
/// became of them. No recorder writes another row.
pub fn keep_results() -> Vec<(PathBuf, Result<(), ResultsError>)> {
    let files = match FILES.try_lock() {
        Ok(files) => files.iter().filter_map(Weak::upgrade).collect(),
        Err(_) => Vec::new(),
    };
    files.iter().filter_map(|file| keep(file)).collect()
}

/// Hands the rows over where the thread that writes it lets go of it in time.
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
        // The FMU may have written over what the sink needs.
        let kept = catch_unwind(AssertUnwindSafe(|| sink.flush()));
        std::mem::forget(sink);
        let damaged = || io::Error::other("the FMU wrote over memory that is not its own");
        let lost = |_| Err(ResultsError::Write { path: path.clone(), source: damaged() });
        let kept = kept.unwrap_or_else(lost);
        return Some((path, kept));
    }
    None
}

fn column(system: &System, port: Port) -> Column {
    let variable = system.variable(port);
    let kind = match &variable.kind {
        Kind::Real(_) => ColumnKind::Real,
        Kind::Integer(_) | Kind::Enumeration(_) => ColumnKind::Integer,
        Kind::Boolean(_) => ColumnKind::Boolean,
        Kind::String(_) => ColumnKind::String,
    };
    Column { name: system.name(port), kind, unit: unit(system, port) }
}

/// The unit of a variable, where it has one.
#[must_use]
pub fn unit(system: &System, port: Port) -> Option<String> {
    match &system.variable(port).kind {
        Kind::Real(real) => real.unit.clone(),
        _ => None,
    }
}

/// The variables that `record` and `exclude` choose. Patterns are of inputs, outputs and locals; a
/// name may be that of any variable.
///
/// # Errors
///
/// [`Error`] with the reason.
pub fn select(system: &System, record: &[String], exclude: &[String]) -> Result<Vec<Port>, Error> {
    let shown = [Causality::Input, Causality::Output, Causality::Local];
    let mut ports: Vec<Port> =
        shown.into_iter().flat_map(|causality| system.ports(causality)).collect();
    ports.sort_by_key(|port| (port.slave, port.variable));
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
