//! `fmi3GetXXX` and `fmi3SetXXX`.
//!
//! The number of values is compared with the sizes of the variables before any value is touched (section
//! 2.2.7.1). While a clock ticks, the functions return the values after the event.

use super::super::{borrow_output, read, texts};
use super::entry_points_3;
use crate::model::Failure;
use fmu_description::NativeType;
use fmu_description::abi3::{
    fmi3Binary, fmi3Boolean, fmi3Float32, fmi3Float64, fmi3Int8, fmi3Int16, fmi3Int32, fmi3Int64,
    fmi3String, fmi3UInt8, fmi3UInt16, fmi3UInt32, fmi3UInt64, fmi3ValueReference,
};

/// Defines the functions for a type whose values are copied.
macro_rules! values {
    ($($type:ident, $c:ty: $get:ident = $getter:ident => $read:ident,
        $set:ident = $setter:ident => $write:ident;)*) => {
        entry_points_3! {
            $($get = $getter(
                vr: *const fmi3ValueReference, n: usize, values: *mut $c, n_values: usize
            ), instance => instance.read_located(NativeType::$type, read(vr, n)?, n_values, |instance, places| {
                instance.$read(places, borrow_output(values, n_values)?)
            });
            $set = $setter(
                vr: *const fmi3ValueReference, n: usize, values: *const $c, n_values: usize
            ), instance => instance.set_located(NativeType::$type, read(vr, n)?, n_values, |instance, places| {
                instance.$write(places, read(values, n_values)?)
            });)*
        }
    };
}

values! {
    Float64, fmi3Float64: get_float64 = GetFloat64 => get_float64,
        set_float64 = SetFloat64 => set_float64;
    Float32, fmi3Float32: get_float32 = GetFloat32 => get_typed,
        set_float32 = SetFloat32 => set_typed;
    Int8, fmi3Int8: get_int8 = GetInt8 => get_typed, set_int8 = SetInt8 => set_typed;
    UInt8, fmi3UInt8: get_uint8 = GetUInt8 => get_typed, set_uint8 = SetUInt8 => set_typed;
    Int16, fmi3Int16: get_int16 = GetInt16 => get_typed, set_int16 = SetInt16 => set_typed;
    UInt16, fmi3UInt16: get_uint16 = GetUInt16 => get_typed, set_uint16 = SetUInt16 => set_typed;
    Int32, fmi3Int32: get_int32 = GetInt32 => get_integer, set_int32 = SetInt32 => set_integer;
    UInt32, fmi3UInt32: get_uint32 = GetUInt32 => get_typed, set_uint32 = SetUInt32 => set_typed;
    UInt64, fmi3UInt64: get_uint64 = GetUInt64 => get_typed, set_uint64 = SetUInt64 => set_typed;
    Int64, fmi3Int64: get_int64 = GetInt64 => get_int64,
        set_int64 = SetInt64 => set_int64;
    Boolean, fmi3Boolean: get_boolean = GetBoolean => get_boolean_3,
        set_boolean = SetBoolean => set_boolean_3;
}

entry_points_3! {
    get_string = GetString(
        vr: *const fmi3ValueReference, n: usize, values: *mut fmi3String, n_values: usize
    ), instance => instance.read_located(NativeType::String, read(vr, n)?, n_values, |instance, places| {
        instance.get_string(places, borrow_output(values, n_values)?)
    });
    set_string = SetString(
        vr: *const fmi3ValueReference, n: usize, values: *const fmi3String, n_values: usize
    ), instance => instance.set_located(NativeType::String, read(vr, n)?, n_values, |instance, places| {
        instance.set_string(places, &texts(values, n_values)?)
    });
    get_binary = GetBinary(
        vr: *const fmi3ValueReference, n: usize, sizes: *mut usize, values: *mut fmi3Binary,
        n_values: usize
    ), instance => instance.read_located(NativeType::Binary, read(vr, n)?, n_values, |instance, places| {
        let (sizes, values) = (borrow_output(sizes, n_values)?, borrow_output(values, n_values)?);
        instance.get_binary(places, |position, value| {
            sizes[position].write(value.len());
            values[position].write(value.as_ptr());
        })
    });
    set_binary = SetBinary(
        vr: *const fmi3ValueReference, n: usize, sizes: *const usize, values: *const fmi3Binary,
        n_values: usize
    ), instance => instance.set_located(NativeType::Binary, read(vr, n)?, n_values, |instance, places| {
        let arrays = read(sizes, n_values)?.iter().zip(read(values, n_values)?);
        let values = arrays.map(|(&size, &bytes)| Ok(read(bytes, size)?.to_vec()));
        instance.set_typed(places, &values.collect::<Result<Vec<Vec<u8>>, Failure>>()?)
    });
}
