//! FMU states: saved in numbered slots, or serialized to bytes.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::c_void;
use std::ptr::null_mut;

use super::super::calls::function;
use super::super::canary;
use super::super::states::states;
use super::Component;
use slave::{CallError, Failure, absent};

states! {
    pub(crate) fn save_state = "fmi3GetFMUState";
    restore_state = "fmi3SetFMUState";
    serialize_state = "fmi3SerializedFMUStateSize" "fmi3SerializeFMUState";
    deserialize_state = "fmi3DeserializeFMUState";
    free_state = "fmi3FreeFMUState";
}
