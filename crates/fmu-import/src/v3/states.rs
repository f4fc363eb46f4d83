//! FMU states together with the state of the slave: mode, next event, clocks, values set last.

use serde::{Deserialize, Serialize};
use slave::CallError;

use super::Instance;
use super::clocked::Memory;
use super::clocks::ClocksState;
use super::mode::Mode;
use super::modes::State;
use super::refusal::refused;

/// The first bytes of a serialised state: name and version of its format.
const MAGIC: &[u8; 8] = b"fmi3\0\0\0\x04";
const SERIALIZE: &str = "fmi3SerializeFMUState";
const DESERIALIZE: &str = "fmi3DeserializeFMUState";

/// The state of the slave in a serialised state; the state of the FMU follows.
#[derive(Serialize, Deserialize)]
struct SlaveState {
    initialized: bool,
    next_event: Option<f64>,
    event: bool,
    terminate: bool,
    time: f64,
    held: Vec<Option<u64>>,
    memory: Memory,
    clocks: ClocksState,
}

impl Instance {
    pub(crate) fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.component.save_state(slot)?;
        if self.slots.len() <= slot {
            self.slots.resize(slot + 1, State::default());
        }
        self.slots[slot].clone_from(&self.state);
        Ok(())
    }

    pub(crate) fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.component.restore_state(slot)?;
        if let Some(state) = self.slots.get(slot) {
            self.state.clone_from(state);
        }
        Ok(())
    }

    /// Returns the state of the slave, then the state of the FMU. In Event Mode it first handles the event.
    pub(crate) fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        if self.state.mode == Mode::Event {
            // A serialised state is never in Event Mode.
            self.handle_event()?;
        }
        let fmu_state = self.component.serialize_state()?;
        let State { mode, next_event, event, terminate, time, held, memory, clocks } = &self.state;
        let slave_state = SlaveState {
            initialized: mode.is_initialized(),
            next_event: *next_event,
            event: *event,
            terminate: *terminate,
            time: *time,
            held: held.clone(),
            memory: memory.clone(),
            clocks: clocks.state(),
        };
        postcard::to_extend(&(slave_state, fmu_state), MAGIC.to_vec())
            .map_err(|error| refused(SERIALIZE, format!("cannot store the state: {error}")))
    }

    pub(crate) fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let read = bytes.strip_prefix(MAGIC).and_then(|rest| postcard::from_bytes(rest).ok());
        let read = read.filter(|(saved, _): &(SlaveState, &[u8])| {
            saved.held.len() == self.state.held.len() && self.state.clocks.fits(&saved.clocks)
        });
        let Some((saved, fmu_state)) = read else {
            let what = "cannot restore the state: it is not one of this FMU".to_owned();
            return Err(refused(DESERIALIZE, what));
        };
        self.component.deserialize_state(fmu_state)?;
        let state = &mut self.state;
        state.mode = if saved.initialized { Mode::Step } else { Mode::Instantiated };
        (state.next_event, state.event) = (saved.next_event, saved.event);
        (state.terminate, state.time) = (saved.terminate, saved.time);
        (state.held, state.memory) = (saved.held, saved.memory);
        state.clocks.restore(&saved.clocks);
        Ok(())
    }
}
