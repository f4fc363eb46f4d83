//! Get and set: one method for each type. As many values as the elements of all variables together.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::CString;

use super::super::calls::function;
use super::super::{c_string, canary, copy_strings};
use super::Component;
use slave::{CallError, absent};

/// Defines the methods of the types whose values are copied.
macro_rules! values {
    ($($get:ident $set:ident: $type:ty = $get_name:literal $set_name:literal;)*) => {
        impl Component {
            $(#[doc = concat!("Calls `", $get_name, "`.")]
            #[inline]
            pub(crate) fn $get(
                &mut self,
                references: &[u32],
                values: &mut [$type],
            ) -> Result<(), CallError> {
                let function = function!(self.$get, $get_name);
                self.base.log_call($get_name, || format!("{references:?}"));
                let (count, length) = (references.len(), values.len());
                // SAFETY: the instance is alive; both pointers come with their number of values.
                let call = |list, array| unsafe { function(self.base.pointer, list, count, array, length) };
                let done = canary::read(self.base.guards, references, values, call);
                self.base.check_guarded($get_name, done, || format!(" {values:?}"))
            }

            #[doc = concat!("Calls `", $set_name, "`.")]
            #[inline]
            pub(crate) fn $set(
                &mut self,
                references: &[u32],
                values: &[$type],
            ) -> Result<(), CallError> {
                let function = function!(self.$set, $set_name);
                self.base.log_call($set_name, || format!("{references:?}, {values:?}"));
                let (count, length) = (references.len(), values.len());
                // SAFETY: the instance is alive; both pointers come with their number of values.
                let call = |list, array| unsafe { function(self.base.pointer, list, count, array, length) };
                let done = canary::write(self.base.guards, references, values, call);
                self.base.check_guarded($set_name, done, String::new)
            })*
        }
    };
}

values! {
    get_float32 set_float32: f32 = "fmi3GetFloat32" "fmi3SetFloat32";
    get_float64 set_float64: f64 = "fmi3GetFloat64" "fmi3SetFloat64";
    get_int8 set_int8: i8 = "fmi3GetInt8" "fmi3SetInt8";
    get_uint8 set_uint8: u8 = "fmi3GetUInt8" "fmi3SetUInt8";
    get_int16 set_int16: i16 = "fmi3GetInt16" "fmi3SetInt16";
    get_uint16 set_uint16: u16 = "fmi3GetUInt16" "fmi3SetUInt16";
    get_int32 set_int32: i32 = "fmi3GetInt32" "fmi3SetInt32";
    get_uint32 set_uint32: u32 = "fmi3GetUInt32" "fmi3SetUInt32";
    get_int64 set_int64: i64 = "fmi3GetInt64" "fmi3SetInt64";
    get_uint64 set_uint64: u64 = "fmi3GetUInt64" "fmi3SetUInt64";
    get_boolean set_boolean: u8 = "fmi3GetBoolean" "fmi3SetBoolean";
}

impl Component {
    /// Calls `fmi3SetString`.
    pub(crate) fn set_string(
        &mut self,
        references: &[u32],
        values: &[String],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3SetString";
        let function = function!(self.set_string, NAME);
        self.base.log_call(NAME, || format!("{references:?}, {values:?}"));
        let values: Vec<_> = values.iter().map(|value| c_string(value)).collect();
        let texts: Vec<_> = values.iter().map(CString::as_bytes_with_nul).collect();
        let (pointer, guards) = (self.base.pointer, self.base.guards);
        let (count, length) = (references.len(), texts.len());
        let done = canary::constants(guards, canary::STRING, &texts, |array| {
            canary::constant(guards, canary::REFERENCES, references, |list| {
                // SAFETY: the instance is alive; both pointers come with their number of values.
                (unsafe { function(pointer, list, count, array.cast(), length) }, None)
            })
        });
        self.base.check_guarded(NAME, done, String::new)
    }

    /// Calls `fmi3GetString` and copies the strings.
    pub(crate) fn get_string(
        &mut self,
        references: &[u32],
        values: &mut [String],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3GetString";
        let function = function!(self.get_string, NAME);
        self.base.log_call(NAME, || format!("{references:?}"));
        let mut pointers = vec![std::ptr::null(); values.len()];
        let (count, length) = (references.len(), pointers.len());
        // SAFETY: the instance is alive; both pointers come with their number of values.
        let call = |list, array| unsafe { function(self.base.pointer, list, count, array, length) };
        let done = canary::read(self.base.guards, references, &mut pointers, call);
        self.base.check_guarded(NAME, done, String::new)?;
        self.base.place.enter(&NAME);
        // SAFETY: the FMU returns null or terminated strings, which live until the next call.
        unsafe { copy_strings(&pointers, values) };
        self.base.place.leave();
        Ok(())
    }

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
