//! The values of one C call, in the type of the FMU.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use fmu_description::NativeType;
use serde::{Deserialize, Serialize};

use crate::library::v3::Component;
use slave::CallError;

/// A value that is kept after its C call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum ElementValue {
    /// The bits of a number.
    Number(u64),
    Text(String),
    Bytes(Vec<u8>),
}

/// A value of the C interface. The default methods are for types that are not numeric.
trait Element: Clone + Default {
    /// Returns NaN for an integer beyond the range of `i64`; `None` if the type is not numeric.
    fn real(&self) -> Option<f64> {
        None
    }

    /// Returns `None` if the type is no floating-point type or the number is beyond its range.
    fn from_real(_: f64) -> Option<Self> {
        None
    }

    /// Returns `None` if the type is no integer type or the value is beyond the range of `i64`.
    fn integer(&self) -> Option<i64> {
        None
    }

    /// Returns `None` if the type is not numeric or the number is beyond its range.
    fn from_integer(_: i64) -> Option<Self> {
        None
    }

    /// Returns bits that identify a number among all numbers of its type; for a String or a binary a hash.
    fn bits(&self) -> u64;

    fn to_value(&self) -> ElementValue {
        ElementValue::Number(self.bits())
    }

    /// `None` if the value has another type.
    fn from_value(value: &ElementValue) -> Option<Self>;
}

macro_rules! integers {
    ($($type:ty)*) => {
        $(impl Element for $type {
            fn real(&self) -> Option<f64> {
                Some(self.integer().map_or(f64::NAN, slave::to_real))
            }

            fn integer(&self) -> Option<i64> {
                (*self).try_into().ok()
            }

            fn from_integer(value: i64) -> Option<Self> {
                value.try_into().ok()
            }

            #[expect(clippy::allow_attributes, reason = "depends on the type")]
            #[allow(clippy::cast_lossless, clippy::cast_sign_loss, reason = "only compared")]
            fn bits(&self) -> u64 {
                *self as u64
            }

            #[expect(clippy::allow_attributes, reason = "depends on the type")]
            #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "of bits")]
            fn from_value(value: &ElementValue) -> Option<Self> {
                if let ElementValue::Number(bits) = value { Some(*bits as Self) } else { None }
            }
        })*
    };
}

integers! { i8 u8 i16 u16 i32 u32 i64 u64 }

impl Element for f64 {
    fn real(&self) -> Option<f64> {
        Some(*self)
    }

    fn from_real(value: f64) -> Option<Self> {
        Some(value)
    }

    fn from_integer(value: i64) -> Option<Self> {
        Some(slave::to_real(value))
    }

    fn bits(&self) -> u64 {
        self.to_bits()
    }

    fn from_value(value: &ElementValue) -> Option<Self> {
        if let ElementValue::Number(bits) = value { Some(f64::from_bits(*bits)) } else { None }
    }
}

impl Element for f32 {
    fn real(&self) -> Option<f64> {
        Some((*self).into())
    }

    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32; checked for overflow")]
    fn from_real(value: f64) -> Option<Self> {
        let rounded = value as f32;
        (rounded.is_finite() || !value.is_finite()).then_some(rounded)
    }

    fn from_integer(value: i64) -> Option<Self> {
        Self::from_real(slave::to_real(value))
    }

    fn bits(&self) -> u64 {
        self.to_bits().into()
    }

    #[expect(clippy::cast_possible_truncation, reason = "the bits of an f32")]
    fn from_value(value: &ElementValue) -> Option<Self> {
        if let ElementValue::Number(bits) = value {
            Some(f32::from_bits(*bits as u32))
        } else {
            None
        }
    }
}

