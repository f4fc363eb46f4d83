//! Types that are read from a single value of TOML.

/// Implements `Deserialize` for a type that is read from a value of several types of TOML. `$expected` describes the
/// value in errors. For each type, `$visit` is the method of [`serde::de::Visitor`], and `$result` the converted value
/// or the message of an error.
macro_rules! from_toml {
    (
        $type:ty, $expected:expr;
        $($(#[$meta:meta])* $visit:ident($value:ident: $from:ty) => $result:expr;)*
    ) => {
        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Visitor;

                impl serde::de::Visitor<'_> for Visitor {
                    type Value = $type;

                    fn expecting(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                        text.write_str($expected)
                    }

                    $($(#[$meta])*
                    fn $visit<E: serde::de::Error>(self, $value: $from) -> Result<$type, E> {
                        let result: Result<$type, String> = $result;
                        result.map_err(E::custom)
                    })*
                }
                deserializer.deserialize_any(Visitor)
            }
        }
    };
}
pub(crate) use from_toml;
