//! The values of one C call, in the type of the FMU.

use fmu_description::NativeType;

use crate::library::v3::Component;
use slave::CallError;

/// A number of the C interface.
trait Number: Copy + Default + PartialEq {
    /// NaN for an integer beyond 64 bits with a sign.
    fn to_real(self) -> f64;
    /// `None` if the type is no floating-point type or the number is beyond its range.
    fn from_real(value: f64) -> Option<Self>;
    /// `None` for a floating-point type and beyond 64 bits with a sign.
    fn to_integer(self) -> Option<i64>;
    /// `None` beyond the range of the type.
    fn from_integer(value: i64) -> Option<Self>;
    /// Returns bits that are equal for equal values only.
    fn bits(self) -> u64;
    /// Returns the number with these [`Number::bits`].
    fn from_bits(bits: u64) -> Self;
}

macro_rules! integers {
    ($($type:ty)*) => {
        $(impl Number for $type {
            fn to_real(self) -> f64 {
                self.to_integer().map_or(f64::NAN, slave::to_real)
            }

            fn from_real(_: f64) -> Option<Self> {
                None
            }

            fn to_integer(self) -> Option<i64> {
                self.try_into().ok()
            }

            fn from_integer(value: i64) -> Option<Self> {
                value.try_into().ok()
            }

            #[expect(clippy::allow_attributes, reason = "depends on the type")]
            #[allow(clippy::cast_lossless, clippy::cast_sign_loss, reason = "only compared")]
            fn bits(self) -> u64 {
                self as u64
            }

            #[expect(clippy::allow_attributes, reason = "depends on the type")]
            #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "of bits")]
            fn from_bits(bits: u64) -> Self {
                bits as Self
            }
        })*
    };
}

integers! { i8 u8 i16 u16 i32 u32 i64 u64 }

impl Number for f64 {
    fn to_real(self) -> f64 {
        self
    }

    fn from_real(value: f64) -> Option<Self> {
        Some(value)
    }

    fn to_integer(self) -> Option<i64> {
        None
    }

    fn from_integer(value: i64) -> Option<Self> {
        Some(slave::to_real(value))
    }

    fn bits(self) -> u64 {
        self.to_bits()
    }

    fn from_bits(bits: u64) -> Self {
        f64::from_bits(bits)
    }
}

impl Number for f32 {
    fn to_real(self) -> f64 {
        self.into()
    }

    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32; checked for overflow")]
    fn from_real(value: f64) -> Option<Self> {
        let rounded = value as f32;
        (rounded.is_finite() || !value.is_finite()).then_some(rounded)
    }

    fn to_integer(self) -> Option<i64> {
        None
    }

    fn from_integer(value: i64) -> Option<Self> {
        Self::from_real(slave::to_real(value))
    }

    fn bits(self) -> u64 {
        self.to_bits().into()
    }

    #[expect(clippy::cast_possible_truncation, reason = "the bits of an f32")]
    fn from_bits(bits: u64) -> Self {
        f32::from_bits(bits as u32)
    }
}

/// Defines the buffer: for each variant its type and its functions.
macro_rules! buffer {
    ($($variant:ident: $type:ty, $get:ident, $set:ident;)*) => {
        /// Values of one type.
        #[derive(Debug)]
        pub(super) enum Buffer {
            $($variant(Vec<$type>),)*
            /// `String` and `Binary`, which are no numbers.
            Other,
        }

        impl Buffer {
            /// Creates a buffer for `count` values.
            pub(super) fn new(kind: NativeType, count: usize) -> Self {
                match kind {
                    $(NativeType::$variant => Buffer::$variant(vec![<$type>::default(); count]),)*
                    NativeType::Clock => Buffer::Boolean(vec![0; count]),
                    NativeType::String | NativeType::Binary => Buffer::Other,
                }
            }

            /// Reads all values from the FMU; none if they are no numbers.
            pub(super) fn get(
                &mut self,
                component: &mut Component,
                references: &[u32],
            ) -> Result<(), CallError> {
                match self {
                    $(Buffer::$variant(values) => component.$get(references, values),)*
                    Buffer::Other => Ok(()),
                }
            }

            /// Passes all values to the FMU; none if they are no numbers.
            pub(super) fn set(
                &self,
                component: &mut Component,
                references: &[u32],
            ) -> Result<(), CallError> {
                match self {
                    $(Buffer::$variant(values) => component.$set(references, values),)*
                    Buffer::Other => Ok(()),
                }
            }

            /// Returns value number `position` as a Real; `None` if the values are no numbers.
            pub(super) fn real(&self, position: usize) -> Option<f64> {
                match self {
                    $(Buffer::$variant(values) => Some(values[position].to_real()),)*
                    Buffer::Other => None,
                }
            }

            /// Stores a Real; `None` if the type cannot represent it.
            pub(super) fn put_real(&mut self, position: usize, value: f64) -> Option<()> {
                match self {
                    $(Buffer::$variant(values) => values[position] = <$type>::from_real(value)?,)*
                    Buffer::Other => return None,
                }
                Some(())
            }

            /// Returns value number `position` as an Integer; `None` if it is no integer, or beyond 64 bits with a
            /// sign.
            pub(super) fn integer(&self, position: usize) -> Option<i64> {
                match self {
                    $(Buffer::$variant(values) => values[position].to_integer(),)*
                    Buffer::Other => None,
                }
            }

            /// Stores an Integer; `None` if the type cannot represent it.
            pub(super) fn put_integer(&mut self, position: usize, value: i64) -> Option<()> {
                match self {
                    $(Buffer::$variant(values) => values[position] = <$type>::from_integer(value)?,)*
                    Buffer::Other => return None,
                }
                Some(())
            }

            /// Returns bits of value number `position` that are equal for equal values only; 0 if it is no number.
            pub(super) fn bits(&self, position: usize) -> u64 {
                match self {
                    $(Buffer::$variant(values) => values[position].bits(),)*
                    Buffer::Other => 0,
                }
            }

            /// Stores the value with these [`Buffer::bits`].
            pub(super) fn put_bits(&mut self, position: usize, bits: u64) {
                match self {
                    $(Buffer::$variant(values) => {
                        values[position] = <$type as Number>::from_bits(bits);
                    })*
                    Buffer::Other => {}
                }
            }
        }
    };
}

impl Buffer {
    /// Returns value number `position` as a Boolean, 0 or 1; `None` if it is no integer.
    pub(super) fn boolean(&self, position: usize) -> Option<i32> {
        Some(i32::from(self.integer(position)? != 0))
    }

    /// Stores a Boolean; `None` if the values are no numbers.
    pub(super) fn put_boolean(&mut self, position: usize, value: i32) -> Option<()> {
        self.put_integer(position, i64::from(value != 0))
    }
}

buffer! {
    Float32: f32, get_float32, set_float32;
    Float64: f64, get_float64, set_float64;
    Int8: i8, get_int8, set_int8;
    UInt8: u8, get_uint8, set_uint8;
    Int16: i16, get_int16, set_int16;
    UInt16: u16, get_uint16, set_uint16;
    Int32: i32, get_int32, set_int32;
    UInt32: u32, get_uint32, set_uint32;
    Int64: i64, get_int64, set_int64;
    UInt64: u64, get_uint64, set_uint64;
    Boolean: u8, get_boolean, set_boolean;
}
