//! The serialised form of fields that FMI 2.0 does not have, and of `relativeQuantity`.
//!
//! The GUID is a hash of the serialised description. A field with its default value is absent from the form, so that
//! the GUID of a description without the field does not change. Any other value follows a number, so that two fields
//! with the same value differ in the form.

use serde::{Serialize, Serializer};

/// Whether the field has its default and is therefore absent from the form.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Serialises a field after its number, which is unique within the structure of the field.
pub(crate) fn numbered<const NUMBER: u8, T: Serialize, S: Serializer>(
    value: &T,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    (NUMBER, value).serialize(serializer)
}
