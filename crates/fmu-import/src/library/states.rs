//! FMU states: saved in numbered slots, or serialized to bytes.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::c_void;
use std::ptr::null_mut;

use super::calls::function;
use super::{Component, canary};
use slave::{CallError, Failure, absent};

/// Defines the methods for FMU states, for FMI 2.0 and 3.0.
macro_rules! states {
    (
        fn save_state = $get:literal;
        restore_state = $set:literal;
        serialize_state = $size:literal $serialize:literal;
        deserialize_state = $deserialize:literal;
        free_state = $free:literal;
    ) => {
        impl Component {
            #[doc = concat!("Saves the current state in `slot` (`", $get, "`).")]
            pub(crate) fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
                let function = function!(self.get_state, $get);
                self.base.log_call($get, String::new);
                let saved = &mut self.base.saved;
                if saved.len() <= slot {
                    saved.resize(slot + 1, null_mut());
                }
                // SAFETY: the instance is alive; the state is null or belongs to it.
                let status = unsafe { function(self.base.pointer, &raw mut saved[slot]) };
                self.base.check($get, status)
            }

            #[doc = concat!("Restores the state in `slot` (`", $set, "`); an error if the slot is empty.")]
            pub(crate) fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
                let state = self.base.saved.get(slot).copied().unwrap_or(null_mut());
                if state.is_null() {
                    let what = format!("cannot restore the state of slot {slot}: the slot is empty");
                    return Err(self.base.failed($set, Failure::InvalidAnswer(what)));
                }
                self.set_state(state)
            }

            fn set_state(&mut self, state: *mut c_void) -> Result<(), CallError> {
                let function = function!(self.set_state, $set);
                self.base.log_call($set, String::new);
                // SAFETY: the instance is alive; the state belongs to it.
                let status = unsafe { function(self.base.pointer, state) };
                self.base.check($set, status)
            }

            /// Frees a state of the instance.
            fn free_state(&mut self, state: &mut *mut c_void) {
                if let (Some(function), false) = (self.base.functions.free_state, state.is_null()) {
                    self.base.place.enter(&$free);
                    // SAFETY: the instance is alive; the state belongs to it.
                    unsafe { function(self.base.pointer, &raw mut *state) };
                    self.base.place.leave();
                    *state = null_mut();
                }
            }

            /// Frees all saved states.
            pub(crate) fn free_states(&mut self) {
                for mut state in std::mem::take(&mut self.base.saved) {
                    self.free_state(&mut state);
                }
            }

            #[doc = concat!("Serializes the current state (`", $get, "`, `", $serialize, "`).")]
            pub(crate) fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
                let function = function!(self.get_state, $get);
                self.base.log_call($get, String::new);
                let mut state = null_mut();
                // SAFETY: the instance is alive; one state to write to.
                let status = unsafe { function(self.base.pointer, &raw mut state) };
                let bytes = self.base.check($get, status).and_then(|()| self.serialized(state));
                self.free_state(&mut state);
                bytes
            }

            /// Serializes `state`; an error if the FMU states too large a size.
            fn serialized(&mut self, state: *mut c_void) -> Result<Vec<u8>, CallError> {
                let mut size = 0;
                let function = function!(self.serialized_state_size, $size);
                self.base.log_call($size, String::new);
                // SAFETY: the instance is alive; the state belongs to it.
                let status = unsafe { function(self.base.pointer, state, &raw mut size) };
                self.base.check($size, status)?;
                let bytes = canary::bytes_of_state(size);
                let mut bytes = bytes.map_err(|failure| self.base.failed($size, failure))?;
                let function = function!(self.serialize_state, $serialize);
                self.base.log_call($serialize, String::new);
                let (pointer, guards) = (self.base.pointer, self.base.guards);
                let done = canary::filled(guards, canary::BYTES, &mut bytes, |array| {
                    // SAFETY: the instance is alive, the state is its own; `size` bytes to write to.
                    (unsafe { function(pointer, state, array.cast(), size) }, None)
                });
                self.base.check_guarded($serialize, done, String::new)?;
                Ok(bytes)
            }

            #[doc = concat!("Restores a serialized state (`", $deserialize, "`, `", $set, "`).")]
            pub(crate) fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
                let mut state = null_mut();
                let function = function!(self.deserialize_state, $deserialize);
                self.base.log_call($deserialize, String::new);
                let (pointer, guards) = (self.base.pointer, self.base.guards);
                let done = canary::constant(guards, canary::BYTES, bytes, |array| {
                    // SAFETY: the instance is alive; `bytes.len()` bytes to read, one state to write to.
                    (unsafe { function(pointer, array.cast(), bytes.len(), &raw mut state) }, None)
                });
                let done = self.base.check_guarded($deserialize, done, String::new);
                let done = done.and_then(|()| self.set_state(state));
                self.free_state(&mut state);
                done
            }
        }
    };
}
pub(super) use states;

states! {
    fn save_state = "fmi2GetFMUstate";
    restore_state = "fmi2SetFMUstate";
    serialize_state = "fmi2SerializedFMUstateSize" "fmi2SerializeFMUstate";
    deserialize_state = "fmi2DeSerializeFMUstate";
    free_state = "fmi2FreeFMUstate";
}
