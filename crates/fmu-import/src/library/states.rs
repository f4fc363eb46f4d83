//! FMU states: saved in numbered slots, or serialized to bytes.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ptr::null_mut;

use fmu_description::abi::fmi2FMUstate;

use super::calls::function;
use super::{Component, canary};
use slave::{CallError, Failure, absent};

impl Component {
    /// Saves the current state in `slot` (`fmi2GetFMUstate`).
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        const NAME: &str = "fmi2GetFMUstate";
        let function = function!(self.get_state, NAME);
        if self.saved.len() <= slot {
            self.saved.resize(slot + 1, null_mut());
        }
        // SAFETY: the instance is alive; the state is null or its own.
        let status = unsafe { function(self.pointer, &raw mut self.saved[slot]) };
        self.check(NAME, status)
    }

    /// Restores the state in `slot` (`fmi2SetFMUstate`).
    ///
    /// # Errors
    ///
    /// [`CallError`] if the slot is empty, if the library lacks the function, or if its status is neither
    /// `fmi2OK` nor `fmi2Warning`.
    pub fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetFMUstate";
        let state = self.saved.get(slot).copied().unwrap_or(null_mut());
        if state.is_null() {
            let what = format!("cannot restore the state of slot {slot}: the slot is empty");
            return Err(self.failed(NAME, Failure::InvalidAnswer(what)));
        }
        self.set_state(state)
    }

    fn set_state(&mut self, state: fmi2FMUstate) -> Result<(), CallError> {
        const NAME: &str = "fmi2SetFMUstate";
        let function = function!(self.set_state, NAME);
        // SAFETY: the instance is alive; the state is its own.
        let status = unsafe { function(self.pointer, state) };
        self.check(NAME, status)
    }

    /// Frees a state of the instance.
    pub(super) fn free_state(&mut self, state: &mut fmi2FMUstate) {
        if let (Some(function), false) = (self.functions.free_state, state.is_null()) {
            self.place.enter(&"fmi2FreeFMUstate");
            // SAFETY: the instance is alive, the state is its own.
            unsafe { function(self.pointer, &raw mut *state) };
            self.place.leave();
            *state = null_mut();
        }
    }

    /// Serializes the current state (`fmi2GetFMUstate`, `fmi2SerializeFMUstate`).
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        const NAME: &str = "fmi2GetFMUstate";
        let function = function!(self.get_state, NAME);
        let mut state = null_mut();
        // SAFETY: the instance is alive; one state to write to.
        let status = unsafe { function(self.pointer, &raw mut state) };
        let bytes = self.check(NAME, status).and_then(|()| self.serialized(state));
        self.free_state(&mut state);
        bytes
    }

    fn serialized(&mut self, state: fmi2FMUstate) -> Result<Vec<u8>, CallError> {
        const SIZE: &str = "fmi2SerializedFMUstateSize";
        const NAME: &str = "fmi2SerializeFMUstate";
        let mut size = 0;
        let function = function!(self.serialized_state_size, SIZE);
        // SAFETY: the instance is alive, the state is its own.
        let status = unsafe { function(self.pointer, state, &raw mut size) };
        self.check(SIZE, status)?;
        let mut bytes =
            canary::bytes_of_state(size).map_err(|failure| self.failed(SIZE, failure))?;
        let function = function!(self.serialize_state, NAME);
        let done = canary::filled(self.guards, canary::BYTES, &mut bytes, |array| {
            // SAFETY: the instance is alive, the state is its own; `size` bytes to write to.
            (unsafe { function(self.pointer, state, array.cast(), size) }, None)
        });
        self.check_guarded(NAME, done)?;
        Ok(bytes)
    }

    /// Restores a serialized state (`fmi2DeSerializeFMUstate`, `fmi2SetFMUstate`).
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, or if its status is neither `fmi2OK` nor
    /// `fmi2Warning`.
    pub fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        const NAME: &str = "fmi2DeSerializeFMUstate";
        let mut state = null_mut();
        let function = function!(self.deserialize_state, NAME);
        let done = canary::constant(self.guards, canary::BYTES, bytes, |array| {
            // SAFETY: the instance is alive; `bytes.len()` bytes to read, one state to write to.
            (unsafe { function(self.pointer, array.cast(), bytes.len(), &raw mut state) }, None)
        });
        let done = self.check_guarded(NAME, done).and_then(|()| self.set_state(state));
        self.free_state(&mut state);
        done
    }
}
