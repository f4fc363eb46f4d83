//! The importer's memory for output values, which the importer need not have initialised.
#![expect(unsafe_code, reason = "memory of C")]

use std::mem::MaybeUninit;

/// Memory for output values.
pub(crate) type Room<T> = [MaybeUninit<T>];

/// Fills the memory with `value` and returns it as initialised.
pub(crate) fn filled<T: Copy>(room: &mut Room<T>, value: T) -> &mut [T] {
    for place in &mut *room {
        place.write(value);
    }
    // SAFETY: every element was written.
    unsafe { &mut *(std::ptr::from_mut(room) as *mut [T]) }
}

/// Views initialised values as memory for output values, to which the caller must only write values.
pub(crate) fn room_of<T: Copy>(values: &mut [T]) -> &mut Room<T> {
    // SAFETY: the functions of the instance that take this only write values.
    unsafe { &mut *(std::ptr::from_mut(values) as *mut Room<T>) }
}
