//! The types of variables with the attributes that depend on them.

use std::ops::RangeInclusive;

use serde::Serialize;

use super::words::spelt;
use super::{NativeType, Version};
use crate::hash_form::{is_default, numbered};

/// `SimpleType` of `TypeDefinitions`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimpleType {
    /// `name`, unique, also different from the names of all variables.
    pub name: String,
    /// `description`.
    pub description: Option<String>,
    /// The type itself; `start`, `derivative` and `declared_type` stay empty. The element of FMI 3.0 ends in `Type`.
    pub kind: Kind,
    /// Items of an enumeration: name and value.
    pub items: Vec<(String, i64)>,
}

/// Declares the types: attributes, name of the element in FMI 2.0 (if it has the type) and in FMI 3.0, type in C.
macro_rules! kinds {
    ($($(#[$doc:meta])* $variant:ident($attributes:ty): $element:literal $element_of_3:literal $native:ident;)*) => {
        /// The type of a variable with the attributes that depend on it.
        ///
        /// The types of FMI 1.0 and 2.0 are types of FMI 3.0 too: `Real` is `Float64` there and `Integer` is
        /// `Int32`. An `Enumeration` is an `Int32` in FMI 2.0 and an `Int64` in FMI 3.0.
        #[derive(Clone, Debug, PartialEq, Serialize)]
        pub enum Kind {
            $(#[doc = concat!("`", $element, "`.")] $(#[$doc])* $variant($attributes),)*
        }

        impl Kind {
            /// Returns the name of the XML element in FMI 2.0 (`Real`) or, for a type that FMI 2.0 lacks, in FMI 3.0.
            #[must_use]
            pub fn element(&self) -> &'static str {
                match self { $(Kind::$variant(_) => $element,)* }
            }

            /// Returns the type of the values in the C interface of FMI 3.0: `Int64` for an `Enumeration`.
            #[must_use]
            pub fn native_type(&self) -> NativeType {
                match self { $(Kind::$variant(_) => NativeType::$native,)* }
            }

            /// Returns the type of the element `name` of FMI 3.0, without attributes; `None` if `name` is no type.
            pub(super) fn blank(name: &str) -> Option<Self> {
                match name {
                    $($element_of_3 => Some(Kind::$variant(<$attributes>::default())),)*
                    _ => None,
                }
            }
        }
    };
}

kinds! {
    /// In FMI 3.0 `Float64`.
    Real(RealType): "Real" "Float64" Float64;
    /// In FMI 3.0 `Int32`.
    Integer(IntegerType): "Integer" "Int32" Int32;
    /// Holds `start`.
    Boolean(Option<bool>): "Boolean" "Boolean" Boolean;
    /// Holds `start`.
    String(Option<String>): "String" "String" String;
    /// Integer values; the type `declared_type` names the items.
    Enumeration(IntegerType): "Enumeration" "Enumeration" Int64;
    /// Each number is an `f32`.
    Float32(RealType): "Float32" "Float32" Float32;
    Int8(IntegerType): "Int8" "Int8" Int8;
    UInt8(IntegerType): "UInt8" "UInt8" UInt8;
    Int16(IntegerType): "Int16" "Int16" Int16;
    UInt16(IntegerType): "UInt16" "UInt16" UInt16;
    UInt32(IntegerType): "UInt32" "UInt32" UInt32;
    Int64(IntegerType): "Int64" "Int64" Int64;
    UInt64(IntegerType): "UInt64" "UInt64" UInt64;
    Binary(BinaryType): "Binary" "Binary" Binary;
    Clock(ClockType): "Clock" "Clock" Clock;
}

/// The pattern of the types whose values are integers.
macro_rules! integers {
    ($attributes:ident) => {
        Kind::Integer($attributes)
            | Kind::Enumeration($attributes)
            | Kind::Int8($attributes)
            | Kind::UInt8($attributes)
            | Kind::Int16($attributes)
            | Kind::UInt16($attributes)
            | Kind::UInt32($attributes)
            | Kind::Int64($attributes)
            | Kind::UInt64($attributes)
    };
}

impl Kind {
    /// Returns the name of the XML element in a version of FMI: `Float64` and `Int32` in FMI 3.0.
    #[must_use]
    pub fn element_in(&self, version: Version) -> &'static str {
        match (self, version) {
            (Kind::Real(_), Version::V3) => "Float64",
            (Kind::Integer(_), Version::V3) => "Int32",
            _ => self.element(),
        }
    }

    /// Returns the base type of FMI 1.0 and 2.0, within which value references are unique: `Integer` for an
    /// `Enumeration`, otherwise [`Kind::element`].
    #[must_use]
    pub fn base(&self) -> &'static str {
        match self {
            Kind::Enumeration(_) => "Integer",
            other => other.element(),
        }
    }

    /// Returns the attributes of a floating-point type, `Float64` or `Float32`; `None` for other types.
    #[must_use]
    pub fn as_real(&self) -> Option<&RealType> {
        match self {
            Kind::Real(real) | Kind::Float32(real) => Some(real),
            _ => None,
        }
    }

    /// Returns the attributes of an integer type of any width, or of an `Enumeration`; `None` for other types.
    #[must_use]
    pub fn as_integer(&self) -> Option<&IntegerType> {
        match self {
            integers!(integer) => Some(integer),
            _ => None,
        }
    }

    /// Returns the attributes of [`Kind::as_real`] to change them.
    pub fn as_real_mut(&mut self) -> Option<&mut RealType> {
        match self {
            Kind::Real(real) | Kind::Float32(real) => Some(real),
            _ => None,
        }
    }

    /// Returns the attributes of [`Kind::as_integer`] to change them.
    pub fn as_integer_mut(&mut self) -> Option<&mut IntegerType> {
        match self {
            integers!(integer) => Some(integer),
            _ => None,
        }
    }

    /// Returns the range of an integer type or an enumeration in a version of FMI; `None` for other types.
    #[must_use]
    pub fn integer_range(&self, version: Version) -> Option<RangeInclusive<i128>> {
        Some(match self {
            Kind::Enumeration(_) if version == Version::V3 => i64::MIN.into()..=i64::MAX.into(),
            Kind::Integer(_) | Kind::Enumeration(_) => i32::MIN.into()..=i32::MAX.into(),
            Kind::Int8(_) => i8::MIN.into()..=i8::MAX.into(),
            Kind::UInt8(_) => 0..=u8::MAX.into(),
            Kind::Int16(_) => i16::MIN.into()..=i16::MAX.into(),
            Kind::UInt16(_) => 0..=u16::MAX.into(),
            Kind::UInt32(_) => 0..=u32::MAX.into(),
            Kind::Int64(_) => i64::MIN.into()..=i64::MAX.into(),
            Kind::UInt64(_) => 0..=u64::MAX.into(),
            _ => return None,
        })
    }

    /// Removes the start value, and `reinit` of a floating-point type.
    pub fn clear_start(&mut self) {
        match self {
            Kind::Boolean(start) => *start = None,
            Kind::String(start) => *start = None,
            Kind::Binary(binary) => binary.start = None,
            Kind::Clock(_) => {}
            Kind::Real(real) | Kind::Float32(real) => (real.start, real.reinit) = (None, false),
            integers!(integer) => integer.start = None,
        }
    }

    /// Returns the attribute `declaredType`; always `None` for a `Boolean` and a `String`, which do not store it.
    #[must_use]
    pub fn declared_type(&self) -> Option<&str> {
        match self {
            Kind::Binary(binary) => binary.declared_type.as_deref(),
            Kind::Clock(clock) => clock.declared_type.as_deref(),
            Kind::Real(real) | Kind::Float32(real) => real.declared_type.as_deref(),
            integers!(integer) => integer.declared_type.as_deref(),
            Kind::Boolean(_) | Kind::String(_) => None,
        }
    }

    /// Whether the type has a `start`, for a scalar or for all elements of an array; a list of starts does not count.
    #[must_use]
    pub fn has_start(&self) -> bool {
        match self {
            Kind::Boolean(start) => start.is_some(),
            Kind::String(start) => start.is_some(),
            Kind::Binary(binary) => binary.start.is_some(),
            Kind::Clock(_) => false,
            Kind::Real(real) | Kind::Float32(real) => real.start.is_some(),
            integers!(integer) => integer.start.is_some(),
        }
    }
}

