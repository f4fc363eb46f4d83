//! Samples of a run: kept in columns while it goes, written as CSV when it ends.

use std::path::Path;

use anyhow::Context;
use fmi2::description::Causality;
use master::{Port, Probe, Simulation, System};

use crate::whole_file;

/// Every input, output and local variable of a system at chosen times.
pub(crate) struct Recording {
    probe: Probe,
    every: f64,
    start: f64,
    samples: f64,
    time: Vec<f64>,
    /// One for each variable of the probe.
    columns: Vec<Vec<f64>>,
    row: Vec<f64>,
}

impl Recording {
    /// A recording every `every` s from `start` on, at the first communication point not before.
    pub(crate) fn new(system: &System, start: f64, every: f64) -> Self {
        let mut ports: Vec<Port> = [Causality::Input, Causality::Output, Causality::Local]
            .into_iter()
            .flat_map(|causality| system.ports(causality))
            .collect();
        ports.sort_by_key(|port| (port.slave, port.variable));
        let probe = Probe::new(system, &ports);
        let count = probe.names().len();
        Self {
            probe,
            every,
            start,
            samples: 0.0,
            time: Vec::new(),
            columns: vec![Vec::new(); count],
            row: vec![0.0; count],
        }
    }

    /// Takes a sample where the next one is due at the time of `simulation`.
    pub(crate) fn sample(
        &mut self,
        simulation: &mut Simulation,
    ) -> Result<(), master::SystemError> {
        let time = simulation.time();
        let due = self.start + self.samples * self.every;
        if time < due - 1e-9 * self.every {
            return Ok(());
        }
        self.samples = ((time - self.start) / self.every + 1e-9).floor() + 1.0;
        self.probe.read(simulation.system(), time, &mut self.row)?;
        self.time.push(time);
        for (column, value) in self.columns.iter_mut().zip(&self.row) {
            column.push(*value);
        }
        Ok(())
    }

    /// The values of `time` or a variable `slave.name`.
    pub(crate) fn column(&self, name: &str) -> Option<&[f64]> {
        if name == "time" {
            return Some(&self.time);
        }
        let position = self.probe.names().iter().position(|known| known == name)?;
        Some(&self.columns[position])
    }

    /// Writes all samples to `path`: whole or not at all.
    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(
            std::iter::once("time").chain(self.probe.names().iter().map(String::as_str)),
        )?;
        for (row, time) in self.time.iter().enumerate() {
            let values = self.columns.iter().map(|column| number(column[row]));
            writer.write_record(std::iter::once(number(*time)).chain(values))?;
        }
        let text = writer.into_inner().map_err(|error| anyhow::anyhow!("{error}"))?;
        whole_file::write(path, &text).with_context(|| format!("cannot write {}", path.display()))
    }
}

/// The shortest text that reads back as the same number; whole numbers without a point.
fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        format!("{value}")
    } else {
        format!("{value:?}")
    }
}