/// Implements [`Element`] for the types that are not numeric. A row has the type, its variants in [`Buffer`] and
/// [`ElementValue`], and the methods of a buffer that get and store a value.
macro_rules! others {
    ($($type:ty: $variant:ident, $value:ident, $get:ident, $put:ident;)*) => {
        $(impl Element for $type {
            fn bits(&self) -> u64 {
                let mut hasher = DefaultHasher::new();
                self.hash(&mut hasher);
                hasher.finish()
            }

            fn to_value(&self) -> ElementValue {
                ElementValue::$value(self.clone())
            }

            fn from_value(value: &ElementValue) -> Option<Self> {
                if let ElementValue::$value(value) = value { Some(value.clone()) } else { None }
            }
        })*

        impl Buffer {
            $(/// Copies value number `position` to `value`; `None` if the values have another type.
            pub(super) fn $get(&self, position: usize, value: &mut $type) -> Option<()> {
                let Buffer::$variant(values) = self else { return None };
                value.clone_from(&values[position]);
                Some(())
            }

            /// Stores a value; `None` if the values have another type.
            pub(super) fn $put(&mut self, position: usize, value: $type) -> Option<()> {
                let Buffer::$variant(values) = self else { return None };
                values[position] = value;
                Some(())
            })*
        }
    };
}

others! {
    String: String, Text, text, put_text;
    Vec<u8>: Binary, Bytes, bytes, put_bytes;
}

/// Defines the buffer: for each variant its type and its functions.
macro_rules! buffer {
    ($($variant:ident: $type:ty, $get:ident, $set:ident;)*) => {
        /// Values of one type.
        #[derive(Debug)]
        pub(super) enum Buffer {
            $($variant(Vec<$type>),)*
        }

        impl Buffer {
            /// Creates a buffer for `count` values.
            pub(super) fn new(kind: NativeType, count: usize) -> Self {
                match kind {
                    $(NativeType::$variant => Buffer::$variant(vec![<$type>::default(); count]),)*
                    NativeType::Clock => Buffer::Boolean(vec![0; count]),
                }
            }

            /// Reads all values from the FMU.
            pub(super) fn get(
                &mut self,
                component: &mut Component,
                references: &[u32],
            ) -> Result<(), CallError> {
                match self {
                    $(Buffer::$variant(values) => component.$get(references, values),)*
                }
            }

            /// Passes all values to the FMU.
            pub(super) fn set(
                &self,
                component: &mut Component,
                references: &[u32],
            ) -> Result<(), CallError> {
                match self {
                    $(Buffer::$variant(values) => component.$set(references, values),)*
                }
            }

            /// Returns value number `position` as a Real; `None` if the values are not numeric.
            pub(super) fn real(&self, position: usize) -> Option<f64> {
                match self {
                    $(Buffer::$variant(values) => values[position].real(),)*
                }
            }

            /// Stores a Real; `None` if the type cannot represent it.
            pub(super) fn put_real(&mut self, position: usize, value: f64) -> Option<()> {
                match self {
                    $(Buffer::$variant(values) => values[position] = <$type>::from_real(value)?,)*
                }
                Some(())
            }

            /// Returns value number `position` as an Integer; `None` if it is no integer or beyond the range of
            /// `i64`.
            pub(super) fn integer(&self, position: usize) -> Option<i64> {
                match self {
                    $(Buffer::$variant(values) => values[position].integer(),)*
                }
            }

            /// Stores an Integer; `None` if the type cannot represent it.
            pub(super) fn put_integer(&mut self, position: usize, value: i64) -> Option<()> {
                match self {
                    $(Buffer::$variant(values) => values[position] = <$type>::from_integer(value)?,)*
                }
                Some(())
            }

            /// Returns the bits of value number `position`, by which a change of the value is detected; for a String or
            /// a binary a hash.
            pub(super) fn bits(&self, position: usize) -> u64 {
                match self {
                    $(Buffer::$variant(values) => values[position].bits(),)*
                }
            }

            /// Returns value number `position`, to be stored by [`Buffer::put_value`] later.
            pub(super) fn value(&self, position: usize) -> ElementValue {
                match self {
                    $(Buffer::$variant(values) => values[position].to_value(),)*
                }
            }

            /// Stores `value` and returns true. If `value` is absent or of another type, stores 0, an empty text or no
            /// bytes, and returns false.
            pub(super) fn put_value(&mut self, position: usize, value: Option<&ElementValue>) -> bool {
                match self {
                    $(Buffer::$variant(values) => {
                        let value = value.and_then(<$type as Element>::from_value);
                        let is_known = value.is_some();
                        values[position] = value.unwrap_or_default();
                        is_known
                    })*
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
    String: String, get_string, set_string;
    Binary: Vec<u8>, get_binary, set_binary;
}
