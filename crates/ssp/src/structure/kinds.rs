//! Kinds and types of connectors and components, and values of parameters (SSP 1.0.1 and 2.0, sections 4.5.1,
//! 5.2.1, 5.4 and 6).

/// Declares an enumeration with the texts of its values in the files.
macro_rules! words {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $(#[doc = concat!("`", $text, "`.")] $(#[$doc])* $variant,)* }

        impl $name {
            /// All values, in the order of the declaration.
            pub const ALL: [$name; [$($text),*].len()] = [$($name::$variant),*];

            /// Returns the attribute value of the standard.
            #[must_use]
            pub fn as_str(self) -> &'static str {
                match self { $($name::$variant => $text,)* }
            }

            /// Returns the value with this text, if there is one.
            pub(crate) fn named(text: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.as_str() == text)
            }
        }
    };
}

words! {
    /// `kind` of a connector.
    ConnectorKind {
        Input = "input",
        Output = "output",
        Parameter = "parameter",
        CalculatedParameter = "calculatedParameter",
        /// Input and output, in references to signal dictionaries only.
        Inout = "inout",
        /// SSP 2.0, of FMI 3.0.
        StructuralParameter = "structuralParameter",
        /// SSP 2.0.
        Constant = "constant",
        /// SSP 2.0.
        Local = "local",
        /// SSP 2.0: the kind follows from the variable of the FMU or, without one, from the connection.
        Unspecified = "unspecified",
    }
}

words! {
    /// `type` of a component: the media type of its source.
    #[derive(Default)]
    Content {
        #[default]
        Fmu = "application/x-fmu-sharedlibrary",
        /// An SSD file.
        Definition = "application/x-ssp-definition",
        /// An SSP archive.
        Package = "application/x-ssp-package",
    }
}

words! {
    /// `implementation` of a component.
    #[derive(Default)]
    Implementation {
        #[default]
        Any = "any",
        CoSimulation = "CoSimulation",
        ModelExchange = "ModelExchange",
        /// SSP 2.0, of FMI 3.0.
        ScheduledExecution = "ScheduledExecution",
    }
}

/// Type of a connector or of an entry of a signal dictionary (section 4.5.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    /// `Real` with its `unit`; of SSP 2.0 also `Float64` and `Float32`.
    Real(Option<String>),
    /// `Integer`; of SSP 2.0 also `Int8` to `UInt64`.
    Integer,
    /// `Boolean`.
    Boolean,
    /// `String`.
    String,
    /// `Enumeration` with its `name`.
    Enumeration(String),
    /// `Binary`, which FMI 2.0 does not have.
    Binary,
    /// `Clock` (SSP 2.0), which FMI 2.0 does not have.
    Clock,
    /// An array with the given dimensions (SSP 2.0), of any element type.
    Array(Vec<Dimension>),
    /// A value of any type that belongs to the clock of this name (SSP 2.0).
    Clocked(String),
}

/// `Dimension` of an array (SSP 2.0).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// `size`.
    Size(u64),
    /// `sizeConnector`: the connector that states the size.
    Connector(String),
    /// Neither `size` nor `sizeConnector` is stated.
    Open,
}

impl Type {
    /// Describes an array, a clock or a value of a clock, which FMI 2.0 does not have; `None` for other types.
    #[must_use]
    pub fn beyond_fmi2(&self) -> Option<String> {
        Some(match self {
            Type::Clock => "a clock".to_owned(),
            Type::Clocked(clock) => format!("a value of the clock {clock}"),
            Type::Array(dimensions) => {
                let sizes = dimensions.iter().map(|dimension| match dimension {
                    Dimension::Size(size) => size.to_string(),
                    Dimension::Connector(name) => name.clone(),
                    Dimension::Open => "any number".to_owned(),
                });
                format!("an array of {} elements", sizes.collect::<Vec<_>>().join(" x "))
            }
            _ => return None,
        })
    }
}

/// Value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// `Real` with its `unit`; of SSP 2.0 also `Float64` and `Float32`.
    Real(f64, Option<String>),
    /// `Integer`; of SSP 2.0 also `Int8` to `UInt64` with a value that fits.
    Integer(i32),
    /// `Boolean`.
    Boolean(bool),
    /// `String`.
    String(String),
    /// `Enumeration`: name of an item, and `name` of the enumeration.
    Enumeration(String, Option<String>),
    /// `Binary`, which FMI 2.0 does not have, in hexadecimal digits.
    Binary(String),
    /// `Int8` to `UInt64` (SSP 2.0) with a value beyond `i32`, which FMI 2.0 does not have.
    Long(i128),
    /// An array (SSP 2.0), which FMI 2.0 does not have: name of the element that states the type, and values as text.
    Array(String, Vec<String>),
}
