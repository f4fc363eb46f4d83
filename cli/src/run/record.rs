//! Rows of results, read from the FMUs and written as the run goes.

use std::path::Path;

use anyhow::Context;
use fmi2::description::{Causality, Kind};
use master::results::{self, Column, ColumnKind, Decimation, Due, Row, Selection, Sink};
use master::{Port, Simulation, System, SystemError};

use crate::config::Every;

/// What is recorded, how often, and where to.
pub(crate) struct Recorder {
    sink: Box<dyn Sink>,
    due: Due,
    reads: Vec<Read>,
    reals: Vec<f64>,
    integers: Vec<i32>,
    booleans: Vec<i32>,
    strings: Vec<String>,
}

/// Columns of one FMU and one type that stand together.
struct Read {
    slave: usize,
    kind: ColumnKind,
    references: Vec<u32>,
    /// Position of the first among the columns of that type.
    first: usize,
}

impl Recorder {
    /// A recorder of `ports` into the file at `path`; none where nothing is to be recorded.
    pub(crate) fn create(
        path: &Path,
        system: &System,
        ports: &[Port],
        every: Every,
        start: f64,
    ) -> anyhow::Result<Option<Self>> {
        let decimation = match every {
            Every::Never => return Ok(None),
            Every::Step => Decimation::All,
            Every::Seconds(seconds) => Decimation::Every(seconds),
        };
        let columns: Vec<_> = ports.iter().map(|&port| column(system, port)).collect();
        let sink = results::create(path, &columns)?;
        let count = |kind| columns.iter().filter(|column| column.kind == kind).count();
        let mut recorder = Self {
            sink,
            due: Due::new(decimation, start),
            reads: Vec::new(),
            reals: vec![0.0; count(ColumnKind::Real)],
            integers: vec![0; count(ColumnKind::Integer)],
            booleans: vec![0; count(ColumnKind::Boolean)],
            strings: vec![String::new(); count(ColumnKind::String)],
        };
        recorder.plan(system, ports, &columns);
        Ok(Some(recorder))
    }

    /// Groups what one call can read.
    fn plan(&mut self, system: &System, ports: &[Port], columns: &[Column]) {
        let mut counts = [0_usize; 4];
        for (port, column) in ports.iter().zip(columns) {
            let count = &mut counts[column.kind as usize];
            let reference = system.variable(*port).value_reference;
            let last = self.reads.iter_mut().rev().find(|read| read.kind == column.kind);
            match last.filter(|read| read.slave == port.slave) {
                Some(read) => read.references.push(reference),
                None => self.reads.push(Read {
                    slave: port.slave,
                    kind: column.kind,
                    references: vec![reference],
                    first: *count,
                }),
            }
            *count += 1;
        }
        // One FMU after the other.
        self.reads.sort_by_key(|read| read.slave);
    }

    /// Goes on with the rows of a run that was resumed.
    pub(crate) fn set_due(&mut self, due: &Due) {
        self.due = due.clone();
    }

    /// Which rows come next.
    pub(crate) fn due(&self) -> &Due {
        &self.due
    }

    /// Records a row where one is due at the time of `simulation`.
    #[inline]
    pub(crate) fn sample(&mut self, simulation: &mut Simulation) -> anyhow::Result<()> {
        let time = simulation.time();
        if self.due.at(time) { self.record(simulation.system(), time) } else { Ok(()) }
    }

    fn record(&mut self, system: &mut System, time: f64) -> anyhow::Result<()> {
        for read in &self.reads {
            let (name, slave) = &mut system.slaves[read.slave];
            let range = read.first..read.first + read.references.len();
            let done = match read.kind {
                ColumnKind::Real => slave.get_real(&read.references, &mut self.reals[range]),
                ColumnKind::Integer => {
                    slave.get_integer(&read.references, &mut self.integers[range])
                }
                ColumnKind::Boolean => {
                    slave.get_boolean(&read.references, &mut self.booleans[range])
                }
                ColumnKind::String => slave.get_string(&read.references, &mut self.strings[range]),
            };
            if let Err(source) = done {
                return Err(SystemError::Call { slave: name.clone(), time, source }.into());
            }
        }
        let Self { reals, integers, booleans, strings, .. } = self;
        Ok(self.sink.row(time, &Row { reals, integers, booleans, strings })?)
    }

    /// Hands all rows over; the file is whole.
    pub(crate) fn flush(&mut self) -> anyhow::Result<()> {
        Ok(self.sink.flush()?)
    }

    /// Ends the file.
    pub(crate) fn finish(self) -> anyhow::Result<()> {
        Ok(self.sink.finish()?)
    }
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
pub(super) fn unit(system: &System, port: Port) -> Option<String> {
    match &system.variable(port).kind {
        Kind::Real(real) => real.unit.clone(),
        _ => None,
    }
}

/// The variables that `record` and `exclude` choose. Patterns are of inputs, outputs and locals; a
/// name may be that of any variable.
pub(crate) fn select(
    system: &System,
    record: &[String],
    exclude: &[String],
) -> anyhow::Result<Vec<Port>> {
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
    let chosen = selection.choose(&names).context("results")?;
    Ok(chosen.into_iter().map(|position| ports[position]).collect())
}
