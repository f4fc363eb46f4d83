//! Checkpoints, the state of a simulation as data, and kept states, in memory for the same simulation.

mod origin;

use fmu_description::Experiment;
use fmu_description::number::seconds;
use serde::{Deserialize, Serialize};

use super::Simulation;
use crate::algorithm::Algorithm;
use crate::coupling::Iteration;
use crate::drive::{DriveState, Scenario};
use crate::engine::Ending;
use crate::error::{SystemError, call, contradiction};
use crate::exchange::Values;
use crate::fault::FaultChain;
use crate::step_control::Controller;
use crate::system::{Port, System};
use slave::Value;

pub(super) use origin::Origin;

/// The first slot of the slaves for [`Simulation::keep`], after the slots of the algorithms.
const FIRST_SLOT: usize = 3;

/// The complete state of a simulation. A resumed run gives the same results, bit for bit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    origin: Origin,
    /// Names of connections, then of driven variables, to compare a resumed system with the saved one.
    parts: Vec<String>,
    master: MasterState,
    /// Faults on connections, each with the input of its connection.
    faults: Vec<(Port, FaultChain)>,
    drives: Vec<DriveState>,
    /// For each slave: its name, the GUID of its FMU, its serialised FMU state.
    slaves: Vec<(String, String, Vec<u8>)>,
}

/// The state of the master without driven variables and faults.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct MasterState {
    time: f64,
    /// The latest end in s of a step that was attempted.
    attempted: f64,
    /// Number of grid points passed.
    count: u64,
    /// Size in s of the next step, chosen by the step control.
    size: f64,
    controller: Controller,
    iteration: Option<Iteration>,
    values: Values,
    /// Values of inputs that were set last by [`System::set_value`].
    inputs: Vec<(Port, Value)>,
    /// For each slave, the time in s of the event at which its last step ended; infinite if the step ended at no event.
    pending: Vec<f64>,
    ended: Option<Ending>,
}

impl Checkpoint {
    /// Returns the time reached in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.master.time
    }

    /// Returns the stop time in s that the FMUs received in `fmi2SetupExperiment`, if any. A
    /// resumed run passes the same stop time; an FMU may refuse to step beyond it.
    #[must_use]
    pub fn fmu_stop_time(&self) -> Option<f64> {
        self.origin.stop_time
    }
}

/// A state of a simulation in memory, see [`Simulation::keep`].
pub struct KeptState {
    master: MasterState,
    scenario: Scenario,
    slot: usize,
}

impl KeptState {
    /// Returns the slot given to [`Simulation::keep`].
    #[must_use]
    pub fn slot(&self) -> usize {
        self.slot
    }
}

impl Simulation {
    /// Returns the current state of the simulation.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU cannot serialise its state (`canSerializeFMUstate` is false) or
    /// fails to do so.
    pub fn checkpoint(&mut self) -> Result<Checkpoint, SystemError> {
        let time = self.engine.grid.time;
        let mut slaves = Vec::new();
        for (name, slave) in &mut self.engine.system.slaves {
            let flags = slave.description().co_simulation.as_ref();
            if !flags.is_some_and(|flags| flags.can_serialize_fmu_state) {
                return Err(SystemError::Capability {
                    slave: name.clone(),
                    lacks: "canSerializeFMUstate",
                    required_by: "a checkpoint".to_owned(),
                });
            }
            let bytes = slave.serialize_state().map_err(|source| call(name, time, source))?;
            slaves.push((name.clone(), slave.description().guid.clone(), bytes));
        }
        Ok(Checkpoint {
            origin: self.origin.clone(),
            parts: self.parts(),
            master: self.master_state(),
            faults: self.faults(),
            drives: self.engine.drives.state(),
            slaves,
        })
    }

    /// Keeps the current state in memory: the slaves keep their FMU states in `slot` (0, 1, 2, ...), in
    /// place of an earlier one.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU cannot save its state (`canGetAndSetFMUstate` is false) or fails to do
    /// so.
    pub fn keep(&mut self, slot: usize) -> Result<KeptState, SystemError> {
        let time = self.engine.grid.time;
        for (name, slave) in &mut self.engine.system.slaves {
            slave.save_state(FIRST_SLOT + slot).map_err(|source| call(name, time, source))?;
        }
        let scenario = Scenario { drives: self.engine.drives.clone(), faults: self.faults() };
        Ok(KeptState { master: self.master_state(), scenario, slot })
    }

