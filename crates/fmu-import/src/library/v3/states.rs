//! FMU states: saved in numbered slots, or serialized to bytes.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ptr::null_mut;

use super::super::calls::function;
use super::super::canary;
use super::{Component, State};
use slave::{CallError, Failure, absent};

impl Component {
    /// Saves the current state in `slot` (`fmi3GetFMUState`).
    pub(crate) fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetFMUState";
        let function = function!(self.get_state, NAME);
        self.log_call(NAME, String::new);
        if self.saved.len() <= slot {
            self.saved.resize(slot + 1, null_mut());
        }
        // SAFETY: the instance is alive; the state is null or its own.
        let status = unsafe { function(self.pointer, &raw mut self.saved[slot]) };
        self.check(NAME, status)
    }

    /// Restores the state in `slot` (`fmi3SetFMUState`).
    pub(crate) fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetFMUState";
        let state = self.saved.get(slot).copied().unwrap_or(null_mut());
        if state.is_null() {
            let what = format!("cannot restore the state of slot {slot}: the slot is empty");
            return Err(self.failed(NAME, Failure::InvalidAnswer(what)));
        }
        self.set_state(state)
    }

    fn set_state(&mut self, state: State) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetFMUState";
        let function = function!(self.set_state, NAME);
        self.log_call(NAME, String::new);
        // SAFETY: the instance is alive; the state is its own.
        let status = unsafe { function(self.pointer, state) };
        self.check(NAME, status)
    }

    /// Frees a state of the instance.
    pub(super) fn free_state(&mut self, state: &mut State) {
        if let (Some(function), false) = (self.functions.free_state, state.is_null()) {
            self.place.enter(&"fmi3FreeFMUState");
            // SAFETY: the instance is alive, the state is its own.
            unsafe { function(self.pointer, &raw mut *state) };
            self.place.leave();
            *state = null_mut();
        }
    }

    /// Serializes the current state (`fmi3GetFMUState`, `fmi3SerializeFMUState`).
    pub(crate) fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        const NAME: &str = "fmi3GetFMUState";
        let function = function!(self.get_state, NAME);
        self.log_call(NAME, String::new);
        let mut state = null_mut();
        // SAFETY: the instance is alive; one state to write to.
        let status = unsafe { function(self.pointer, &raw mut state) };
        let bytes = self.check(NAME, status).and_then(|()| self.serialized(state));
        self.free_state(&mut state);
        bytes
    }

    fn serialized(&mut self, state: State) -> Result<Vec<u8>, CallError> {
        const SIZE: &str = "fmi3SerializedFMUStateSize";
        const NAME: &str = "fmi3SerializeFMUState";
        let mut size = 0;
        let function = function!(self.serialized_state_size, SIZE);
        self.log_call(SIZE, String::new);
        // SAFETY: the instance is alive, the state is its own.
        let status = unsafe { function(self.pointer, state, &raw mut size) };
        self.check(SIZE, status)?;
        let mut bytes =
            canary::bytes_of_state(size).map_err(|failure| self.failed(SIZE, failure))?;
        let function = function!(self.serialize_state, NAME);
        self.log_call(NAME, String::new);
        let done = canary::filled(self.guards, canary::BYTES, &mut bytes, |array| {
            // SAFETY: the instance is alive, the state is its own; `size` bytes to write to.
            (unsafe { function(self.pointer, state, array, size) }, None)
        });
        self.check_guarded(NAME, done, String::new)?;
        Ok(bytes)
    }

    /// Restores a serialized state (`fmi3DeserializeFMUState`, `fmi3SetFMUState`).
    pub(crate) fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        const NAME: &str = "fmi3DeserializeFMUState";
        let mut state = null_mut();
        let function = function!(self.deserialize_state, NAME);
        self.log_call(NAME, String::new);
        let done = canary::constant(self.guards, canary::BYTES, bytes, |array| {
            // SAFETY: the instance is alive; `bytes.len()` bytes to read, one state to write to.
            (unsafe { function(self.pointer, array, bytes.len(), &raw mut state) }, None)
        });
        let done = self.check_guarded(NAME, done, String::new).and_then(|()| self.set_state(state));
        self.free_state(&mut state);
        done
    }
}
