//! Values of slaves that make several steps at once, at the communication points on their way.

use fmu_description::{Causality, Kind, Variability};
use serde::{Deserialize, Serialize};

use super::{ReadKind, Readout};
use crate::error::SystemError;
use crate::simulation::Simulation;
use crate::system::{Port, System};

/// The outputs and local variables of the slaves with a multiple of the communication step. Such a
/// slave is ahead of the others between the points where it ends its steps; a row of results gets
/// the values of its own time: of continuous Reals those on the line between begin and end of the
/// slave's step, of all others those at the begin.
#[derive(Debug, Default)]
pub struct SlowValues {
    slaves: Vec<SlowSlave>,
}

#[derive(Debug)]
struct SlowSlave {
    slave: usize,
    /// The values at the begin of its step.
    begins: Readout,
    places: Vec<Place>,
}

/// A value: where it is among those of its type, at the begins and in a row.
#[derive(Clone, Copy, Debug)]
struct Place {
    kind: ReadKind,
    begin: usize,
    row: usize,
    continuous: bool,
}

/// Values at the begins of steps, as a checkpoint holds them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SlowState {
    names: Vec<String>,
    values: Vec<Begins>,
}

/// Those of one slave, by type.
type Begins = (Vec<f64>, Vec<i32>, Vec<i32>, Vec<String>);

impl SlowValues {
    /// For a [`Readout`] of `ports`.
    #[must_use]
    pub fn new(simulation: &mut Simulation, ports: &[Port]) -> Self {
        let slow: Vec<usize> = simulation.slow_slaves().collect();
        let system = simulation.system();
        let slaves = slow.into_iter().map(|slave| SlowSlave::new(system, ports, slave)).collect();
        Self { slaves }
    }

    /// Takes note of the values of slaves whose next step begins here. To be called before every
    /// [`Simulation::step`].
    ///
    /// # Errors
    ///
    /// Where an FMU refuses.
    #[inline]
    pub fn before_step(&mut self, simulation: &mut Simulation) -> Result<(), SystemError> {
        for slow in &mut self.slaves {
            if simulation.step_beyond(slow.slave).is_none() {
                let time = simulation.time();
                slow.begins.read(simulation.system(), time)?;
            }
        }
        Ok(())
    }

    /// Gives `row`, just read, the values of the time reached.
    pub fn apply(&self, simulation: &Simulation, row: &mut Readout) {
        for slow in &self.slaves {
            if let Some((begin, end)) = simulation.step_beyond(slow.slave) {
                slow.apply((simulation.time() - begin) / (end - begin), row);
            }
        }
    }

    /// For a checkpoint.
    #[must_use]
    pub fn state(&self, system: &System) -> SlowState {
        let values = |slow: &SlowSlave| {
            let Readout { reals, integers, booleans, strings, .. } = &slow.begins;
            (reals.clone(), integers.clone(), booleans.clone(), strings.clone())
        };
        SlowState { names: self.names(system), values: self.slaves.iter().map(values).collect() }
    }

    /// Takes over the state of a run that goes on. Where other variables are recorded, those of
    /// slaves on their way have the values at the end of their step until that is reached.
    ///
    /// # Errors
    ///
    /// Where an FMU refuses to be read.
    pub fn restore(
        &mut self,
        simulation: &mut Simulation,
        state: &SlowState,
    ) -> Result<(), SystemError> {
        let time = simulation.time();
        let same = self.names(simulation.system()) == state.names;
        for (position, slow) in self.slaves.iter_mut().enumerate() {
            match state.values.get(position).filter(|_| same) {
                Some(values) => {
                    let begins = &mut slow.begins;
                    (begins.reals, begins.integers, begins.booleans, begins.strings) =
                        values.clone();
                }
                None => slow.begins.read(simulation.system(), time)?,
            }
        }
        Ok(())
    }

    fn names(&self, system: &System) -> Vec<String> {
        let ports = self.slaves.iter().flat_map(|slow| &slow.begins.ports);
        ports.map(|&port| system.name(port)).collect()
    }
}

impl SlowSlave {
    fn new(system: &System, ports: &[Port], slave: usize) -> Self {
        let (mut own, mut places) = (Vec::new(), Vec::new());
        // How many values of each type there are so far, at the begins and in a row.
        let mut counts = [[0; 2]; 4];
        for &port in ports {
            let variable = system.variable(port);
            let kind = ReadKind::of(&variable.kind);
            let [begins, rows] = &mut counts[kind as usize];
            let row = *rows;
            *rows += 1;
            let changes = matches!(variable.causality, Causality::Output | Causality::Local);
            if port.slave == slave && changes {
                let continuous = matches!(variable.kind, Kind::Real(_))
                    && variable.variability == Variability::Continuous;
                places.push(Place { kind, begin: *begins, row, continuous });
                own.push(port);
                *begins += 1;
            }
        }
        Self { slave, begins: Readout::new(system, &own), places }
    }

    /// The values at that part of the step.
    fn apply(&self, part: f64, row: &mut Readout) {
        let begins = &self.begins;
        for place in &self.places {
            let Place { begin, row: at, .. } = *place;
            match place.kind {
                ReadKind::Real => {
                    let (start, end) = (begins.reals[begin], row.reals[at]);
                    let part = if place.continuous { part } else { 0.0 };
                    row.reals[at] = start + part * (end - start);
                }
                ReadKind::Integer => row.integers[at] = begins.integers[begin],
                ReadKind::Boolean => row.booleans[at] = begins.booleans[begin],
                ReadKind::String => row.strings[at].clone_from(&begins.strings[begin]),
            }
        }
    }
}
