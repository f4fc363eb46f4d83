//! The types of values in the C interface of FMI 3.0.

macro_rules! native_types {
    ($($name:ident)*) => {
        /// The types of values in the C interface of FMI 3.0 (`fmi3FunctionTypes.h`). Each has two functions,
        /// `fmi3Get{VariableType}` and `fmi3Set{VariableType}`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the names are those of the standard")]
        pub enum NativeType {
            $($name,)*
        }

        impl NativeType {
            /// Returns the `{VariableType}` in the names of the type's functions, as in `fmi3GetFloat64`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => stringify!($name),)*
                }
            }

            /// Returns the name of the function that reads variables of the type.
            #[must_use]
            pub const fn getter(self) -> &'static str {
                match self {
                    $(Self::$name => concat!("fmi3Get", stringify!($name)),)*
                }
            }

            /// Returns the name of the function that sets variables of the type.
            #[must_use]
            pub const fn setter(self) -> &'static str {
                match self {
                    $(Self::$name => concat!("fmi3Set", stringify!($name)),)*
                }
            }
        }
    };
}

native_types! {
    Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Clock
}
