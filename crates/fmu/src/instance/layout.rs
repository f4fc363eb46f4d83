//! The layout of a serialised value: which fields it has, in which order, and of which types.
//!
//! The bytes of a serialised state have no names. A build of the same FMU whose private fields have
//! another order would read them into the wrong fields, and nothing else would tell. So the state
//! has a hash of the layout beside it, which the reader computes again from the value that it read:
//! if that was written into other fields, names, order or types differ.

use std::fmt::Display;

use serde::ser::{
    self, Serialize, SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant,
    SerializeTuple, SerializeTupleStruct, SerializeTupleVariant,
};

/// A hash of the layout.
pub(super) type Layout = [u8; 8];

/// The layout of `value`.
///
/// It holds, in the order of serialisation, the names of structs, fields, enums and variants, the
/// type of each number or text, and the kind of each collection. The values of numbers, texts and
/// lengths are not part of it, but which elements, variants and options there are is.
///
/// # Errors
///
/// What the value's own `Serialize` refuses.
pub(super) fn layout(value: &impl Serialize) -> Result<Layout, Refusal> {
    let mut walk = Walk(0);
    value.serialize(&mut walk)?;
    Ok(walk.0.to_le_bytes())
}

/// Why a value cannot be serialised.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Refusal(String);

impl ser::Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

type Done = Result<(), Refusal>;

/// Up to eight bytes as a number.
const fn number(bytes: &[u8]) -> u64 {
    let (mut number, mut k) = (0, 0);
    while k < bytes.len() {
        number = number << 8 | bytes[k] as u64;
        k += 1;
    }
    number
}

/// A serialiser that hashes what it is told of the types.
struct Walk(u64);

impl Walk {
    /// Adds a number to the hash: for each number a bijection of what was there, so that a difference
    /// stays one unless another one happens to undo it (1 in 2^64). The factor is 2^64 divided by the
    /// golden ratio, and odd.
    fn add(&mut self, number: u64) {
        let product = (self.0 ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = product ^ (product >> 32);
    }

    /// Adds a word, with its length.
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

    /// A variant of an enum: its name and its number, which is what the bytes hold.
    fn variant(&mut self, kind: &str, name: &str, number: u32, variant: &str) {
        self.words([kind, name]);
        self.add(u64::from(number));
        self.word(variant);
    }
}

/// Types without a part: their names are short, and known to the compiler.
macro_rules! plain {
    ($($function:ident $type:ty;)*) => {
        $(fn $function(self, _: $type) -> Done {
            self.add(const { number(stringify!($type).as_bytes()) });
            Ok(())
        })*
    };
}

impl ser::Serializer for &mut Walk {
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

    fn serialize_none(self) -> Done {
        self.word("none");
        Ok(())
    }

    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> Done {
        self.word("some");
        value.serialize(self)
    }

    fn serialize_unit(self) -> Done {
        self.word("unit");
        Ok(())
    }

    fn serialize_unit_struct(self, name: &'static str) -> Done {
        self.words(["unit struct", name]);
        Ok(())
    }

    fn serialize_unit_variant(self, name: &'static str, k: u32, variant: &'static str) -> Done {
        self.variant("unit variant", name, k, variant);
        Ok(())
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        name: &'static str,
        value: &T,
    ) -> Done {
        self.words(["newtype", name]);
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        name: &'static str,
        k: u32,
        variant: &'static str,
        value: &T,
    ) -> Done {
        self.variant("newtype variant", name, k, variant);
        value.serialize(self)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Self, Refusal> {
        self.word("sequence");
        Ok(self)
    }

    fn serialize_tuple(self, _: usize) -> Result<Self, Refusal> {
        self.word("tuple");
        Ok(self)
    }

    fn serialize_tuple_struct(self, name: &'static str, _: usize) -> Result<Self, Refusal> {
        self.words(["tuple struct", name]);
        Ok(self)
    }

    fn serialize_tuple_variant(
        self,
        name: &'static str,
        k: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self, Refusal> {
        self.variant("tuple variant", name, k, variant);
        Ok(self)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self, Refusal> {
        self.word("map");
        Ok(self)
    }

    fn serialize_struct(self, name: &'static str, _: usize) -> Result<Self, Refusal> {
        self.words(["struct", name]);
        Ok(self)
    }

    fn serialize_struct_variant(
        self,
        name: &'static str,
        k: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self, Refusal> {
        self.variant("struct variant", name, k, variant);
        Ok(self)
    }

    fn collect_str<T: ?Sized + Display>(self, _: &T) -> Done {
        self.word("&str");
        Ok(())
    }

    /// As postcard, which writes the bytes.
    fn is_human_readable(&self) -> bool {
        false
    }
}

/// Collections whose parts have no names.
macro_rules! elements {
    ($($collection:ident $function:ident;)*) => {
        $(impl $collection for &mut Walk {
            type Ok = ();
            type Error = Refusal;

            fn $function<T: ?Sized + Serialize>(&mut self, value: &T) -> Done {
                value.serialize(&mut **self)
            }

            fn end(self) -> Done {
                self.word("end");
                Ok(())
            }
        })*
    };
}

elements! {
    SerializeSeq serialize_element;
    SerializeTuple serialize_element;
    SerializeTupleStruct serialize_field;
    SerializeTupleVariant serialize_field;
}

/// Collections whose parts have names.
macro_rules! fields {
    ($($collection:ident)*) => {
        $(impl $collection for &mut Walk {
            type Ok = ();
            type Error = Refusal;

            fn serialize_field<T: ?Sized + Serialize>(
                &mut self,
                name: &'static str,
                value: &T,
            ) -> Done {
                self.word(name);
                value.serialize(&mut **self)
            }

            fn end(self) -> Done {
                self.word("end");
                Ok(())
            }
        })*
    };
}

fields! { SerializeStruct SerializeStructVariant }

impl SerializeMap for &mut Walk {
    type Ok = ();
    type Error = Refusal;

    fn serialize_key<T: ?Sized + Serialize>(&mut self, key: &T) -> Done {
        key.serialize(&mut **self)
    }

    fn serialize_value<T: ?Sized + Serialize>(&mut self, value: &T) -> Done {
        value.serialize(&mut **self)
    }

    fn end(self) -> Done {
        self.word("end");
        Ok(())
    }
}
