//! FMU states: kept in numbered slots, as bytes.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ptr::null_mut;

use fmi2::abi::fmi2FMUstate;

use super::Component;
use super::calls::function;
use crate::slave::{CallError, Failure, absent};

impl Component {
    /// `fmi2GetFMUstate` into a slot.
    pub(crate) fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        let name = "fmi2GetFMUstate";
        let function = function!(self.get_state, name);
        if self.saved.len() <= slot {
            self.saved.resize(slot + 1, null_mut());
        }
        // SAFETY: the instance is alive; the state is null or its own.
        let status = unsafe { function(self.pointer, &raw mut self.saved[slot]) };
        self.check(name, status)
    }

    /// `fmi2SetFMUstate` from a slot.
    pub(crate) fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        let name = "fmi2SetFMUstate";
        let state = self.saved.get(slot).copied().unwrap_or(null_mut());
        if state.is_null() {
            let what = format!("was asked for the state of slot {slot}, which is empty");
            return Err(self.failed(name, Failure::Nonsense(what)));
        }
        self.set_state(state)
    }

    fn set_state(&mut self, state: fmi2FMUstate) -> Result<(), CallError> {
        let name = "fmi2SetFMUstate";
        let function = function!(self.set_state, name);
        // SAFETY: the instance is alive; the state is its own.
        let status = unsafe { function(self.pointer, state) };
        self.check(name, status)
    }

    /// Frees a state of the instance.
    pub(super) fn free_state(&mut self, state: &mut fmi2FMUstate) {
        if let (Some(function), false) = (self.functions.free_state, state.is_null()) {
            // SAFETY: the instance is alive, the state is its own.
            unsafe { function(self.pointer, &raw mut *state) };
            *state = null_mut();
        }
    }

    /// `fmi2SerializeFMUstate` of the state of now.
    pub(crate) fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        let name = "fmi2GetFMUstate";
        let function = function!(self.get_state, name);
        let mut state = null_mut();
        // SAFETY: the instance is alive; one state to write to.
        let status = unsafe { function(self.pointer, &raw mut state) };
        let bytes = self.check(name, status).and_then(|()| self.serialized(state));
        self.free_state(&mut state);
        bytes
    }

    fn serialized(&mut self, state: fmi2FMUstate) -> Result<Vec<u8>, CallError> {
        let (name, mut size) = ("fmi2SerializedFMUstateSize", 0);
        let function = function!(self.serialized_state_size, name);
        // SAFETY: the instance is alive, the state is its own.
        let status = unsafe { function(self.pointer, state, &raw mut size) };
        self.check(name, status)?;
        let name = "fmi2SerializeFMUstate";
        let function = function!(self.serialize_state, name);
        let mut bytes = vec![0_u8; size];
        // SAFETY: the instance is alive, the state is its own; `size` bytes to write to.
        let status =
            unsafe { function(self.pointer, state, bytes.as_mut_ptr().cast(), bytes.len()) };
        self.check(name, status)?;
        Ok(bytes)
    }

    /// `fmi2DeSerializeFMUstate`, and on to that state.
    pub(crate) fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let (name, mut state) = ("fmi2DeSerializeFMUstate", null_mut());
        let function = function!(self.deserialize_state, name);
        // SAFETY: the instance is alive; `bytes.len()` bytes to read, one state to write to.
        let status =
            unsafe { function(self.pointer, bytes.as_ptr().cast(), bytes.len(), &raw mut state) };
        let done = self.check(name, status).and_then(|()| self.set_state(state));
        self.free_state(&mut state);
        done
    }
}
