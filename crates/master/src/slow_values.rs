//! Values of multirate slaves at the communication points within their steps.

use fmu_description::{Causality, Variability};
use serde::{Deserialize, Serialize};

use crate::error::SystemError;
use crate::readout::{Readout, array};
use crate::simulation::Simulation;
use crate::system::{Port, System};
use slave::ValueType;

/// The outputs and local variables of the slaves that step every several communication steps.
///
/// Such a slave is ahead of the others within its step. A row of results contains its values at the
/// time of the row: continuous Reals are interpolated between start and end of the slave's step; all
/// others have their value at its start.
#[derive(Debug, Default)]
pub struct SlowValues {
    slaves: Vec<SlowSlave>,
}

#[derive(Debug)]
struct SlowSlave {
    slave: usize,
    /// The values at the start of the slave's step.
    start_values: Readout,
    places: Vec<ValueIndex>,
}

/// The position of a value among the values of its type: at the start of the step, and in a row.
#[derive(Clone, Copy, Debug)]
struct ValueIndex {
    kind: ValueType,
    start: usize,
    row: usize,
    continuous: bool,
}

/// The values at the start of the steps, as stored in a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SlowState {
    names: Vec<String>,
    values: Vec<TypedValues>,
}

/// The values of one slave: Reals, Integers, Booleans, Strings.
type TypedValues = (Vec<f64>, Vec<i64>, Vec<i32>, Vec<String>);

impl SlowValues {
    /// Creates the values for a [`Readout`] of `ports`.
    #[must_use]
    pub fn new(simulation: &mut Simulation, ports: &[Port]) -> Self {
        let slow: Vec<usize> = simulation.slow_slaves().collect();
        let system = simulation.system();
        let slaves = slow.into_iter().map(|slave| SlowSlave::new(system, ports, slave)).collect();
        Self { slaves }
    }

    /// Reads the values of slaves that start a step at the current time. Call it before every
    /// [`Simulation::step`].
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a read.
    #[inline]
    pub fn before_step(&mut self, simulation: &mut Simulation) -> Result<(), SystemError> {
        for slow in &mut self.slaves {
            if simulation.current_step(slow.slave).is_none() {
                let time = simulation.time();
                slow.start_values.read(simulation.system(), time)?;
            }
        }
        Ok(())
    }

    /// Replaces the values in `row` of slaves that are ahead by their values at the time reached; call it
    /// right after reading `row`.
    pub fn apply(&self, simulation: &Simulation, row: &mut Readout) {
        for slow in &self.slaves {
            if let Some((start, end)) = simulation.current_step(slow.slave) {
                slow.apply((simulation.time() - start) / (end - start), row);
            }
        }
    }

    /// Returns the values for a checkpoint.
    #[must_use]
    pub fn state(&self, system: &System) -> SlowState {
        let values = |slow: &SlowSlave| {
            let Readout { reals, integers, booleans, strings, .. } = &slow.start_values;
            (reals.clone(), integers.clone(), booleans.clone(), strings.clone())
        };
        SlowState { names: self.names(system), values: self.slaves.iter().map(values).collect() }
    }

    /// Restores the values of a checkpoint. If the resumed run records other variables, it records the
    /// values at the end of the current step of each slave until the slave reaches this end.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a read.
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
                    let Readout { reals, integers, booleans, strings, .. } = &mut slow.start_values;
                    (*reals, *integers, *booleans, *strings) = values.clone();
                }
                None => slow.start_values.read(simulation.system(), time)?,
            }
        }
        Ok(())
    }

    fn names(&self, system: &System) -> Vec<String> {
        let ports = self.slaves.iter().flat_map(|slow| &slow.start_values.ports);
        ports.map(|&port| system.name(port)).collect()
    }
}

impl SlowSlave {
    fn new(system: &System, ports: &[Port], slave: usize) -> Self {
        let (mut ports_of_slave, mut places) = (Vec::new(), Vec::new());
        // Numbers of values of each type so far: start values, and values in a row.
        let mut counts = [[0; 2]; 4];
        for &port in ports {
            let variable = system.variable(port);
            let kind = array(ValueType::of(&variable.kind));
            let [starts, rows] = &mut counts[kind as usize];
            let row = *rows;
            *rows += 1;
            let changes = matches!(variable.causality, Causality::Output | Causality::Local);
            if port.slave == slave && changes {
                let continuous =
                    kind == ValueType::Real && variable.variability == Variability::Continuous;
                places.push(ValueIndex { kind, start: *starts, row, continuous });
                ports_of_slave.push(port);
                *starts += 1;
            }
        }
        Self { slave, start_values: Readout::new(system, &ports_of_slave), places }
    }

    /// Writes the values at the fraction `part` of the step to `row`.
    fn apply(&self, part: f64, row: &mut Readout) {
        let start_values = &self.start_values;
        for place in &self.places {
            let ValueIndex { start, row: at, .. } = *place;
            match place.kind {
                ValueType::Real => {
                    let (start, end) = (start_values.reals[start], row.reals[at]);
                    let part = if place.continuous { part } else { 0.0 };
                    row.reals[at] = start + part * (end - start);
                }
                ValueType::Integer => row.integers[at] = start_values.integers[start],
                ValueType::Boolean => row.booleans[at] = start_values.booleans[start],
                ValueType::String | ValueType::Binary => {
                    row.strings[at].clone_from(&start_values.strings[start]);
                }
            }
        }
    }
}
