//! Get and set: one method for each type. There are as many values as the elements of all variables together.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::{function, strings, values};
use super::super::{c_string, canary, copy_strings};
use super::Component;
use slave::{CallError, absent};

/// Returns the number of references. Variables may be arrays: there may be more values.
#[inline]
fn number<T>(references: &[u32], _values: &[T]) -> usize {
    references.len()
}

values! {
    pub(crate) fn get_float32, set_float32: f32 = "fmi3GetFloat32" "fmi3SetFloat32", number length;
    pub(crate) fn get_float64, set_float64: f64 = "fmi3GetFloat64" "fmi3SetFloat64", number length;
    pub(crate) fn get_int8, set_int8: i8 = "fmi3GetInt8" "fmi3SetInt8", number length;
    pub(crate) fn get_uint8, set_uint8: u8 = "fmi3GetUInt8" "fmi3SetUInt8", number length;
    pub(crate) fn get_int16, set_int16: i16 = "fmi3GetInt16" "fmi3SetInt16", number length;
    pub(crate) fn get_uint16, set_uint16: u16 = "fmi3GetUInt16" "fmi3SetUInt16", number length;
    pub(crate) fn get_int32, set_int32: i32 = "fmi3GetInt32" "fmi3SetInt32", number length;
    pub(crate) fn get_uint32, set_uint32: u32 = "fmi3GetUInt32" "fmi3SetUInt32", number length;
    pub(crate) fn get_int64, set_int64: i64 = "fmi3GetInt64" "fmi3SetInt64", number length;
    pub(crate) fn get_uint64, set_uint64: u64 = "fmi3GetUInt64" "fmi3SetUInt64", number length;
    pub(crate) fn get_boolean, set_boolean: u8 = "fmi3GetBoolean" "fmi3SetBoolean", number length;
}

strings! {
    pub(crate) fn get_string, set_string = "fmi3GetString" "fmi3SetString", number length;
}

impl Component {
    /// Calls `fmi3SetBinary`.
    pub(crate) fn set_binary(
        &mut self,
        references: &[u32],
        values: &[Vec<u8>],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetBinary";
        let function = function!(self.set_binary, NAME);
        self.base.log_call(NAME, || format!("{references:?}, {values:?}"));
        let sizes: Vec<_> = values.iter().map(Vec::len).collect();
        let contents: Vec<_> = values.iter().map(Vec::as_slice).collect();
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let (count, length) = (references.len(), contents.len());
        let done = canary::constants(guards, canary::BYTES, &contents, |array| {
            // SAFETY: the instance is alive; as many sizes as pointers, each to as many bytes.
            let call =
                |list, sizes| unsafe { function(pointer, list, count, sizes, array, length) };
            canary::write(guards, references, &sizes, call)
        });
        self.base.check_guarded(NAME, done, String::new)
    }

    /// Calls `fmi3GetBinary` and copies the bytes.
    pub(crate) fn get_binary(
        &mut self,
        references: &[u32],
        values: &mut [Vec<u8>],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetBinary";
        let function = function!(self.get_binary, NAME);
        self.base.log_call(NAME, || format!("{references:?}"));
        let mut sizes = vec![0_usize; values.len()];
        let mut pointers = vec![std::ptr::null::<u8>(); values.len()];
        let (count, length) = (references.len(), pointers.len());
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let done = canary::filled(guards, canary::SIZES, &mut sizes, |sizes| {
            // SAFETY: the instance is alive; as many places for sizes as for pointers.
            let call =
                |list, array| unsafe { function(pointer, list, count, sizes, array, length) };
            canary::read(guards, references, &mut pointers, call)
        });
        self.base.check_guarded(NAME, done, String::new)?;
        self.base.place.enter(&NAME);
        for (value, (pointer, size)) in values.iter_mut().zip(pointers.into_iter().zip(sizes)) {
            value.clear();
            if let Err(failure) = canary::check_size(size, "binary value") {
                self.base.place.leave();
                return Err(self.base.failed(NAME, failure));
            }
            if size > 0 && !pointer.is_null() {
                // SAFETY: the FMU returns `size` bytes at `pointer`, which live until the next call.
                value.extend_from_slice(unsafe { std::slice::from_raw_parts(pointer, size) });
            }
        }
        self.base.place.leave();
        Ok(())
    }
}
