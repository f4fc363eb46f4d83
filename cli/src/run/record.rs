//! Rows of results, read from the FMUs and written as the run goes.

use std::path::Path;

use anyhow::Context;
use fmi2::description::{Causality, Kind};
use master::results::{self, Column, ColumnKind, Decimation, Due, Row, Selection, Sink};
use master::{Port, Readout, Simulation, SlowState, SlowValues, System};

use crate::config::Every;

/// What is recorded, how often, and where to.
pub(crate) struct Recorder {
    sink: Box<dyn Sink>,
    due: Due,
    readout: Readout,
    slow: SlowValues,
}

impl Recorder {
    /// A recorder of `ports` into the file at `path`; none where nothing is to be recorded.
    pub(crate) fn create(
        path: &Path,
        simulation: &mut Simulation,
        ports: &[Port],
        every: Every,
        start: f64,
    ) -> anyhow::Result<Option<Self>> {
        let decimation = match every {
            Every::Never => return Ok(None),
            Every::Step => Decimation::All,
            Every::Seconds(seconds) => Decimation::Every(seconds),
        };
        let slow = SlowValues::new(simulation, ports);
        let system = simulation.system();
        let columns: Vec<_> = ports.iter().map(|&port| column(system, port)).collect();
        let (due, readout) = (Due::new(decimation, start), Readout::new(system, ports));
        Ok(Some(Self { sink: results::create(path, &columns)?, due, readout, slow }))
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
        if self.due.at(time) { self.record(simulation, time) } else { Ok(()) }
    }

    /// Before a step: see [`SlowValues::before_step`].
    #[inline]
    pub(crate) fn before_step(&mut self, simulation: &mut Simulation) -> anyhow::Result<()> {
        Ok(self.slow.before_step(simulation)?)
    }

    /// What a checkpoint holds of the recording.
    pub(crate) fn slow_state(&self, simulation: &mut Simulation) -> SlowState {
        self.slow.state(simulation.system())
    }

    /// Goes on with the recording of a run that was resumed.
    pub(crate) fn restore(
        &mut self,
        simulation: &mut Simulation,
        state: &SlowState,
    ) -> anyhow::Result<()> {
        Ok(self.slow.restore(simulation, state)?)
    }

    fn record(&mut self, simulation: &mut Simulation, time: f64) -> anyhow::Result<()> {
        self.readout.read(simulation.system(), time)?;
        self.slow.apply(simulation, &mut self.readout);
        let Readout { reals, integers, booleans, strings, .. } = &self.readout;
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