    /// Returns to a kept state of this simulation, with its driven variables and faults. `state` is the result
    /// of the last call of [`Simulation::keep`] with its slot, which has overwritten the FMU states of earlier calls.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses its state.
    pub fn return_to(&mut self, state: &KeptState) -> Result<(), SystemError> {
        let KeptState { master, scenario, slot } = state;
        for (name, slave) in &mut self.engine.system.slaves {
            let restored = slave.restore_state(FIRST_SLOT + slot);
            restored.map_err(|source| call(name, master.time, source))?;
        }
        self.restore_master(master, scenario.clone())
    }

    fn master_state(&self) -> MasterState {
        let mut values = Values::default();
        self.engine.exchange.save(&mut values);
        let inputs = self.engine.system.input_values.iter();
        let mut inputs: Vec<_> = inputs.map(|(port, value)| (*port, value.clone())).collect();
        inputs.sort_unstable_by_key(|(port, _)| (port.slave, port.variable));
        MasterState {
            time: self.engine.grid.time,
            attempted: self.attempted,
            count: self.engine.grid.count,
            size: self.control.size,
            controller: self.control.controller.clone(),
            iteration: self.coupler.iterated.as_ref().map(|iterated| iterated.iteration.clone()),
            values,
            inputs,
            pending: self.engine.instants.pending.clone(),
            ended: self.ended,
        }
    }

    /// Creates the simulation of `checkpoint` with new slaves in `system`. The stop time may differ
    /// from the first run; the FMUs receive the stop time of the first run. Faults that have not begun may differ.
    ///
    /// # Errors
    ///
    /// Returns an error if [`Simulation::with_scenario`] does, if slaves, connections, faults that have begun, driven
    /// variables, start time or algorithm differ from the checkpoint, or if an FMU refuses its state.
    pub fn resume(
        system: System,
        algorithm: &Algorithm,
        experiment: &Experiment,
        scenario: Scenario,
        checkpoint: &Checkpoint,
    ) -> Result<Self, SystemError> {
        let origin = &checkpoint.origin;
        origin.expect(&Origin::new(&system, algorithm, experiment))?;
        let first_experiment = Experiment { stop_time: origin.stop_time, ..*experiment };
        let stop = experiment.stop_time;
        let mut simulation = Self::start(system, algorithm, &first_experiment, stop, scenario)?;
        simulation.restore(checkpoint)?;
        Ok(simulation)
    }

