//! Slots of the types of FMI 3.0 that FMI 2.0 does not have.

use std::ops::RangeInclusive;

use super::slot::{Slot, SlotBuilder};
use crate::variable::{Number, TypedField, for_types};
use fmu_description::{
    BinaryType, ClockType, IntegerType, IntervalVariability, Kind, NativeType, RealType,
};

/// The Rust type of the values of such a type.
pub(crate) trait Native: Clone + Sized + 'static {
    /// The type of FMI 3.0 for values of this Rust type.
    const TYPE: NativeType;

    /// Returns the variables of this type.
    fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>];

    /// Makes the description of a variable of this type. An error for a limit that is no value of the type, for an
    /// interval of a clock that is not positive, and for a timed clock with a constant or triggered interval.
    fn kind(start: Option<Self>, number: Number) -> Result<Kind, String>;

    /// Returns the value of a number; `None` for a clock and a binary.
    fn number(&self) -> Option<f64> {
        None
    }
}

/// Defines the lists of slots, one for each type.
macro_rules! slots {
    ($($variant:ident($native:ty) $list:ident;)*) => {
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
            /// Appends the slot that `builder` builds to the list of its type. Returns the description of the variable
            /// and the position of the slot. Has the errors of [`Native::kind`].
            pub(crate) fn add(
                &mut self,
                model: &mut M,
                field: TypedField<M>,
                number: Number,
                start_given: bool,
                builder: SlotBuilder<M>,
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

for_types!(slots);

/// A clock: true where it ticks.
impl Native for bool {
    const TYPE: NativeType = NativeType::Clock;

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
    const TYPE: NativeType = NativeType::Float32;

    fn slots<M>(all: &Slots<M>) -> &[Slot<M, Self>] {
        &all.float32
    }

    fn kind(start: Option<Self>, number: Number) -> Result<Kind, String> {
        let start = start.map(f64::from);
        Ok(Kind::Float32(RealType { start, ..super::real(number) }))
    }

    fn number(&self) -> Option<f64> {
        Some(f64::from(*self))
    }
}

impl Native for Vec<u8> {
    const TYPE: NativeType = NativeType::Binary;

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
            const TYPE: NativeType = NativeType::$variant;

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

/// Returns the attributes of an integer whose values are in the range `within`; a message for a limit outside this
/// range or with a fraction.
pub(super) fn integer(
    number: Number,
    within: &RangeInclusive<i128>,
) -> Result<IntegerType, String> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_integer_of_32_bits_may_be_a_limit_and_no_other_number() {
        let limit = |min| {
            let number = Number { min: Some(min), ..Number::default() };
            integer(number, &(i32::MIN.into()..=i32::MAX.into())).ok()?.min
        };
        assert_eq!(limit(-2_147_483_648.0), Some(-2_147_483_648));
        assert_eq!(limit(2_147_483_647.0), Some(2_147_483_647));
        for wrong in [-2_147_483_649.0, 2_147_483_648.0, 0.5, f64::NAN, f64::INFINITY] {
            assert_eq!(limit(wrong), None, "{wrong}");
        }
    }
}
