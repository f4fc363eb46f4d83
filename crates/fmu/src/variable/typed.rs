//! Variables of the types of FMI 3.0 that FMI 2.0 does not have.

use super::{Field, Variable};

/// Calls a macro with these types: variant, type of the field, name of the list.
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

/// Defines the constructors of the variables.
macro_rules! constructors {
    ($($(#[$documentation:meta])* $constructor:ident($variant:ident, $native:ty, $variability:ident);)*) => {
        /// Variables of the types that FMI 2.0 does not have. A model with one of them leaves as FMI 3.0
        /// only: `aso-ftc pack --fmi 3`.
        impl<M> Variable<M> {
            $($(#[$documentation])*
            pub fn $constructor<F>(
                name: impl Into<String>,
                description: impl Into<String>,
                field: F,
            ) -> Self
            where
                F: for<'a> Fn(&'a mut M) -> &'a mut $native + Send + Sync + 'static,
            {
                let field = TypedField::$variant(Box::new(field));
                Self::typed(name, description, fmu_description::Variability::$variability, field)
            })*
        }
    };
}

constructors! {
    /// Creates a `Float32` variable (FMI 3.0 only).
    float32(Float32, f32, Continuous);
    /// Creates an `Int8` variable (FMI 3.0 only).
    int8(Int8, i8, Discrete);
    /// Creates a `UInt8` variable (FMI 3.0 only).
    uint8(UInt8, u8, Discrete);
    /// Creates an `Int16` variable (FMI 3.0 only).
    int16(Int16, i16, Discrete);
    /// Creates a `UInt16` variable (FMI 3.0 only).
    uint16(UInt16, u16, Discrete);
    /// Creates a `UInt32` variable (FMI 3.0 only).
    uint32(UInt32, u32, Discrete);
    /// Creates an `Int64` variable (FMI 3.0 only).
    int64(Int64, i64, Discrete);
    /// Creates a `UInt64` variable (FMI 3.0 only).
    uint64(UInt64, u64, Discrete);
    /// Creates a `Binary` variable, which may be empty (FMI 3.0 only).
    binary(Binary, Vec<u8>, Discrete);
}
