//! Records rows of results during the run.

use crate::error::Error;
use std::collections::HashSet;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, TryLockError, Weak};
use std::thread;
use std::time::Duration;

use fmu_description::{Causality, Kind, ModelDescription};
use master::{Port, Readout, Simulation, SlowValues, System};
use results::{self, Column, ColumnKind, Decimation, Due, ResultsError, Row, Selection, Sink};

use crate::config::Every;
use crate::store::lock;

/// All open results files, so that their rows can be written when the process ends.
static FILES: Mutex<Files> = Mutex::new(Files { open: Vec::new(), is_watched: false });
/// Longest time that a row stays in memory while the run records no further row.
const STALL: Duration = Duration::from_millis(250);
/// Number of attempts to lock a file when the process ends.
const TRIES: u32 = 50;
/// Pause between two attempts to lock a file.
const PAUSE: Duration = Duration::from_millis(10);

struct Files {
    open: Vec<Weak<Mutex<Recording>>>,
    /// Whether the thread of [`write_stalled`] runs.
    is_watched: bool,
}

impl Files {
    /// Returns the open files, and forgets the others.
    fn open(&mut self) -> Vec<Arc<Mutex<Recording>>> {
        self.open.retain(|file| file.strong_count() > 0);
        self.open.iter().filter_map(Weak::upgrade).collect()
    }
}

/// An open results file, shared by its recorder, [`write_stalled`] and [`keep_results`].
#[derive(Default)]
struct Recording {
    path: PathBuf,
    /// The sink; `None` after the file was completed or its recorder dropped, or after [`keep_results`].
    sink: Option<Box<dyn Sink>>,
    /// Whether a row was recorded since the last check of [`write_stalled`].
    recent: bool,
    /// Whether a row was recorded between the last two checks of [`write_stalled`] and may not be in the file yet.
    pending: bool,
    /// The error of a write by [`write_stalled`], which the next call of the recorder returns.
    failed: Option<ResultsError>,
}

impl Recording {
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

/// The recorder of a run: writes the values of variables to a results file or another sink at a given interval.
pub(crate) struct Recorder {
    recording: Arc<Mutex<Recording>>,
    /// The schedule of the next rows.
    pub(crate) due: Due,
    pub(crate) readout: Readout,
    /// The values of slaves that step every several communication steps.
    pub(crate) slow: SlowValues,
}

impl Recorder {
    /// Creates a recorder of `ports` to the file at `path` for a run that starts at `start` s; `None` if `every` is
    /// [`Every::Never`]. Leaves out variables that their FMUs refuse to read, with a warning for each.
    pub(crate) fn create(
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
            // If the thread cannot start, rows are written with later rows only.
            let watch = thread::Builder::new().name("results".to_owned()).spawn(write_stalled);
            files.is_watched = watch.is_ok();
        }
        drop(files);
        Ok(Some(recorder))
    }

    /// Like [`Recorder::create`], but writes to the sink that `make` returns for the columns of the variables.
    /// [`keep_results`] does not write these rows.
    pub(crate) fn with_sink(
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
        let recording = Recording { sink: Some(make(&columns)?), ..Recording::default() };
        let recording = Arc::new(Mutex::new(recording));
        Ok(Some(Self { recording, due, readout, slow }))
    }

    /// Records a row if the time of `simulation` is due for one. Call it once for each communication point, in order.
    #[inline]
    pub(crate) fn sample(&mut self, simulation: &mut Simulation) -> Result<(), Error> {
        let time = simulation.time();
        if self.due.at(time) { self.record(simulation, time) } else { Ok(()) }
    }

    fn record(&mut self, simulation: &mut Simulation, time: f64) -> Result<(), Error> {
        simulation.read(&mut self.readout)?;
        self.slow.apply(simulation, &mut self.readout);
        let Readout { reals, integers, booleans, strings, present, .. } = &self.readout;
        let row = Row { reals, integers, booleans, strings, present };
        Ok(lock(&self.recording).row(time, &row)?)
    }

    /// Writes all rows recorded so far to the file. Returns an error if the file cannot be written now or could not be
    /// written since the last call.
    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        Ok(lock(&self.recording).flush()?)
    }

    /// Completes the file, with the errors of [`Recorder::flush`]. Does nothing after [`keep_results`].
    pub(crate) fn finish(self) -> Result<(), Error> {
        let mut recording = lock(&self.recording);
        let failed = recording.failed.take().map_or(Ok(()), Err);
        let finished = recording.sink.take().map_or(Ok(()), Sink::finish);
        Ok(failed.and(finished)?)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // `write_stalled` may still hold the recording, so close the file here.
        drop(lock(&self.recording).sink.take());
    }
}

