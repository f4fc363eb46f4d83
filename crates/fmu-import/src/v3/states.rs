//! FMU states together with the state of the slave: mode, next event, clocks, values set last.

use serde::{Deserialize, Serialize};
use slave::CallError;

use super::Instance;
use super::clocked::Memory;
use super::clocks::Clocks;
use super::modes::Mode;
use crate::error::refused;

/// The first bytes of a serialised state: name and version of the format.
const MAGIC: &[u8; 8] = b"fmi3\0\0\0\x04";
const SERIALIZE: &str = "fmi3SerializeFMUState";
const DESERIALIZE: &str = "fmi3DeserializeFMUState";

/// The state of the slave, which is saved with the state of the FMU.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct State {
    #[serde(skip)]
    pub(super) mode: Mode,
    /// `nextEventTime` in s.
    pub(super) next_event: Option<f64>,
    /// Whether an event has happened that the master has not handled yet.
    pub(super) event: bool,
    /// Whether the FMU has requested the end of the simulation.
    pub(super) terminate: bool,
    /// The time reached, in s.
    pub(super) time: f64,
    /// Bits of the values set last of the elements that may change in Event Mode only; for Strings and binaries a hash.
    pub(super) held: Vec<Option<u64>>,
    /// Values of clocked elements at their last tick, or to be set at their next tick.
    pub(super) memory: Memory,
    pub(super) clocks: Clocks,
}

/// A serialised state: whether the initialization has ended, the state of the slave, the state of the FMU.
type Saved<'a> = (bool, State, &'a [u8]);

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

    /// Returns the state of the slave, then the state of the FMU. In Event Mode, handles the event first.
    pub(crate) fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        if self.state.mode == Mode::Event {
            // A serialised state is never in Event Mode.
            self.handle_event()?;
        }
        let fmu_state = self.component.serialize_state()?;
        let initialized = self.state.mode.is_initialized();
        postcard::to_extend(&(initialized, &self.state, fmu_state), MAGIC.to_vec())
            .map_err(|error| refused(SERIALIZE, format!("cannot store the state: {error}")))
    }

    pub(crate) fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let read = bytes.strip_prefix(MAGIC).and_then(|rest| postcard::from_bytes(rest).ok());
        let read = read.filter(|(_, saved, _): &Saved<'_>| {
            saved.held.len() == self.state.held.len() && self.state.clocks.fits(&saved.clocks)
        });
        let Some((initialized, saved, fmu_state)) = read else {
            let what = "cannot restore the state: it is not one of this FMU".to_owned();
            return Err(refused(DESERIALIZE, what));
        };
        self.component.deserialize_state(fmu_state)?;
        let mode = if initialized { Mode::Step } else { Mode::Instantiated };
        let mut clocks = std::mem::take(&mut self.state.clocks);
        clocks.restore(&saved.clocks);
        self.state = State { mode, clocks, ..saved };
        Ok(())
    }
}