/// Attributes of a `Real` (`Float64`) or a `Float32`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub struct RealType {
    pub declared_type: Option<String>,
    pub quantity: Option<String>,
    pub unit: Option<String>,
    pub display_unit: Option<String>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub nominal: Option<f64>,
    pub start: Option<f64>,
    /// `derivative`: 1-based index of the state of which this variable is the derivative.
    pub derivative: Option<u32>,
    /// `reinit`: an event may change this continuous state.
    pub reinit: bool,
    /// `relativeQuantity`, see [`RealType::is_relative`]; `None` means false.
    // The numbers 1 to 8 belong to `ScalarVariable`, whose fields come next in the serialised form.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<9, _, _>")]
    pub relative_quantity: Option<bool>,
}

impl RealType {
    /// Whether the values are differences, such as a rise of temperature: `relativeQuantity` is true. The conversion of a
    /// difference to another unit has no offset: 5 K are 5 degC (FMI 2.0.5, section 2.2.3; FMI 3.0.2, section 2.4.4).
    #[must_use]
    pub fn is_relative(&self) -> bool {
        self.relative_quantity == Some(true)
    }
}

/// Attributes of an integer type or an `Enumeration`. The numbers can hold every integer type of
/// FMI 3.0.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub struct IntegerType {
    pub declared_type: Option<String>,
    pub quantity: Option<String>,
    pub min: Option<i128>,
    pub max: Option<i128>,
    pub start: Option<i128>,
}