/// Writes the rows of files whose run has recorded no further row for [`STALL`], because an FMU may need long for its
/// step or hang until the process is killed. Returns when no file is open.
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
            // A locked file is being written by its run.
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

/// Returns `ports` without the variables that their FMUs refuse to read, and logs a warning for each variable left out.
fn readable(system: &mut System, ports: &[Port], time: f64) -> Result<Vec<Port>, Error> {
    let refused = Readout::new(system, ports).unreadable(system, ports, time)?;
    for (port, error) in &refused {
        tracing::warn!("{}: {error}; it is left out of the results", system.name(*port));
    }
    let readable = ports.iter().filter(|port| refused.iter().all(|(refused, _)| refused != *port));
    Ok(readable.copied().collect())
}

/// Writes the rows of all open files when the process is about to end; returns each file with the
/// result. No recorder of these files writes a row afterwards. Leaves out files that another thread keeps
/// locked for half a second, and all files if their list is locked.
pub fn keep_results() -> Vec<(PathBuf, Result<(), ResultsError>)> {
    let files = match FILES.try_lock() {
        Ok(mut files) => files.open(),
        Err(_) => Vec::new(),
    };
    files.iter().filter_map(|file| keep(file)).collect()
}

/// Writes the rows of a file; `None` if the file stays locked or is already completed.
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
    let kind = column_kind(&system.variable(port).kind, system.slaves[port.slave].1.description());
    let clocked = system.is_absent_between_ticks(port);
    Column { name: system.name(port), kind, unit: unit(system, port), clocked }
}

/// Returns the type of the column of a variable of this kind in an FMU with this `description`.
fn column_kind(kind: &Kind, description: &ModelDescription) -> ColumnKind {
    match kind {
        Kind::Boolean(_) | Kind::Clock(_) => ColumnKind::Boolean,
        Kind::String(_) | Kind::Binary(_) => ColumnKind::String,
        Kind::UInt32(_) | Kind::Int64(_) | Kind::UInt64(_) => ColumnKind::Long,
        Kind::Enumeration(_) if has_long_item(kind, description) => ColumnKind::Long,
        other if other.as_real().is_some() => ColumnKind::Real,
        _ => ColumnKind::Integer,
    }
}

/// Whether the type of an enumeration has an item beyond 32 bits, as in FMI 3.0.
fn has_long_item(kind: &Kind, description: &ModelDescription) -> bool {
    let declared = description.types.iter().find(|one| kind.declared_type() == Some(&*one.name));
    declared.is_some_and(|one| one.items.iter().any(|(_, value)| i32::try_from(*value).is_err()))
}

/// Returns the unit of a variable, if the variable has one.
#[must_use]
pub fn unit(system: &System, port: Port) -> Option<String> {
    system.variable(port).kind.as_real().and_then(|real| real.unit.clone())
}

/// Returns the variables selected by `record` and not by `exclude`; without `record`, all inputs, outputs and locals. A
/// pattern matches inputs, outputs and locals; a name may be any variable.
///
/// # Errors
///
/// Returns an error if a name or a pattern matches no variable, or if `exclude` leaves none.
pub fn select(system: &System, record: &[String], exclude: &[String]) -> Result<Vec<Port>, Error> {
    let shown = [Causality::Input, Causality::Output, Causality::Local];
    let mut ports: Vec<Port> =
        shown.into_iter().flat_map(|causality| system.ports(causality)).collect();
    ports.sort_by_key(|port| (port.slave, port.variable));
    // Of several variables with the same name, the first one counts.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enumeration_with_an_item_beyond_32_bits_has_a_column_of_64_bits() {
        let xml = r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="t">
            <CoSimulation modelIdentifier="M"/>
            <TypeDefinitions>
            <EnumerationType name="Size"><Item name="small" value="1"/>
            <Item name="huge" value="2147483648"/></EnumerationType>
            <EnumerationType name="Gear"><Item name="first" value="2147483647"/></EnumerationType>
            </TypeDefinitions>
            <ModelVariables>
            <Float64 name="time" valueReference="0" causality="independent"/>
            <Enumeration name="size" valueReference="1" causality="input" declaredType="Size" start="1"/>
            <Enumeration name="gear" valueReference="2" causality="input" declaredType="Gear"
                start="2147483647"/>
            </ModelVariables><ModelStructure/></fmiModelDescription>"#;
        let description = ModelDescription::parse(xml).unwrap();
        let kinds = description.variables.iter().map(|one| column_kind(&one.kind, &description));
        let expected = [ColumnKind::Real, ColumnKind::Long, ColumnKind::Integer];
        assert_eq!(kinds.collect::<Vec<_>>(), expected);
    }
}
