//! The types of FMI 3.0 that FMI 2.0 does not have.

use std::ops::RangeInclusive;

use crate::interface::Slot;
use crate::interface::fmi3::Type;
use crate::variable::{Field, Number, Variable};
use fmu_description::{BinaryType, ClockType, IntegerType, IntervalVariability, Kind, RealType};

/// The Rust type of the field of such a variable.
pub(crate) trait Native: Clone + Sized + 'static {
    /// The type of FMI 3.0.
    const TYPE: Type;

    /// Returns the variables of this type.
    fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>];

    /// Makes the description of a variable of this type.
    ///
    /// # Errors
    ///
    /// Returns a message for a limit that is no value of the type.
    fn kind(start: Option<Self>, number: Number) -> Result<Kind, String>;

    /// Returns the value of a number.
    fn number(&self) -> Option<f64> {
        None
    }
}

/// Defines the lists of fields and slots, one for each type.
macro_rules! types {
    ($($variant:ident($native:ty) $list:ident;)*) => {
        /// The field of a variable, by type.
        pub(crate) enum TypedField<M> {
            $($variant(Field<M, $native>),)*
        }

        /// The variables of a model, by type.
        pub(crate) struct Slots<M> {
            $($list: Vec<Slot<M, $native>>,)*
        }

        impl<M> Default for Slots<M> {
            fn default() -> Self {
                Self { $($list: Vec::new(),)* }
            }
        }

        impl<M> Slots<M> {
            /// Appends a variable: `build` makes its slot in a list and returns the position. Returns its
            /// description and the position.
            ///
            /// # Errors
            ///
            /// Same as [`Native::kind`].
            pub(crate) fn add(
                &mut self,
                model: &mut M,
                (field, number): (TypedField<M>, Number),
                start_given: bool,
                builder: crate::interface::SlotBuilder<M>,
            ) -> Result<(Kind, u32), String> {
                Ok(match field {
                    $(TypedField::$variant(field) => {
                        let start = start_given.then(|| field(model).clone());
                        let kind = <$native>::kind(start, number)?;
                        (kind, builder.build_3(&mut self.$list, field))
                    })*
                })
            }
        }
    };
}

types! {
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

/// A clock: true where it ticks.
impl Native for bool {
    const TYPE: Type = Type::Clock;

    fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>] {
        &all.clock
    }

    fn kind(_: Option<Self>, number: Number) -> Result<Kind, String> {
        if let Some(variability) = number.interval_variability {
            use IntervalVariability::{Constant, Triggered};
            if matches!(variability, Constant | Triggered) {
                return Err(
                    "the interval of a timed clock is fixed, tunable, changing or a countdown"
                        .to_owned(),
                );
            }
            let interval_variability = variability;
            return Ok(Kind::Clock(ClockType { interval_variability, ..ClockType::default() }));
        }
        let Some(interval) = number.interval else { return Ok(Kind::Clock(ClockType::default())) };
        if !(interval > 0.0 && interval.is_finite()) {
            return Err(format!("interval {interval} s, expected more than 0"));
        }
        Ok(Kind::Clock(ClockType {
            interval_variability: IntervalVariability::Constant,
            interval_decimal: Some(interval),
            ..ClockType::default()
        }))
    }
}

impl Native for f32 {
    const TYPE: Type = Type::Float32;

    fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>] {
        &all.float32
    }

    fn kind(start: Option<Self>, number: Number) -> Result<Kind, String> {
        let start = start.map(f64::from);
        Ok(Kind::Float32(RealType { start, ..crate::interface::real(number) }))
    }

    fn number(&self) -> Option<f64> {
        Some(f64::from(*self))
    }
}

impl Native for Vec<u8> {
    const TYPE: Type = Type::Binary;

    fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>] {
        &all.binary
    }

    fn kind(start: Option<Self>, number: Number) -> Result<Kind, String> {
        let mime_type = number.mime_type;
        Ok(Kind::Binary(BinaryType { start, mime_type, ..BinaryType::default() }))
    }
}

/// Implements [`Native`] for integers.
macro_rules! integers {
    ($($native:ty, $variant:ident, $list:ident;)*) => {
        $(impl Native for $native {
            const TYPE: Type = Type::$variant;

            fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>] {
                &all.$list
            }

            fn kind(start: Option<Self>, number: Number) -> Result<Kind, String> {
                let within = i128::from(<$native>::MIN)..=i128::from(<$native>::MAX);
                let limits = integer(number, &within)?;
                Ok(Kind::$variant(IntegerType { start: start.map(i128::from), ..limits }))
            }

            #[allow(clippy::cast_precision_loss, clippy::cast_lossless, reason = "limits are f64")]
            fn number(&self) -> Option<f64> {
                Some(*self as f64)
            }
        })*
    };
}

integers! {
    i8, Int8, int8;
    u8, UInt8, uint8;
    i16, Int16, int16;
    u16, UInt16, uint16;
    u32, UInt32, uint32;
    i64, Int64, int64;
    u64, UInt64, uint64;
}

/// Returns the attributes of an integer whose values are in the range `within`.
fn integer(number: Number, within: &RangeInclusive<i128>) -> Result<IntegerType, String> {
    let bound = |value: Option<f64>| match value {
        None => Ok(None),
        Some(value) => {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "the cast saturates; compared then"
            )]
            let whole = value as i128;
            if value.fract() == 0.0 && within.contains(&whole) {
                return Ok(Some(whole));
            }
            let (low, high) = (within.start(), within.end());
            Err(format!("limit {value}, expected an integer from {low} to {high}"))
        }
    };
    let (min, max) = (bound(number.min)?, bound(number.max)?);
    Ok(IntegerType { quantity: number.quantity, min, max, ..IntegerType::default() })
}

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
