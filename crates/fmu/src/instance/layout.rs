//! The layout of a serialised value: its fields, their order and their types.
//!
//! The bytes of a serialised state contain no names. Another build of the same FMU, with its private
//! fields in another order, would read them into the wrong fields without an error. Therefore a
//! serialised state contains a hash of the layout. The reader computes the hash of the value that it
//! has read; the two differ if names, order or types of fields differ.

use std::fmt::Display;

use serde::ser::{
    self, Serialize, SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant,
    SerializeTuple, SerializeTupleStruct, SerializeTupleVariant,
};

/// A hash of a layout.
pub(super) type Layout = [u8; 8];

/// Computes the hash of the layout of `value`.
///
/// The hash covers, in the order of serialisation, the names of structs, fields, enums and variants, the type of each
/// number or text, the kind of each collection, and which elements, variants and options are present. The hash does not
/// cover the values of numbers, texts and lengths. An error if the `Serialize` implementation of the value fails.
pub(super) fn layout(value: &impl Serialize) -> Result<Layout, Refusal> {
    let mut hasher = LayoutHasher(0);
    value.serialize(&mut hasher)?;
    Ok(hasher.0.to_le_bytes())
}

/// The message of a value that cannot be serialised.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Refusal(String);

impl ser::Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

type Hashed = Result<(), Refusal>;

/// Converts up to eight bytes, the highest one first, to a number.
const fn number(bytes: &[u8]) -> u64 {
    let (mut number, mut k) = (0, 0);
    while k < bytes.len() {
        number = number << 8 | bytes[k] as u64;
        k += 1;
    }
    number
}

/// A serialiser that hashes the types of a value.
struct LayoutHasher(u64);

impl LayoutHasher {
    /// Adds a number to the hash by a bijection of the hash. A difference between two hashes therefore persists unless
    /// a later difference cancels the earlier one (probability 2^-64). The factor is the odd number next to 2^64
    /// divided by the golden ratio.
    fn add(&mut self, number: u64) {
        let product = (self.0 ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = product ^ (product >> 32);
    }

    /// Adds a word and its length.
    fn word(&mut self, word: &str) {
        for eight in word.as_bytes().chunks(8) {
            self.add(number(eight));
        }
        self.add(word.len() as u64);
    }

    fn words(&mut self, words: [&str; 2]) {
        for word in words {
            self.word(word);
        }
    }

    /// Adds a variant of the enum `name`: its kind, its number, which the serialised bytes contain, and its name.
    fn variant(&mut self, kind: &str, name: &str, number: u32, variant: &str) {
        self.words([kind, name]);
        self.add(u64::from(number));
        self.word(variant);
    }
}

/// Defines functions that hash the name of a type without parts.
macro_rules! plain {
    ($($function:ident $type:ty;)*) => {
        $(fn $function(self, _: $type) -> Hashed {
            self.add(const { number(stringify!($type).as_bytes()) });
            Ok(())
        })*
    };
}

/// Defines functions that start a collection: they hash its kind and name.
macro_rules! collections {
    ($($function:ident($($argument:ident: $type:ty),*) => $start:ident($($word:expr),*);)*) => {
        $(fn $function(self, $($argument: $type),*) -> Result<Self, Refusal> {
            self.$start($($word),*);
            Ok(self)
        })*
    };
}

impl ser::Serializer for &mut LayoutHasher {
    type Ok = ();
    type Error = Refusal;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeTupleStruct = Self;
    type SerializeTupleVariant = Self;
    type SerializeMap = Self;
    type SerializeStruct = Self;
    type SerializeStructVariant = Self;

    plain! {
        serialize_bool bool;
        serialize_i8 i8;
        serialize_i16 i16;
        serialize_i32 i32;
        serialize_i64 i64;
        serialize_i128 i128;
        serialize_u8 u8;
        serialize_u16 u16;
        serialize_u32 u32;
        serialize_u64 u64;
        serialize_u128 u128;
        serialize_f32 f32;
        serialize_f64 f64;
        serialize_char char;
        serialize_str &str;
        serialize_bytes &[u8];
    }

    fn serialize_none(self) -> Hashed {
        self.word("none");
        Ok(())
    }

    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> Hashed {
        self.word("some");
        value.serialize(self)
    }

    fn serialize_unit(self) -> Hashed {
        self.word("unit");
        Ok(())
    }

    fn serialize_unit_struct(self, name: &'static str) -> Hashed {
        self.words(["unit struct", name]);
        Ok(())
    }

    fn serialize_unit_variant(self, name: &'static str, k: u32, variant: &'static str) -> Hashed {
        self.variant("unit variant", name, k, variant);
        Ok(())
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        name: &'static str,
        value: &T,
    ) -> Hashed {
        self.words(["newtype", name]);
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        name: &'static str,
        k: u32,
        variant: &'static str,
        value: &T,
    ) -> Hashed {
        self.variant("newtype variant", name, k, variant);
        value.serialize(self)
    }

    collections! {
        serialize_seq(_length: Option<usize>) => word("sequence");
        serialize_tuple(_length: usize) => word("tuple");
        serialize_tuple_struct(name: &'static str, _length: usize) => words(["tuple struct", name]);
        serialize_tuple_variant(
            name: &'static str, k: u32, variant: &'static str, _length: usize
        ) => variant("tuple variant", name, k, variant);
        serialize_map(_length: Option<usize>) => word("map");
        serialize_struct(name: &'static str, _length: usize) => words(["struct", name]);
        serialize_struct_variant(
            name: &'static str, k: u32, variant: &'static str, _length: usize
        ) => variant("struct variant", name, k, variant);
    }

    fn collect_str<T: ?Sized + Display>(self, _: &T) -> Hashed {
        self.word("&str");
        Ok(())
    }

    /// Returns false, as the serialiser of postcard, which writes the bytes, does.
    fn is_human_readable(&self) -> bool {
        false
    }
}

/// Defines the serialisation of collections: the trait and its function for a part, with `name` if parts have names.
macro_rules! parts {
    ($($collection:ident $function:ident($($name:ident)?);)*) => {
        $(impl $collection for &mut LayoutHasher {
            type Ok = ();
            type Error = Refusal;

            fn $function<T: ?Sized + Serialize>(
                &mut self,
                $($name: &'static str,)?
                value: &T,
            ) -> Hashed {
                $(self.word($name);)?
                value.serialize(&mut **self)
            }

            fn end(self) -> Hashed {
                self.word("end");
                Ok(())
            }
        })*
    };
}

parts! {
    SerializeSeq serialize_element();
    SerializeTuple serialize_element();
    SerializeTupleStruct serialize_field();
    SerializeTupleVariant serialize_field();
    SerializeStruct serialize_field(name);
    SerializeStructVariant serialize_field(name);
}

impl SerializeMap for &mut LayoutHasher {
    type Ok = ();
    type Error = Refusal;

    fn serialize_key<T: ?Sized + Serialize>(&mut self, key: &T) -> Hashed {
        key.serialize(&mut **self)
    }

    fn serialize_value<T: ?Sized + Serialize>(&mut self, value: &T) -> Hashed {
        value.serialize(&mut **self)
    }

    fn end(self) -> Hashed {
        self.word("end");
        Ok(())
    }
}