    /// Returns to the state of `checkpoint`, which this simulation or another one of the same system has
    /// given. Faults that have not begun may differ.
    ///
    /// # Errors
    ///
    /// Returns an error if slaves, connections, faults that have begun, driven variables, start time or algorithm
    /// differ from the checkpoint, or if an FMU refuses its state.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), SystemError> {
        let scenario = self.resumed_scenario(checkpoint)?;
        let states = checkpoint.slaves.iter();
        for ((name, slave), (_, _, bytes)) in self.engine.system.slaves.iter_mut().zip(states) {
            slave
                .deserialize_state(bytes)
                .map_err(|source| call(name, checkpoint.time(), source))?;
        }
        self.restore_master(&checkpoint.master, scenario)
    }

    /// Restores everything but the FMU states; `scenario` contains the memory of faults and drives at the time of
    /// `state`.
    fn restore_master(
        &mut self,
        state: &MasterState,
        scenario: Scenario,
    ) -> Result<(), SystemError> {
        self.engine.exchange.restore(&state.values);
        self.engine.exchange.set_faults(&self.engine.system, &scenario.faults)?;
        self.engine.drives = scenario.drives;
        self.engine.choose_sweep();
        self.engine.grid.resume(state.time, state.count);
        let (system, time) = (&mut self.engine.system, state.time);
        system.input_values = state.inputs.iter().cloned().collect();
        system.changes += 1;
        self.engine.instants.restore(system, &state.pending, time)?;
        self.attempted = state.attempted;
        self.ended = state.ended;
        self.control.size = state.size;
        self.control.controller = state.controller.clone();
        let iterated = &mut self.coupler.iterated;
        if let (Some(iterated), Some(iteration)) = (iterated, &state.iteration) {
            iterated.iteration = iteration.clone();
            iterated.failed_at = f64::NAN;
        }
        // Faults that the state lacks record the present values.
        self.engine.commit();
        Ok(())
    }

    /// Returns the faults on connections, each with the input of its connection.
    fn faults(&self) -> Vec<(Port, FaultChain)> {
        self.engine.exchange.faults().map(|(input, fault)| (input, fault.clone())).collect()
    }

    /// Returns the driven variables and the faults of this simulation with their memory in `checkpoint`. An error if
    /// slaves, connections, driven variables, start time, algorithm or faults that have begun differ from it.
    fn resumed_scenario(&mut self, checkpoint: &Checkpoint) -> Result<Scenario, SystemError> {
        self.expect_same_system(checkpoint)?;
        let (system, time) = (&self.engine.system, checkpoint.time());
        let other = |input: Port| {
            let (name, time) = (system.name(input), seconds(time));
            contradiction(format!(
                "{name} has other faults than in the checkpoint at t = {time} s: only faults that begin later may \
                 differ, delays only if they begin later by more than their length"
            ))
        };
        let mut faults = self.faults();
        for (input, saved) in &checkpoint.faults {
            let is_missing = faults.iter().all(|(known, _)| known != input);
            if is_missing && !FaultChain::default().resume(saved, time) {
                return Err(other(*input));
            }
        }
        for (input, chain) in &mut faults {
            let saved = checkpoint.faults.iter().find(|(known, _)| *known == *input);
            let saved = saved.map(|(_, chain)| chain.clone()).unwrap_or_default();
            if !chain.resume(&saved, time) {
                return Err(other(*input));
            }
        }
        let mut drives = self.engine.drives.clone();
        for (drive, saved) in drives.iter().zip(&checkpoint.drives) {
            if drive.resumed_faults(saved).is_none() {
                return Err(other(drive.port()));
            }
        }
        drives.restore(checkpoint.drives.clone())?;
        Ok(Scenario { drives, faults })
    }

    /// Returns the names of the connections and driven variables, in the order of the state.
    fn parts(&self) -> Vec<String> {
        let system = &self.engine.system;
        let connections = system.connections.iter().map(|connection| {
            let [from, to] = [connection.from, connection.to].map(|port| system.name(port));
            format!("the connection of {from} to {to}")
        });
        let drives = self.engine.drives.iter().map(|drive| system.name(drive.port()));
        let drives = drives.map(|name| format!("the driven variable {name}"));
        connections.chain(drives).collect()
    }

    /// Returns an error if slaves, connections, driven variables, start time or algorithm differ from the checkpoint.
    fn expect_same_system(&mut self, checkpoint: &Checkpoint) -> Result<(), SystemError> {
        checkpoint.origin.expect(&self.origin)?;
        let slaves = self.engine.system.slaves.iter();
        let present = slaves.map(|(name, slave)| [name, &slave.description().guid]);
        let saved = checkpoint.slaves.iter().map(|(name, guid, _)| [name, guid]);
        if !present.clone().eq(saved.clone()) {
            let list = |slave: [&String; 2]| slave.map(String::as_str).join(" ");
            return Err(contradiction(format!(
                "the checkpoint is one of other FMUs: expected {}, found {}",
                saved.map(list).collect::<Vec<_>>().join(", "),
                present.map(list).collect::<Vec<_>>().join(", ")
            )));
        }
        let (present, saved) = (self.parts(), &checkpoint.parts);
        let mut positions = 0..present.len().max(saved.len());
        if let Some(position) = positions.find(|&k| present.get(k) != saved.get(k)) {
            let [saved, present] = [saved, &present]
                .map(|parts| parts.get(position).map_or("nothing", String::as_str));
            return Err(contradiction(format!(
                "the checkpoint has {saved} in place of {present}, expected the same connections and driven variables \
                 in the same order"
            )));
        }
        let mut values = Values::default();
        self.engine.exchange.save(&mut values);
        if values.lengths() == checkpoint.master.values.lengths() {
            return Ok(());
        }
        Err(contradiction(
            "the checkpoint was taken with other signal types of connections, expected the same ones",
        ))
    }
}
