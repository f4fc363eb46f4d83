//! Variables of the types of FMI 3.0 that FMI 2.0 does not have.

use super::Field;

/// Calls a macro with the types that FMI 2.0 does not have: variant, type of the field, name of the list.
macro_rules! for_types {
    ($macro:ident) => {
        $macro! {
            Float32(f32) float32;
            Int8(i8) int8;
            UInt8(u8) uint8;
            Int16(i16) int16;
            UInt16(u16) uint16;
            UInt32(u32) uint32;
            Int64(i64) int64;
            UInt64(u64) uint64;
            Binary(Vec<u8>) binary;
            Clock(bool) clock;
        }
    };
}
pub(crate) use for_types;

/// Defines the field of a variable, one variant for each type.
macro_rules! fields {
    ($($variant:ident($native:ty) $list:ident;)*) => {
        /// The field of a variable, by type.
        pub(crate) enum TypedField<M> {
            $($variant(Field<M, $native>),)*
        }
    };
}

for_types!(fields);