/// Attributes of a `Binary` (FMI 3.0.2, section 2.4.7.5).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BinaryType {
    /// `declaredType`.
    pub declared_type: Option<String>,
    /// `mimeType`; `None` means `application/octet-stream`.
    pub mime_type: Option<String>,
    /// `maxSize` in bytes.
    pub max_size: Option<u64>,
    /// The value of the only element `Start`.
    pub start: Option<Vec<u8>>,
}

spelt! {
    /// `intervalVariability` of a clock (FMI 3.0.2, section 2.2.8.2).
    #[derive(Default)]
    IntervalVariability {
        /// Periodic: the interval is a number of the description.
        Constant = "constant",
        /// Periodic: the interval is known after instantiation and never changes.
        Fixed = "fixed",
        /// Periodic: the interval may change in Event Mode.
        Tunable = "tunable",
        /// Aperiodic: each tick states the interval to the next.
        Changing = "changing",
        /// Aperiodic: an event states the interval to the next tick.
        Countdown = "countdown",
        /// Not based on time.
        #[default]
        Triggered = "triggered",
    }
}

/// Attributes of a `Clock` (FMI 3.0.2, section 2.4.7.5, `fmi3ClockAttributes`).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub struct ClockType {
    pub declared_type: Option<String>,
    pub can_be_deactivated: bool,
    /// `priority` for Scheduled Execution.
    pub priority: Option<u32>,
    pub interval_variability: IntervalVariability,
    /// `intervalDecimal` in s.
    pub interval_decimal: Option<f64>,
    /// `shiftDecimal` in s; `None` means 0.
    pub shift_decimal: Option<f64>,
    pub supports_fraction: bool,
    /// `resolution`: the unit of the counters is 1 s divided by this number.
    pub resolution: Option<u64>,
    pub interval_counter: Option<u64>,
    /// `shiftCounter`; `None` means 0.
    pub shift_counter: Option<u64>,
}
